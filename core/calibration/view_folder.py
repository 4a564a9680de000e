"""Views of the board as a folder of pictures (``geoderm-calibration-views/1``): to solve again, or elsewhere.

    views.json
    infrared_000.png   8 or 16 bit grey     color_000.png   8-bit RGB     depth_000.png   16 bit

views.json: {"format", "depth_serial", "color_serial", "model", "sensor", "board": {"squares_x", "squares_y",
"square_m", "marker_m", "dictionary"}, "depth_unit_m", "views": [{"infrared", "color", "depth"}, ...]}; any of
the three pictures of a view may be missing.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core.calibration.board import BoardSpec, detect_board
from core.calibration.views import RigView, view_of
from core.capture.fields import read_bytes
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress

VIEWS_FORMAT = "geoderm-calibration-views/1"
VIEWS_FILE = "views.json"
_LIMIT_BYTES = 1_000_000
_LIMIT_IMAGE_BYTES = 200_000_000


@dataclass(frozen=True)
class ViewFolderInfo:
    """What a folder of views says of itself.

    Attributes
    ----------
    depth_serial, color_serial, model, sensor : str
        As `devices.live.CameraIdentity`.
    spec : BoardSpec
    depth_unit_m : float
    """

    depth_serial: str
    color_serial: str
    model: str
    sensor: str
    spec: BoardSpec
    depth_unit_m: float = 0.001


class ViewFolderWriter:
    """Writes views as they come; the folder is complete after each.

    Parameters
    ----------
    folder : Path
        New or empty.
    info : ViewFolderInfo

    Raises
    ------
    InputError
        If there is something in the folder.
    """

    def __init__(self, folder: Path, info: ViewFolderInfo) -> None:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: is not an empty folder.", "Name a new folder for the views.")
        self._folder, self._info = folder, info
        self._views: list[dict[str, str]] = []

    def add(
        self,
        infrared: NDArray[Any] | None,
        rgb: NDArray[np.uint8] | None,
        depth: NDArray[np.uint16] | None,
    ) -> None:
        """Write the pictures of one view; raise `WorkError` if the folder cannot be written."""
        number = len(self._views)
        entry: dict[str, str] = {}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            for kind, image in (
                ("infrared", infrared),
                ("color", None if rgb is None else np.ascontiguousarray(rgb[..., ::-1])),
                ("depth", depth),
            ):
                if image is None:
                    continue
                entry[kind] = f"{kind}_{number:03d}.png"
                _, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 2])
                (self._folder / entry[kind]).write_bytes(data.tobytes())
            self._views.append(entry)
            partial = self._folder / f"{VIEWS_FILE}.part"
            partial.write_text(json.dumps(self._document(), indent=1), encoding="utf-8")
            partial.replace(self._folder / VIEWS_FILE)
        except OSError as error:
            for name in (*entry.values(), f"{VIEWS_FILE}.part"):
                with contextlib.suppress(OSError):
                    (self._folder / name).unlink()
            self._views = [view for view in self._views if view is not entry]
            raise WorkError(
                f"{self._folder}: the views could not be written ({error.strerror}).",
                "Check the folder's free space and permissions.",
            ) from error

    def _document(self) -> dict[str, Any]:
        i, spec = self._info, self._info.spec
        names = ("squares_x", "squares_y", "square_m", "marker_m", "dictionary")
        return {
            "format": VIEWS_FORMAT,
            "depth_serial": i.depth_serial,
            "color_serial": i.color_serial,
            "model": i.model,
            "sensor": i.sensor,
            "board": {name: getattr(spec, name) for name in names},
            "depth_unit_m": i.depth_unit_m,
            "views": self._views,
        }


def read_views(
    folder: Path, square_m: float | None = None, progress: Progress = no_progress
) -> tuple[ViewFolderInfo, list[RigView]]:
    """Read a folder of views and find the board in each picture; views without a board are left out.

    Parameters
    ----------
    folder : Path
    square_m : float, optional
        Measured side of a square, in place of what the folder says.

    Raises
    ------
    InputError
        Naming file and field.
    """
    info, entries = _read_document(folder, square_m)
    views = []
    for number, (infrared, color, depth) in enumerate(_pictures(folder, entries)):
        progress(number / max(len(entries), 1), f"View {number + 1} of {len(entries)}")
        found = [
            None if image is None else detect_board(image, info.spec, thorough=True)
            for image in (infrared, color)
        ]
        if any(f is not None for f in found):
            views.append(view_of(found[0], found[1], depth, info.depth_unit_m))
    progress(1.0, f"View {len(entries)} of {len(entries)}")
    return info, views


def _read_document(folder: Path, square_m: float | None) -> tuple[ViewFolderInfo, list[_Entry]]:
    path = folder / VIEWS_FILE
    try:
        data = read_bytes(path, _LIMIT_BYTES)
    except InputError as error:
        raise InputError(error.message, "A folder of views holds a views.json.") from error
    try:
        document = _Document.model_validate(json.loads(data))
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"]) or "document"
        raise InputError(f"{path}: {name}: {first['msg']}.") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON.") from error
    if document.format != VIEWS_FORMAT:
        raise InputError(f"{path}: format: must be {VIEWS_FORMAT}.")
    try:
        spec = BoardSpec(**document.board.model_dump())
        if square_m is not None:
            spec = spec.with_square(square_m)
    except InputError as error:
        raise InputError(f"{path}: board: {error}") from error
    info = ViewFolderInfo(
        document.depth_serial,
        document.color_serial,
        document.model,
        document.sensor,
        spec,
        document.depth_unit_m,
    )
    return info, document.views


def _pictures(
    folder: Path, entries: list[_Entry]
) -> Iterator[tuple[NDArray[Any] | None, NDArray[np.uint8] | None, NDArray[np.uint16] | None]]:
    for number, entry in enumerate(entries):
        infrared = _image(folder, entry.infrared, f"views.{number}.infrared", cv2.IMREAD_UNCHANGED)
        if infrared is not None and infrared.ndim == 3:
            infrared = np.asarray(cv2.cvtColor(infrared[..., :3], cv2.COLOR_BGR2GRAY))
        color = _image(folder, entry.color, f"views.{number}.color", cv2.IMREAD_COLOR)
        depth = _image(folder, entry.depth, f"views.{number}.depth", cv2.IMREAD_UNCHANGED)
        if depth is not None and (depth.dtype != np.uint16 or depth.ndim != 2):
            raise InputError(
                f"{folder / str(entry.depth)}: views.{number}.depth must be a 16-bit grey picture."
            )
        yield infrared, None if color is None else np.ascontiguousarray(color[..., ::-1]), depth


def _image(folder: Path, name: str | None, field: str, how: int) -> NDArray[Any] | None:
    if name is None:
        return None
    path = folder / name
    if PurePath(name).name != name or not name.lower().endswith((".png", ".jpg", ".jpeg", ".tif", ".tiff")):
        raise InputError(f"{folder / VIEWS_FILE}: {field}: must name a picture in the folder.")
    try:
        data = read_bytes(path, _LIMIT_IMAGE_BYTES)
    except InputError as error:
        raise InputError(f"{error.message} ({field})") from error
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), how) if data else None
    except cv2.error:
        image = None
    if image is None or image.dtype not in (np.uint8, np.uint16) or min(image.shape[:2]) < 16:
        raise InputError(f"{path}: {field} is not a readable picture.")
    return np.asarray(image)


class _Board(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    squares_x: int
    squares_y: int
    square_m: float
    marker_m: float
    dictionary: str = "DICT_4X4_50"


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore")
    infrared: str | None = None
    color: str | None = None
    depth: str | None = None


class _Document(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    format: str
    depth_serial: str = Field(min_length=1)
    color_serial: str = ""
    model: str = ""
    sensor: str = ""
    board: _Board
    depth_unit_m: float = Field(default=0.001, gt=0, lt=1)
    views: list[_Entry] = Field(max_length=500)
