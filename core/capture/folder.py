"""The capture folder ``geoderm-capture/1``: read with every check, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.fields import Fields, load_json_object
from core.capture.images import png_bytes, read_color_image, read_depth_png
from core.capture.mirror import unmirror
from core.capture.rgbd import CameraRig, FloatArray, RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError

CAPTURE_FORMAT = "geoderm-capture/1"
CAPTURE_FILE = "capture.json"

_MAX_SIDE = 16_384
_MAX_PIXELS = 120_000_000
_MAX_FRAMES = 1_000
_MAX_DEPTH_BYTES = 1_000_000_000
_PLAUSIBLE_MEDIAN_M = (0.1, 12.0)
_MAX_BASELINE_M = 5.0
_MAX_JOINT_M = 15.0
_MAX_JOINTS = 200
# A pixel seen more than 80 degrees off the axis, or focal lengths beyond any lens: a unit or order mistake.
_MAX_RAY = 6.0
# A lens that draws the whole view together to less than this share of its width is no lens.
_MIN_SPREAD = 0.2
_FOCAL_RANGE = (0.05, 200.0)


def read_capture(folder: Path) -> RgbdCapture:
    """Read a capture folder; a mirrored recording is un-mirrored.

    Raises
    ------
    InputError
        For anything wrong, naming the file and the field.
    """
    folder = Path(folder)
    path = folder / CAPTURE_FILE
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder.", "Give the path of a capture folder.")
    if not path.exists():
        raise InputError(f"{path}: the file does not exist.", "A capture folder holds a capture.json.")
    fields = load_json_object(path)
    if fields.raw("format") != CAPTURE_FORMAT:
        raise fields.error(
            "format", f'must be "{CAPTURE_FORMAT}".', "Another program may have written this folder."
        )
    rig, color_file = _read_rig(fields)
    frames, unit_m = _read_depth(folder, fields.object("depth"), rig.depth)
    color = None
    if color_file is not None and rig.color is not None:
        color = read_color_image(color_file, (rig.color.width, rig.color.height), "color.file")
    capture = RgbdCapture(
        depth_frames=frames,
        depth_unit_m=unit_m,
        rig=rig,
        color=color,
        view=fields.text("view", "front"),
        stance=fields.text("stance", ""),
        taken_at=_read_time(fields),
        mirrored=fields.flag("mirrored", False),
        joints_m=_read_joints(fields),
        sensor=fields.text("sensor", ""),
        calibration=fields.object("calibration").as_dict() if fields.has("calibration") else None,
    )
    return unmirror(capture)


def read_visit(folder: Path) -> list[tuple[str, RgbdCapture]]:
    """The captures of a visit folder by name, or the one capture of a capture folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"{folder}: is not a folder.", "Give a capture folder or a folder of capture folders."
        )
    if (folder / CAPTURE_FILE).exists():
        return [(folder.resolve().name, read_capture(folder))]
    try:
        names = sorted(p.name for p in folder.iterdir() if (p / CAPTURE_FILE).exists() and p.name[0] != ".")
    except OSError as error:
        raise InputError(f"{folder}: cannot be listed ({error.strerror}).") from error
    if not names:
        raise InputError(
            f"{folder / CAPTURE_FILE}: the file does not exist, and no sub-folder holds one.",
            "Give a capture folder or a folder of capture folders.",
        )
    return [(name, read_capture(folder / name)) for name in names]


def write_capture(capture: RgbdCapture, folder: Path) -> None:
    """Write a capture folder atomically: an earlier folder of that name is replaced only by a complete one.

    Reading it back gives the same frames, picture, cameras and joints, bit for bit.

    Raises
    ------
    InputError
        If the folder cannot be written, or is there and is not a capture folder.
    """
    folder = Path(folder)
    if (
        folder.exists()
        and not (folder / CAPTURE_FILE).exists()
        and (not folder.is_dir() or any(folder.iterdir()))
    ):
        raise InputError(f"{folder}: exists and is not a capture folder.", "Choose another name.")
    staging: Path | None = None
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        staging.chmod(0o755)
        for name, data in _files(capture).items():
            _write_synced(staging / name, data)
        _swap(staging, folder)
    except OSError as error:
        raise InputError(
            f"{folder}: the capture cannot be written ({error.strerror or error}).",
            "Check the folder's permissions and the free space.",
        ) from error
    finally:  # after Ctrl-C, too
        if staging is not None:
            shutil.rmtree(staging, ignore_errors=True)


