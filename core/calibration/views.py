"""Views of the board as a rig sees it, and which of them are worth keeping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec, BoardView
from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform

FloatArray = NDArray[np.float64]

MAX_MOTION_SHARE = 0.0012
"""Of the picture's width (0.8 px at 640) between two successive frames: more is a moving board."""

_BLUR_LIMIT_PX = 3.6
_BLUR_LIMIT_SHARE = 0.0018
_SAME_PLACE_SHARE = 0.045
_SAME_DIRECTION_DEG = 9.0
_SAME_SIZE = 1.12


@dataclass(frozen=True, eq=False)
class RigView:
    """One pose of the board as the cameras of a rig saw it; at least one of them did.

    Attributes
    ----------
    infrared : BoardView or None
        In the depth camera's own (infrared) picture.
    color : BoardView or None
    depth : ndarray (h, w) uint16 or None
        Raw depth of the same pose.
    depth_unit_m : float
    """

    infrared: BoardView | None
    color: BoardView | None
    depth: NDArray[np.uint16] | None = None
    depth_unit_m: float = 0.001


def guess_camera(size: tuple[int, int]) -> PinholeCamera:
    """Camera for a first idea of pose and tilt, before anything is calibrated."""
    width, height = size
    focal = 0.87 * max(width, height * 4 / 3)
    return PinholeCamera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def board_pose(view: BoardView, spec: BoardSpec, camera: PinholeCamera) -> RigidTransform | None:
    """Camera frame from board frame; None if the corners do not determine it."""
    corners = spec.corners_m[view.ids]
    rays = np.ascontiguousarray(camera.rays(view.pixels)[:, :2])
    found, turn, shift = cv2.solvePnP(
        corners, rays.reshape(-1, 1, 2), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    if not found:
        return None
    turn, shift = cv2.solvePnPRefineLM(corners, rays.reshape(-1, 1, 2), np.eye(3), None, turn, shift)
    rotation = np.asarray(cv2.Rodrigues(turn)[0], float)
    if not (np.isfinite(rotation).all() and float(shift[2, 0]) > 0):
        return None
    return RigidTransform(rotation, np.asarray(shift, float).ravel())


def tilt_deg(pose: RigidTransform) -> tuple[float, float]:
    """Tilt of the board about the picture's upright and level axis, signed, in degrees."""
    normal = pose.rotation[:, 2]
    return (
        float(np.rad2deg(np.arctan2(normal[0], normal[2]))),
        float(np.rad2deg(np.arctan2(normal[1], normal[2]))),
    )


def motion_px(now: BoardView, before: BoardView | None) -> float:
    """How far the board moved between two pictures, in pixels; inf if that cannot be told."""
    return float("inf") if before is None else now.shift_px(before)


def is_moving(now: BoardView, before: BoardView | None) -> bool:
    """Whether the board moved too much between two pictures of one camera to be measured."""
    return motion_px(now, before) > max(MAX_MOTION_SHARE * now.size[0], 0.5)


def is_blurred(view: BoardView) -> bool:
    """Whether the picture of the board is not sharp enough to be measured."""
    return view.rise_px > max(_BLUR_LIMIT_PX, _BLUR_LIMIT_SHARE * view.size[0] + 1.5)


def is_like(view: BoardView, other: BoardView, spec: BoardSpec) -> bool:
    """Whether two views show the board at about the same place, distance and tilt."""
    camera = guess_camera(view.size)
    a, b = board_pose(view, spec, camera), board_pose(other, spec, camera)
    if a is None or b is None:
        return False
    centre = camera.project(np.stack([a.apply(spec.centre_m), b.apply(spec.centre_m)]))
    if np.hypot(*(centre[0] - centre[1])) > _SAME_PLACE_SHARE * view.size[0]:
        return False
    angle = np.rad2deg(np.arccos(np.clip(a.rotation[:, 2] @ b.rotation[:, 2], -1, 1)))
    ratio = a.translation[2] / b.translation[2]
    return bool(angle < _SAME_DIRECTION_DEG and 1 / _SAME_SIZE < ratio < _SAME_SIZE)


def view_of(
    infrared: BoardView | None, color: BoardView | None, depth: NDArray[Any] | None, depth_unit_m: float
) -> RigView:
    """A view with its own copy of the depth frame."""
    kept = None if depth is None else np.ascontiguousarray(depth, dtype=np.uint16).copy()
    return RigView(infrared, color, kept, depth_unit_m)
