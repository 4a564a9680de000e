"""A capture as a JSON document and picture files, and back again, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.records.failures import DamagedError

FORMAT = "geoderm-capture/1"
_THREADS = 2
_FAST_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]


@dataclass(frozen=True)
class EncodedCapture:
    """A capture ready to be stored."""

    document: dict[str, Any]
    depth_files: tuple[bytes, ...]
    color_file: bytes | None


def _camera(document: dict[str, Any]) -> PinholeCamera:
    values = {key: document[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}
    return PinholeCamera(**values, distortion=tuple(document["distortion"]))


def _png(image: NDArray[Any]) -> bytes:
    done, data = cv2.imencode(".png", image, _FAST_PNG)
    if not done:
        raise RuntimeError("the PNG encoder refused an image")
    return data.tobytes()


def encode_capture(capture: RgbdCapture) -> EncodedCapture:
    """PNG files and the ``capture.json`` document (FORMATS) of a capture."""
    names = [f"depth_{i:03d}.png" for i in range(len(capture.depth_frames))]
    document: dict[str, Any] = {
        "format": FORMAT,
        "view": capture.view,
        "stance": capture.stance,
        "taken_at": capture.taken_at.isoformat(),
        "mirrored": bool(capture.mirrored),
        "depth": {
            "frames": names,
            "unit_m": float(capture.depth_unit_m),
            "intrinsics": capture.rig.depth.document(),
        },
    }
    if capture.rig.color is not None and capture.rig.color_from_depth is not None:
        document["color"] = {"file": "color.png", "intrinsics": capture.rig.color.document()}
        document["color_from_depth"] = capture.rig.color_from_depth.matrix.tolist()
    if capture.joints_m is not None:
        document["joints_m"] = {
            name: np.asarray(joint, dtype=float).tolist() for name, joint in capture.joints_m.items()
        }
    if capture.sensor:
        document["sensor"] = capture.sensor
    if capture.calibration is not None:
        document["calibration"] = capture.calibration
    with ThreadPoolExecutor(_THREADS) as pool:
        color = None
        if capture.color is not None:
            color = pool.submit(lambda rgb: _png(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)), capture.color)
        depth = tuple(pool.map(_png, capture.depth_frames))
        return EncodedCapture(document, depth, None if color is None else color.result())


def decode_color(data: bytes) -> NDArray[np.uint8]:
    """RGB pixels (h, w, 3) of a stored colour file."""
    return np.asarray(cv2.cvtColor(_decoded(data), cv2.COLOR_BGR2RGB), dtype=np.uint8)


def decode_depth(data: bytes) -> NDArray[np.uint16]:
    """Raw depth (h, w) of a stored depth file."""
    return np.asarray(_decoded(data), dtype=np.uint16)


def _decoded(data: bytes) -> NDArray[Any]:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise DamagedError("A stored picture is damaged.", "Restore the clinic folder from a backup.")
    return np.asarray(image)


def decode_capture(
    document: dict[str, Any], depth_files: Sequence[bytes], color_file: bytes | None
) -> RgbdCapture:
    """The capture again, equal to the one that was encoded in every bit."""
    color_camera, color_from_depth = None, None
    if "color" in document:
        color_camera = _camera(document["color"]["intrinsics"])
        matrix = np.array(document["color_from_depth"], dtype=float)
        color_from_depth = RigidTransform(matrix[:3, :3].copy(), matrix[:3, 3].copy())
    joints = document.get("joints_m")
    with ThreadPoolExecutor(_THREADS) as pool:
        color = None if color_file is None else pool.submit(decode_color, color_file)
        frames = np.stack(list(pool.map(decode_depth, depth_files)))
        return RgbdCapture(
            depth_frames=frames,
            depth_unit_m=document["depth"]["unit_m"],
            rig=CameraRig(_camera(document["depth"]["intrinsics"]), color_camera, color_from_depth),
            color=None if color is None else color.result(),
            view=document["view"],
            stance=document["stance"],
            taken_at=datetime.fromisoformat(document["taken_at"]),
            mirrored=document["mirrored"],
            joints_m=None if joints is None else {name: np.array(xyz) for name, xyz in joints.items()},
            sensor=document.get("sensor", ""),
            calibration=document.get("calibration"),
        )