def _read_rig(fields: Fields) -> tuple[CameraRig, Path | None]:
    depth_fields = fields.object("depth")
    depth = _read_camera(depth_fields)
    if not fields.has("color"):
        if fields.has("color_from_depth"):
            raise fields.error("color_from_depth", "is given, but color is missing.")
        return CameraRig(depth), None
    color_fields = fields.object("color")
    file = _inside(fields.path.parent, color_fields, "file", color_fields.text("file"))
    color = _read_camera(color_fields)
    try:
        transform = RigidTransform.from_matrix(fields.matrix("color_from_depth", 4, 4))
    except InputError as error:
        if error.message.startswith(str(fields.path)):
            raise
        raise fields.error("color_from_depth", f"is wrong. {error.message}") from error
    if float(np.abs(transform.translation).max()) > _MAX_BASELINE_M:
        raise fields.error(
            "color_from_depth",
            f"puts the cameras {np.linalg.norm(transform.translation):.0f} m apart.",
            "Its last column must be in metres, not millimetres.",
        )
    return CameraRig(depth, color, transform), file


def _read_camera(owner: Fields) -> PinholeCamera:
    fields = owner.object("intrinsics")
    width, height = (fields.integer(side, 1, _MAX_SIDE) for side in ("width", "height"))
    if width * height > _MAX_PIXELS:
        raise fields.error("width", f"and height give more than {_MAX_PIXELS // 1_000_000} million pixels.")
    fx, fy, cx, cy = (fields.number(name) for name in ("fx", "fy", "cx", "cy"))
    for name, focal, side in (("fx", fx, width), ("fy", fy, height)):
        if not _FOCAL_RANGE[0] * side <= focal <= _FOCAL_RANGE[1] * side:
            raise fields.error(name, f"is {focal:g}, which no lens has.", "Focal lengths are in pixels.")
    for name, center, side in (("cx", cx, width), ("cy", cy, height)):
        if not -side <= center <= 2 * side:
            raise fields.error(
                name, f"is {center:g}, far outside the image.", "Principal points are in pixels."
            )
    distortion = fields.numbers("distortion") if fields.has("distortion") else ()
    try:
        camera = PinholeCamera(width, height, fx, fy, cx, cy, distortion)
    except InputError as error:
        raise fields.error("distortion", f"is wrong. {error.message}") from error
    if not _is_invertible(camera):
        name = "distortion" if any(distortion) else "fx"
        raise fields.error(name, "bends the image as no lens does.", "Calibrate the camera again.")
    return camera


def _is_invertible(camera: PinholeCamera) -> bool:
    """Whether pixels all over the image have rays that lead back to them."""
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 9))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = camera.rays(pixels)
    widest = float(np.abs(rays[:, :2]).max())
    without_lens = float(np.abs(replace(camera, distortion=()).rays(pixels)[:, :2]).max())
    if not np.isfinite(rays).all() or widest > _MAX_RAY or widest < _MIN_SPREAD * without_lens:
        return False
    back = camera.project(rays)
    return bool(np.isfinite(back).all() and np.abs(back - pixels).max() < 1.0)


def _read_depth(folder: Path, fields: Fields, camera: PinholeCamera) -> tuple[NDArray[np.uint16], float]:
    unit_m = fields.number("unit_m")
    if not 0 < unit_m < 1:
        raise fields.error(
            "unit_m", f"is {unit_m:g}; it must be between 0 and 1.", "For depth in millimetres it is 0.001."
        )
    names = fields.texts("frames")
    if not names:
        raise fields.error("frames", "is empty: at least one depth frame is needed.")
    if len(names) > _MAX_FRAMES or len(names) * camera.width * camera.height * 2 > _MAX_DEPTH_BYTES:
        raise fields.error(
            "frames", "lists more depth than fits into memory.", "Use at most 300 frames of a stance."
        )
    paths = [_inside(folder, fields, f"frames[{i}]", name) for i, name in enumerate(names)]
    size = (camera.width, camera.height)
    frames = np.empty((len(paths), camera.height, camera.width), np.uint16)
    for i, path in enumerate(paths):
        frames[i] = read_depth_png(path, size, f"depth.frames[{i}]")
    _check_depth_unit(fields, frames, unit_m)
    return frames, unit_m


