"""Training frames and sequences on disk: a folder of capture folders, each with an optional hand.json.

``hand.json``: ``{"configuration": "A", "points": {"thumb_tip": {"point_m": [x, y, z], "visible": true}}}``,
points in the frame of the depth camera that capture.json describes, as its joints are.
"""

from __future__ import annotations

import unicodedata
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, field_validator

from core.capture.fields import load_json_object
from core.capture.folder import CAPTURE_FILE
from core.errors import InputError
from core.hand.documents import CHECKED, read_document, write_document
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES

LABELS_FILE = "hand.json"
LONGEST_NAME = 60
"""Characters of a configuration's name."""

FARTHEST_M = 5.0
"""Nobody labels a hand farther away: larger numbers are millimetres."""

_LIMIT_BYTES = 200_000
_MOST_FRAMES = 100_000
_MOST_LOOKED_INTO = 100


def dataset_frames(folder: Path) -> list[Path]:
    """Capture folders of a dataset or sequence in name order; a capture folder is a sequence of one.

    Raises
    ------
    InputError
        If there is none.
    """
    folder = Path(folder)
    try:
        if not folder.is_dir():
            raise InputError(f"{folder}: is not a folder.", "Give a folder of capture folders.")
        if (folder / CAPTURE_FILE).exists():
            return [folder]
        found = sorted(
            (p for p in folder.iterdir() if p.name[0] != "." and (p / CAPTURE_FILE).exists()),
            key=lambda p: p.name,
        )
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "no valid path"
        raise InputError(f"{str(folder)[:300]}: cannot be listed ({reason}).") from error
    if not found:
        deeper = _holder_of_captures(folder)
        raise InputError(
            f"{folder}: no sub-folder holds a {CAPTURE_FILE}.",
            "Give a folder of capture folders."
            if deeper is None
            else f"Those of '{deeper}' do: give that one, or put all capture folders into one folder.",
        )
    if len(found) > _MOST_FRAMES:
        raise InputError(f"{folder}: holds more than {_MOST_FRAMES} captures.", "Take a part of them.")
    return found


def _holder_of_captures(folder: Path) -> str | None:
    """The name of a sub-folder that is a folder of capture folders, if there is one; looked for briefly."""
    try:
        for inner in islice(sorted(p for p in folder.iterdir() if p.is_dir()), _MOST_LOOKED_INTO):
            if any((p / CAPTURE_FILE).exists() for p in islice(inner.iterdir(), _MOST_LOOKED_INTO)):
                return inner.name
    except OSError:
        return None
    return None


def configuration_name(text: str) -> str:
    """The name of a configuration as it is kept: without blanks around it, accents with their letters.

    Raises
    ------
    InputError
        If it is empty, too long or cannot be printed.
    """
    name = unicodedata.normalize("NFC", text.strip())
    if not name:
        raise InputError("The name of a configuration is empty.", "Give one such as 'open' or 'A'.")
    if len(name) > LONGEST_NAME or not name.isprintable():
        raise InputError(f"The name of a configuration has at most {LONGEST_NAME} printable characters.")
    return name


def read_labels(capture_folder: Path) -> FrameLabels | None:
    """What is labelled in a frame, in the frame of `core.capture.read_capture`; None without a hand.json.

    Raises
    ------
    InputError
        Naming the file and the field, for anything that is not the format.
    """
    path = Path(capture_folder) / LABELS_FILE
    try:
        if not path.exists() and not path.is_symlink():
            return None
    except (OSError, ValueError) as error:
        raise InputError(f"{str(path)[:300]}: cannot be read.") from error
    document = read_document(path, _Labels, _LIMIT_BYTES)
    flip = _flip(Path(capture_folder))
    points = {name: point for name, point in document.points.items() if point is not None}
    return FrameLabels(
        document.configuration,
        {name: np.array(point.point_m) * flip for name, point in points.items()},
        {name: point.visible for name, point in points.items()},
    )


def write_labels(capture_folder: Path, labels: FrameLabels) -> None:
    """Write a frame's hand.json whole or not at all; an earlier one is replaced.

    Raises
    ------
    InputError
        If a point is unknown or not finite, or the configuration's name cannot be one.
    WorkError
        If it cannot be written.
    """
    folder = Path(capture_folder)
    flip = _flip(folder)
    points: dict[str, object] = {}
    for name in sorted(labels.points_m, key=_order):
        place = np.asarray(labels.points_m[name], dtype=float)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise InputError(f"{folder / LABELS_FILE}: points.{name}: must be three finite numbers.")
        points[name] = {
            "point_m": [round(float(x), 6) + 0.0 for x in place * flip],
            "visible": bool(labels.visible.get(name, True)),
        }
    named = None if labels.configuration is None else configuration_name(labels.configuration)
    write_document(folder / LABELS_FILE, {"configuration": named, "points": points})


def _order(name: str) -> int:
    if name not in POINT_NAMES:
        raise InputError(f"A hand has no point '{name[:40]}'.", f"Its points are {', '.join(POINT_NAMES)}.")
    return POINT_NAMES.index(name)


def _flip(folder: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Signs (3,) from the recorded frame to the one in use: mirrored captures are un-mirrored on reading."""
    path = folder / CAPTURE_FILE
    mirrored = path.exists() and load_json_object(path).flag("mirrored", False)
    return np.array([-1.0 if mirrored else 1.0, 1.0, 1.0])


_Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]


class _Point(BaseModel):
    model_config = CHECKED
    point_m: list[_Coordinate] = Field(min_length=3, max_length=3)
    visible: bool = True

    @field_validator("point_m")
    @classmethod
    def _before_camera(cls, value: list[float]) -> list[float]:
        if value[2] <= 0.0:
            raise ValueError("lies behind the camera")
        return value


class _Labels(BaseModel):
    model_config = CHECKED
    configuration: str | None = None
    points: dict[str, _Point | None] = {}

    @field_validator("configuration")
    @classmethod
    def _name(cls, value: str | None) -> str | None:
        try:
            return None if value is None else configuration_name(value)
        except InputError as error:
            raise ValueError(error.message) from error

    @field_validator("points")
    @classmethod
    def _known(cls, value: dict[str, _Point | None]) -> dict[str, _Point | None]:
        for name in value:
            try:
                _order(name)
            except InputError as error:
                raise ValueError(str(error)) from error
        return value
