"""Compile or load every kernel of relocation before the first follow-up."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture, Joint, Skeleton
from core.anchors.analyse import with_skeleton
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.relocation.relocate import relocate
from core.relocation.types import LesionQuery
from core.surface import scan_body

FloatArray = NDArray[np.float64]

_DEPTH_M = 1.5
_JOINTS = {
    "head": (0.0, -0.33),
    "neck": (0.0, -0.24),
    "torso": (0.0, -0.05),
    "left_shoulder": (0.10, -0.22),
    "right_shoulder": (-0.10, -0.22),
    "left_elbow": (0.20, -0.12),
    "right_elbow": (-0.20, -0.12),
    "left_hand": (0.24, 0.04),
    "right_hand": (-0.24, 0.04),
    "left_hip": (0.07, 0.16),
    "right_hip": (-0.07, 0.16),
    "left_knee": (0.08, 0.28),
    "right_knee": (-0.08, 0.28),
    "left_foot": (0.08, 0.38),
    "right_foot": (-0.08, 0.38),
}
"""x and y of the joints of the made-up body, metres."""


def warm_up() -> None:
    """Relocate moles of a small made-up body by the method that runs all compiled code.

    Real captures have the same types, so nothing is left to compile for the first click. Takes a minute on a
    fresh installation and a second later on; for a background thread.
    """
    first, followup = made_up_visit(0.0), made_up_visit(0.004)
    lesions = [LesionQuery(f"{u:.0f}", pixel=(float(u), float(v))) for u, v in first.spots.pixels[:3]]
    relocate(first, followup, lesions, method="fused")


def _moles() -> FloatArray:
    """Picture pixels (n, 2) of the moles."""
    u, v = np.meshgrid(np.arange(-4, 5), np.arange(-6, 7))
    wave = np.stack([np.sin(3.0 * v + u), np.cos(2.0 * u + v)], axis=-1)
    places = np.stack([320 + 21 * u, 240 + 24 * v], axis=-1) + 6.0 * wave
    return np.asarray(places.reshape(-1, 2))


def made_up_visit(shift_m: float) -> AnalysedCapture:
    """A body like a gingerbread man, shifted a little to the right."""
    depth_camera = PinholeCamera(160, 120, 140.0, 140.0, 79.5, 59.5)
    color_camera = PinholeCamera(640, 480, 560.0, 560.0, 319.5, 239.5)
    shift_px = shift_m * depth_camera.fx / _DEPTH_M
    outline = np.zeros((120, 160), np.uint8)
    for one, two, thick in (
        ("head", "torso", 18),
        ("torso", "left_hip", 18),
        ("torso", "right_hip", 18),
        ("left_shoulder", "left_elbow", 8),
        ("left_elbow", "left_hand", 8),
        ("right_shoulder", "right_elbow", 8),
        ("right_elbow", "right_hand", 8),
        ("left_hip", "left_foot", 9),
        ("right_hip", "right_foot", 9),
    ):
        ends = [
            (round(79.5 + shift_px + 140.0 * x / _DEPTH_M), round(59.5 + 140.0 * y / _DEPTH_M))
            for x, y in (_JOINTS[one], _JOINTS[two])
        ]
        cv2.line(outline, ends[0], ends[1], 1, thick)
    inside = np.minimum(cv2.distanceTransform(outline, cv2.DIST_L2, 5), 9.0)
    depth = np.where(outline > 0, 1000.0 * _DEPTH_M - 12.0 * inside, 0.0)
    frames = np.stack([depth, depth + (depth > 0)]).astype(np.uint16)
    color = np.full((480, 640, 3), (200, 150, 130), np.uint8)
    for u, v in _moles():
        at = round(16 * (u + shift_m * color_camera.fx / _DEPTH_M)), round(16 * v)
        cv2.circle(color, at, 3 * 16, (90, 60, 45), -1, cv2.LINE_AA, 4)
    rig = CameraRig(depth_camera, color_camera, RigidTransform())
    capture = RgbdCapture(frames, 0.001, rig, color)
    joints = {}
    for name, (x, y) in _JOINTS.items():
        point = np.array([x + shift_m, y, _DEPTH_M + 0.05])
        joints[name] = Joint(name, point, rig.project_to_picture(point)[0], 1.0, "recording")
    return with_skeleton(scan_body(capture), Skeleton(joints, source="recording"))