def _check_depth_unit(fields: Fields, frames: NDArray[np.uint16], unit_m: float) -> None:
    """Metres taken for millimetres and the like show as a median depth at which nobody stands."""
    sample = frames[:, ::4, ::4]
    measured = sample[sample > 0]
    if measured.size == 0:
        return
    median_m = float(np.median(measured)) * unit_m
    if not _PLAUSIBLE_MEDIAN_M[0] <= median_m <= _PLAUSIBLE_MEDIAN_M[1]:
        raise fields.error(
            "unit_m",
            f"is {unit_m:g}, which puts the scene {median_m:.3g} m from the camera.",
            "Check the unit: unit_m times a pixel's value must be metres (0.001 for millimetres).",
        )


def _read_time(fields: Fields) -> datetime:
    if not fields.has("taken_at"):
        return datetime.fromtimestamp(fields.path.stat().st_mtime, UTC)
    text = fields.text("taken_at")
    try:
        moment = datetime.fromisoformat(text)
        if moment.tzinfo is None:
            raise fields.error("taken_at", "has no time zone.", "Write it as 2026-11-22T10:15:00Z.")
        return moment.astimezone(UTC)
    except (ValueError, OverflowError) as error:
        raise fields.error(
            "taken_at", "is not a date and time.", "Write it as 2026-11-22T10:15:00Z."
        ) from error


def _read_joints(fields: Fields) -> dict[str, FloatArray] | None:
    if not fields.has("joints_m"):
        return None
    joints = fields.object("joints_m")
    if len(joints.names()) > _MAX_JOINTS:
        raise fields.error("joints_m", f"holds more than {_MAX_JOINTS} joints.")
    out: dict[str, FloatArray] = {}
    for name in joints.names():
        point = np.array(joints.numbers(name, 3))
        if float(np.abs(point).max()) > _MAX_JOINT_M:
            raise joints.error(
                name,
                f"lies {np.linalg.norm(point):.0f} m from the camera.",
                "Joints are in metres, not millimetres.",
            )
        out[name] = point
    return out


def _inside(folder: Path, fields: Fields, field: str, name: str) -> Path:
    """The path of a file named in the description; a name cannot lead out of the folder (a link may)."""
    windows, posix = PureWindowsPath(name), PurePosixPath(name)
    parts = set(windows.parts) | set(posix.parts)
    bad = (
        not name.strip()
        or "\0" in name
        or windows.drive
        or windows.root
        or posix.is_absolute()
        or ".." in parts
    )
    if bad or len(name) > 255 or not name.isprintable():
        raise fields.error(field, f"is not the name of a file inside the folder: {name[:60]!r}.")
    return folder / name


def _files(capture: RgbdCapture) -> dict[str, bytes]:
    files = {f"depth_{i:03d}.png": png_bytes(frame) for i, frame in enumerate(capture.depth_frames)}
    rig = capture.rig
    description: dict[str, object] = {
        "format": CAPTURE_FORMAT,
        "view": capture.view,
        "taken_at": capture.taken_at.astimezone(UTC).isoformat().replace("+00:00", "Z"),
        "stance": capture.stance,
        "depth": {
            "frames": list(files),
            "unit_m": capture.depth_unit_m,
            "intrinsics": rig.depth.document(),
        },
        "mirrored": capture.mirrored,
    }
    if capture.color is not None and rig.color is not None and rig.color_from_depth is not None:
        description["color"] = {"file": "color.png", "intrinsics": rig.color.document()}
        description["color_from_depth"] = rig.color_from_depth.matrix.tolist()
        files["color.png"] = png_bytes(capture.color)
    if capture.joints_m is not None:
        description["joints_m"] = {name: np.asarray(p).tolist() for name, p in capture.joints_m.items()}
    if capture.sensor:
        description["sensor"] = capture.sensor
    if capture.calibration is not None:
        description["calibration"] = capture.calibration
    files[CAPTURE_FILE] = json.dumps(description, indent=1, ensure_ascii=False).encode("utf-8")
    return files


def _write_synced(path: Path, data: bytes) -> None:
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _swap(staging: Path, folder: Path) -> None:
    """Put the complete folder in place; the one it replaces is removed afterwards."""
    if not folder.exists():
        staging.rename(folder)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{folder.name}-old-", dir=folder.parent)) / "capture"
    folder.rename(old)
    try:
        staging.rename(folder)
    except OSError:
        with contextlib.suppress(OSError):
            old.rename(folder)
        raise
    finally:
        if folder.exists():
            shutil.rmtree(old.parent, ignore_errors=True)
