"""Recordings of every form as a row of frames: ``.oni`` files, capture folders, sequences of capture folders.

A sequence is a folder of capture folders with a ``sequence.json`` beside them:
``{"format": "geoderm-sequence/1", "nominal": BOOL, "captures": [{"folder": NAME, "times_s": [...],
"color_time_s": S}, ...]}``, times from the beginning of the recording. A folder of capture folders without
it, and a single capture folder, play at the nominal rate.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core.calibration.profile import CalibrationProfile
from core.capture import RgbdCapture, read_capture
from core.capture.fields import read_bytes
from core.capture.folder import CAPTURE_FILE
from core.capture.rgbd import CameraRig
from core.errors import InputError
from devices.live import LiveFrame
from devices.openni.calibration import NOMINAL_WARNING
from devices.openni.recording import OniRecording

SEQUENCE_FILE = "sequence.json"
SEQUENCE_FORMAT = "geoderm-sequence/1"
NOMINAL_PERIOD_S = 1 / 30
_LIMIT_BYTES = 50_000_000
_LONGEST_S = 1e6
_LONGEST_NAME = 255


@dataclass(frozen=True)
class SourceFacts:
    """What is known about all frames of a recording.

    Attributes
    ----------
    name : str
    rig : CameraRig
    sensor : str
    calibration : dict or None
        Document of the profile.
    depth_corrected : bool
        Whether the profile's depth correction is in the frames.
    warnings : tuple of str
    frames : int
        How many there are; 0 if it is known only at the end.
    """

    name: str
    rig: CameraRig
    sensor: str
    calibration: dict[str, Any] | None
    depth_corrected: bool
    warnings: tuple[str, ...]
    frames: int


class FrameSource(Protocol):
    """A recording that can be gone through any number of times."""

    def facts(self) -> SourceFacts:
        """What holds for every frame."""

    def frames(self) -> Iterator[LiveFrame]:
        """The frames from the beginning, not mirrored, `LiveFrame.time_s` as recorded."""

    def close(self) -> None:
        """Let go of the file; it can be used again."""


def open_source(path: Path) -> FrameSource:
    """Recording at a path.

    Raises
    ------
    InputError
        If it is none.
    """
    if path.is_file():
        return OniSource(path)
    if not path.is_dir():
        raise InputError(f"{path}: there is no such recording.", "Give a .oni file or a capture folder.")
    return FolderSource(path)


class OniSource:
    """An ``.oni`` file."""

    def __init__(self, path: Path) -> None:
        self._recording = OniRecording(path)

    def facts(self) -> SourceFacts:
        """What holds for every frame."""
        recording = self._recording
        recording.open()
        profile = recording.profile
        return SourceFacts(
            recording.info.name,
            recording.frame_rig(),
            recording.sensor,
            None if profile is None else profile.document(),
            recording.depth_corrected,
            recording.warnings,
            recording.frame_count,
        )

    def frames(self) -> Iterator[LiveFrame]:
        """The frames from the beginning."""
        self._recording.close()
        yield from self._recording.frames()

    def close(self) -> None:
        """End the runtime's process."""
        self._recording.close()


