"""Views of a board before a true rig, without pictures: corners projected with noise, depth of its plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.calibration.board import BoardSpec, BoardView
from core.calibration.views import RigView, view_of
from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.simulator.boards import BoardRig, good_poses, random_board_rig

SPEC = BoardSpec.for_paper("A3")


def seen_corners(
    camera: PinholeCamera,
    pose: RigidTransform,
    rng: np.random.Generator,
    noise_px: float,
    spec: BoardSpec = SPEC,
) -> BoardView:
    """Corners in the picture, each with its own noise."""
    pixels = camera.project(pose.apply(spec.corners_m))
    inside = camera.contains(pixels, 3.0)
    ids = np.flatnonzero(inside)
    noisy = pixels[inside] + rng.normal(0, noise_px, (len(ids), 2))
    return BoardView(ids, noisy, (camera.width, camera.height), 2.0)


def depth_of(board_rig: BoardRig, pose: RigidTransform, rng: np.random.Generator) -> np.ndarray:
    """Raw depth in millimetres: the board's plane in steps of the disparity, as a Kinect tells it."""
    camera, error = board_rig.rig.depth, board_rig.depth_error
    rays = camera.pixel_rays
    normal = pose.rotation[:, 2]
    true = normal @ pose.translation / (rays @ normal)
    told = (np.clip(true, 0.3, 6.0) - error.offset_m) / error.scale
    told = told + rng.normal(0, 0.002, told.shape) * told**2
    step = 0.125 / (575.8 * 0.075)
    told = 1 / (np.rint(1 / told / step) * step)
    return np.rint(1000 * told).astype(np.uint16)


def views_of(
    board_rig: BoardRig,
    poses: Sequence[RigidTransform],
    seed: int = 0,
    noise_px: float = 0.05,
    depth: bool = True,
) -> list[RigView]:
    """A view of every pose, by both cameras."""
    rng = np.random.default_rng(seed)
    rig = board_rig.rig
    return [
        view_of(
            seen_corners(rig.depth, pose, rng, noise_px),
            seen_corners(rig.picture_camera, rig.picture_from_depth @ pose, rng, noise_px),
            depth_of(board_rig, pose, rng) if depth else None,
            0.001,
        )
        for pose in poses
    ]


def usual_views(seed: int = 0, count: int = 25, **how: object) -> tuple[BoardRig, list[RigView]]:
    """A rig and well spread views of it."""
    board_rig = random_board_rig(seed)
    return board_rig, views_of(board_rig, good_poses(board_rig, SPEC, count, seed), seed, **how)  # type: ignore[arg-type]
