"""Where the points of a hand were, frame by frame: ``geoderm-hand/1`` as JSON, and as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field, field_validator

from core.hand.answer import HandAnswer
from core.hand.documents import CHECKED, read_document, write_document, write_text
from core.hand.names import POINT_NAMES

TRACKS_FORMAT = "geoderm-hand/1"

CSV_COLUMNS = (
    "capture",
    "configuration",
    "marker_seen",
    "reason",
    "point",
    "x_m",
    "y_m",
    "z_m",
    "pixel_u",
    "pixel_v",
    "confidence",
)

_METRE_DIGITS, _PIXEL_DIGITS, _CONFIDENCE_DIGITS = 5, 2, 4
_LIMIT_BYTES = 1_000_000_000
_LONGEST = 1000
_FAR = 1e6


@dataclass(frozen=True)
class TrackedPoint:
    """A point that was found: on the skin in the depth camera's frame, and in the picture."""

    point_m: tuple[float, float, float]
    pixel: tuple[float, float]
    confidence: float


@dataclass(frozen=True)
class TrackedFrame:
    """One frame's answer.

    Attributes
    ----------
    capture : str
    configuration : str or None
    marker_seen : bool
    reason : str or None
    points : dict of str to TrackedPoint or None
        All 15 by name; None where nothing is told.
    """

    capture: str
    configuration: str | None
    marker_seen: bool
    reason: str | None
    points: Mapping[str, TrackedPoint | None]


@dataclass(frozen=True)
class Tracks:
    """A sequence's answers in order."""

    frames: tuple[TrackedFrame, ...]


def tracked_frame(name: str, answer: HandAnswer, mirrored_px: int | None = None) -> TrackedFrame:
    """What is kept of an answer: rounded to 0.01 mm and 0.01 pixels, without points that lack a number.

    ``mirrored_px`` is the width of a picture that is stored mirrored: pixels then count in it as it is
    stored. Points stay in the camera's real frame.
    """
    told = (
        np.isfinite(answer.points_m).all(axis=1)
        & np.isfinite(answer.pixels).all(axis=1)
        & np.isfinite(answer.confidence)
    )
    points: dict[str, TrackedPoint | None] = {}
    for k, point in enumerate(POINT_NAMES):
        points[point] = _point(answer, k, mirrored_px) if told[k] else None
    # a folder's name may hold bytes that are no text
    name = name.encode("utf-8", "replace").decode("utf-8")
    return TrackedFrame(name, answer.configuration, bool(answer.marker_seen), answer.reason, points)


def _point(answer: HandAnswer, k: int, mirrored_px: int | None) -> TrackedPoint:
    x, y, z = (round(float(value), _METRE_DIGITS) + 0.0 for value in answer.points_m[k])
    across, down = map(float, answer.pixels[k])
    if mirrored_px is not None:
        across = mirrored_px - 1 - across
    u, v = (round(value, _PIXEL_DIGITS) + 0.0 for value in (across, down))
    confidence = round(min(max(float(answer.confidence[k]), 0.0), 1.0), _CONFIDENCE_DIGITS)
    return TrackedPoint((x, y, z), (u, v), confidence)


def tracks_of(answers: Iterable[tuple[str, HandAnswer]]) -> Tracks:
    """The tracks of named answers."""
    return Tracks(tuple(tracked_frame(name, answer) for name, answer in answers))


def write_tracks(path: Path, answers: Tracks | Iterable[tuple[str, HandAnswer]]) -> None:
    """Write tracks.json whole or not at all.

    Raises
    ------
    WorkError
        If it cannot be written.
    """
    tracks = answers if isinstance(answers, Tracks) else tracks_of(answers)
    frames = [
        {
            "capture": frame.capture,
            "configuration": frame.configuration,
            "marker_seen": frame.marker_seen,
            "reason": frame.reason,
            "points": {name: _json(frame.points.get(name)) for name in POINT_NAMES},
        }
        for frame in tracks.frames
    ]
    write_document(Path(path), {"format": TRACKS_FORMAT, "frames": frames})


def _json(point: TrackedPoint | None) -> dict[str, object] | None:
    if point is None:
        return None
    return {"point_m": list(point.point_m), "pixel": list(point.pixel), "confidence": point.confidence}


def read_tracks(path: Path) -> Tracks:
    """Read what `write_tracks` wrote.

    Raises
    ------
    InputError
        Naming the file and the field, for anything that is not the format.
    """
    document = read_document(Path(path), _Tracks, _LIMIT_BYTES)
    return Tracks(tuple(frame.frame() for frame in document.frames))


def write_csv(path: Path, answers: Tracks | Iterable[tuple[str, HandAnswer]]) -> None:
    """Write a table with one row for every frame and point; cells of points that are not told stay empty.

    Raises
    ------
    WorkError
        If it cannot be written.
    """
    tracks = answers if isinstance(answers, Tracks) else tracks_of(answers)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(CSV_COLUMNS)
    for frame in tracks.frames:
        about = [
            _cell(frame.capture),
            _cell(frame.configuration),
            "true" if frame.marker_seen else "false",
            _cell(frame.reason),
        ]
        for name in POINT_NAMES:
            point = frame.points.get(name)
            numbers: list[object] = [""] * 6
            if point is not None:
                numbers = [*point.point_m, *point.pixel, point.confidence]
            table.writerow([*about, name, *numbers])
    write_text(Path(path), text.getvalue())


def _cell(text: str | None) -> str:
    """Text that no spreadsheet takes for a formula: names come from folders that anybody may have named."""
    text = text or ""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


_Number = Annotated[float, Field(ge=-_FAR, le=_FAR)]


class _Point(BaseModel):
    model_config = CHECKED
    point_m: tuple[_Number, _Number, _Number]
    pixel: tuple[_Number, _Number]
    confidence: float = Field(ge=0.0, le=1.0)


class _Frame(BaseModel):
    model_config = CHECKED
    capture: str = Field(max_length=_LONGEST)
    configuration: str | None = Field(default=None, max_length=_LONGEST)
    marker_seen: bool
    reason: str | None = Field(default=None, max_length=_LONGEST)
    points: dict[str, _Point | None]

    @field_validator("points")
    @classmethod
    def _all_points(cls, value: dict[str, _Point | None]) -> dict[str, _Point | None]:
        if set(value) != set(POINT_NAMES):
            raise ValueError(f"must name each of the {len(POINT_NAMES)} points of a hand once")
        return value

    def frame(self) -> TrackedFrame:
        points = {
            name: None if p is None else TrackedPoint(p.point_m, p.pixel, p.confidence)
            for name, p in self.points.items()
        }
        return TrackedFrame(self.capture, self.configuration, self.marker_seen, self.reason, points)


class _Tracks(BaseModel):
    model_config = CHECKED
    format: Literal["geoderm-hand/1"]
    frames: list[_Frame]