class FolderSource:
    """A capture folder, or a folder of them; one is in memory at a time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._listed = _read_sequence(path)
        self._first: RgbdCapture | None = None

    def facts(self) -> SourceFacts:
        """What holds for every frame, from the first capture."""
        if self._first is None:
            self._first = read_capture(self._listed[0].path)
        first, file = self._first, self._listed[0].path / CAPTURE_FILE
        calibration = None
        if first.calibration is not None:
            calibration = CalibrationProfile.from_document(
                first.calibration, f"{file}: calibration"
            ).document()
        return SourceFacts(
            self._path.name,
            first.rig,
            first.sensor,
            calibration,
            True,
            first.warnings or ((NOMINAL_WARNING,) if self._nominal() else ()),
            sum(len(listed.times_s) for listed in self._listed),
        )

    def _nominal(self) -> bool:
        return any(listed.nominal for listed in self._listed)

    def frames(self) -> Iterator[LiveFrame]:
        """The frames of one capture after the other."""
        number, begin_s = 0, 0.0
        first: RgbdCapture | None = None
        for listed in self._listed:
            capture = read_capture(listed.path)
            first = first or capture
            _check_same_cameras(first, capture, listed.path)
            if len(capture.depth_frames) != len(listed.times_s) and listed.times_s:
                raise InputError(
                    f"{self._path / SEQUENCE_FILE}: times_s: {len(listed.times_s)} times for "
                    f"{len(capture.depth_frames)} frames of {listed.path.name}."
                )
            times = listed.times_s or tuple(
                begin_s + i * NOMINAL_PERIOD_S for i in range(len(capture.depth_frames))
            )
            for depth, time_s in zip(capture.depth_frames, times, strict=True):
                number += 1
                color_s = time_s if listed.color_time_s is None else listed.color_time_s
                yield LiveFrame(number, time_s, depth, capture.depth_unit_m, capture.color, color_s)
            begin_s = times[-1] + NOMINAL_PERIOD_S

    def close(self) -> None:
        """Forget the first capture."""
        self._first = None


def _check_same_cameras(first: RgbdCapture, capture: RgbdCapture, folder: Path) -> None:
    """What plays as one recording comes from one rig: sizes and unit stay."""
    for name, one, other in (
        ("depth", first.rig.depth, capture.rig.depth),
        ("color", first.rig.color, capture.rig.color),
    ):
        if one is not None and other is not None and (one.width, one.height) != (other.width, other.height):
            raise InputError(
                f"{folder / CAPTURE_FILE}: {name}.intrinsics: {other.width} x {other.height} pixels; the "
                f"first capture has {one.width} x {one.height}."
            )
    if (first.rig.color is None) != (capture.rig.color is None):
        raise InputError(f"{folder / CAPTURE_FILE}: color: one capture has a picture and another has none.")
    if first.depth_unit_m != capture.depth_unit_m:
        raise InputError(f"{folder / CAPTURE_FILE}: depth.unit_m: differs from the first capture's.")


@dataclass(frozen=True)
class _Listed:
    path: Path
    times_s: tuple[float, ...] = ()
    color_time_s: float | None = None
    nominal: bool = False


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    folder: str
    times_s: list[Annotated[float, Field(ge=0, le=_LONGEST_S)]] = Field(min_length=1, max_length=10_000)
    color_time_s: float | None = Field(default=None, ge=-_LONGEST_S, le=_LONGEST_S)


class _Sequence(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    format: str
    captures: list[_Entry] = Field(min_length=1)
    nominal: bool = False


def _read_sequence(path: Path) -> list[_Listed]:
    if (path / CAPTURE_FILE).is_file():
        return [_Listed(path)]
    file = path / SEQUENCE_FILE
    if not file.is_file():
        found = sorted(p.parent for p in path.glob(f"*/{CAPTURE_FILE}"))
        if not found:
            raise InputError(
                f"{path}: holds no capture.", "Give a capture folder, or a folder of capture folders."
            )
        return [_Listed(folder) for folder in found]
    try:
        content = _Sequence.model_validate_json(read_bytes(file, _LIMIT_BYTES))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "file"
        raise InputError(f"{file}: {where}: {first['msg']}.") from error
    if content.format != SEQUENCE_FORMAT:
        raise InputError(f"{file}: format: expected {SEQUENCE_FORMAT}.")
    listed: list[_Listed] = []
    for i, entry in enumerate(content.captures):
        named = Path(entry.folder).name == entry.folder and entry.folder not in ("", ".", "..")
        if not named or not entry.folder.isprintable() or len(os.fsencode(entry.folder)) > _LONGEST_NAME:
            raise InputError(f"{file}: captures.{i}.folder: must name a folder beside the file.")
        before_s = listed[-1].times_s[-1] if listed else 0.0
        if sorted(entry.times_s) != entry.times_s or entry.times_s[0] < before_s:
            raise InputError(f"{file}: captures.{i}.times_s: must not go back.")
        listed.append(_Listed(path / entry.folder, tuple(entry.times_s), entry.color_time_s, content.nominal))
    return listed


def write_sequence(path: Path, entries: list[dict[str, Any]], *, nominal: bool) -> None:
    """Write ``sequence.json``: entries with folder, times_s and color_time_s."""
    document = {"format": SEQUENCE_FORMAT, "nominal": nominal, "captures": entries}
    partial = path / f"{SEQUENCE_FILE}.part"
    partial.write_text(json.dumps(document, indent=1), encoding="utf-8")
    partial.replace(path / SEQUENCE_FILE)
