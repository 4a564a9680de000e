"""Running the command in process, and making capture folders that are wrong in one way."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.cli.main import main
from core.capture import CameraRig, read_capture
from devices.simulator import SimulatedRig, make_rig

Json = dict[str, Any]
Change = Callable[[Json], object]

DEPTH_SIZE = (256, 192)
COLOR_SIZE = (320, 240)


@dataclass(frozen=True)
class Outcome:
    """What a call of the command left behind."""

    code: int
    out: str
    err: str


def geoderm(*arguments: object) -> Outcome:
    """Run ``geoderm`` in this process. A warning of a library counts as noise on standard error."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("always", RuntimeWarning)
        code = main([str(a) for a in arguments])
    return Outcome(code, out.getvalue(), err.getvalue())


def assert_told(outcome: Outcome, code: int, *words: object) -> None:
    """The command failed with ``code`` and one clear line that holds ``words``, and nothing else."""
    assert outcome.code == code, outcome
    assert outcome.out == ""
    assert outcome.err.count("\n") == 1, outcome.err
    assert outcome.err.startswith("geoderm")
    assert len(outcome.err) < 1000
    for word in (*_FORBIDDEN,):
        assert word not in outcome.err
    for word in words:
        assert str(word) in outcome.err, outcome.err


_FORBIDDEN = ("Traceback", "internal error", "Error:", "Exception", "<class", "NoneType", "dtype", "numpy")


def small_rig() -> SimulatedRig:
    """A Kinect that sees the same with fewer pixels: small, and as precise as the real one."""
    rig = make_rig(COLOR_SIZE)
    sensor = rig.sensor.scaled(DEPTH_SIZE[0] / rig.sensor.depth_camera.width)
    cameras = CameraRig(sensor.depth_camera, rig.rig.color, rig.rig.color_from_depth)
    return SimulatedRig(sensor, cameras, rig.device_seed)


def copy_of(folder: Path, target: Path) -> Path:
    """A copy that may be damaged."""
    return Path(shutil.copytree(folder, target))


def description(folder: Path) -> Json:
    """capture.json as it is."""
    loaded: Json = json.loads((folder / "capture.json").read_text(encoding="utf-8"))
    return loaded


def edit(folder: Path, change: Change) -> Path:
    """Change capture.json of a folder."""
    content = description(folder)
    change(content)
    (folder / "capture.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


def put(content: Json, path: Sequence[str | int], value: object) -> None:
    """Set the value at a path of keys."""
    at: Any = content
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value


def drop(content: Json, path: Sequence[str | int]) -> None:
    """Remove the value at a path of keys."""
    at: Any = content
    for key in path[:-1]:
        at = at[key]
    del at[path[-1]]


def depth_images(folder: Path) -> dict[Path, NDArray[np.uint16]]:
    """Depth frames of a folder by file."""
    return {p: np.asarray(Image.open(p)).astype(np.uint16) for p in sorted(folder.glob("depth_*.png"))}


def map_depth(folder: Path, change: Callable[[NDArray[np.uint16]], NDArray[Any]]) -> Path:
    """Change every depth frame of a folder."""
    for path, image in depth_images(folder).items():
        Image.fromarray(np.ascontiguousarray(change(image)).astype(np.uint16)).save(path)
    return folder


def without_joints(folder: Path) -> Path:
    """Take the recorded joints away."""
    return edit(folder, lambda d: d.pop("joints_m"))


def without_color(folder: Path) -> Path:
    """Make a depth-only recording of a folder."""
    (folder / "color.png").unlink()
    return edit(folder, lambda d: (d.pop("color"), d.pop("color_from_depth")))


def mirrored(folder: Path) -> Path:
    """Store a folder as a camera that mirrors would have, and say so."""
    for path in folder.glob("*.png"):
        flipped = np.ascontiguousarray(np.asarray(Image.open(path))[:, ::-1])
        Image.fromarray(flipped).save(path)

    def flip(d: Json) -> None:
        d["mirrored"] = True
        for camera in (d["depth"]["intrinsics"], d["color"]["intrinsics"]):
            camera["cx"] = camera["width"] - 1 - camera["cx"]
        mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
        d["color_from_depth"] = (mirror @ np.array(d["color_from_depth"]) @ mirror).tolist()
        for joint in d.get("joints_m", {}).values():
            joint[0] = -joint[0]

    return edit(folder, flip)


def empty_room(folder: Path) -> Path:
    """Take the person out: a wall at 3 m alone."""
    return map_depth(folder, lambda image: np.full_like(image, 3000))


def cropped(folder: Path, rows: int) -> Path:
    """Keep the upper rows of the depth image: the body is cut by the frame."""
    map_depth(folder, lambda image: image[:rows])
    return edit(folder, lambda d: put(d, ("depth", "intrinsics", "height"), rows))


def write_lesions(path: Path, lesions: object) -> Path:
    """lesions.json with these entries."""
    path.write_text(json.dumps({"lesions": lesions}), encoding="utf-8")
    return path


def depth_pixels_of(folder: Path, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth pixels (k, 2) of the body points nearest to the rays through colour pixels (k, 2)."""
    capture = read_capture(folder)
    depth = capture.depth_frames[0] * capture.depth_unit_m
    v, u = np.nonzero(depth > 0)
    seen = capture.rig.project_to_picture(capture.rig.depth.backproject(depth)[v, u])
    nearest = [int(np.nanargmin(np.linalg.norm(seen - pixel, axis=1))) for pixel in pixels]
    return np.stack([u[nearest], v[nearest]], axis=1).astype(float)
