"""Depth of the board's plane from a raw depth frame, averaged to well under the sensor's own noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform

FloatArray = NDArray[np.float64]

_EDGE_PX = 6
_MIN_PIXELS = 300
_MIN_FILLED = 0.6
_ENOUGH_PIXELS = 6000
_OTHER_THING_M = 0.12


@dataclass(frozen=True)
class PlaneDepth:
    """What the depth camera says of the board, in one number.

    Attributes
    ----------
    pixel : tuple of float
        Where: the middle of the board's area in the depth picture.
    depth_m : float
        Measured depth there, of the plane fitted to all readings of the area.
    scatter_m : float
        Standard deviation of single readings about the plane.
    readings : int
    """

    pixel: tuple[float, float]
    depth_m: float
    scatter_m: float
    readings: int


def plane_depth(
    depth: NDArray[np.uint16],
    unit_m: float,
    camera: PinholeCamera,
    depth_from_board: RigidTransform,
    spec: BoardSpec,
) -> PlaneDepth | None:
    """Measured depth of the board at a pose.

    A plane is fitted to the inverse of the readings, which is linear over the rays and in which steps of
    disparity are even, so that averaging removes them. The rim of the board is left out: depth cameras blur
    sideways and mix board and wall there.

    Returns
    -------
    PlaneDepth or None
        None if too little of the board is measured, as with the emitter covered.
    """
    outline = camera.project(depth_from_board.apply(spec.outline_m))
    if not np.isfinite(outline).all():
        return None
    mask = np.zeros(depth.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.rint(np.clip(outline, -20000, 20000)).astype(np.int32), 1)
    mask = cv2.erode(mask, np.ones((2 * _EDGE_PX + 1,) * 2, np.uint8), borderValue=0)
    v, u = np.nonzero(mask)
    if len(u) < _MIN_PIXELS:
        return None
    step = max(1, len(u) // _ENOUGH_PIXELS)
    u, v = u[::step], v[::step]
    rays = camera.rays(np.stack([u, v], axis=1).astype(float))
    normal = depth_from_board.rotation[:, 2]
    expected = float(normal @ depth_from_board.translation) / (rays @ normal)
    measured = depth[v, u].astype(float) * unit_m
    near = (measured > 0) & (np.abs(measured - expected) < _OTHER_THING_M + 0.05 * expected)
    if near.sum() * step < _MIN_PIXELS or near.mean() < _MIN_FILLED:
        return None
    rays, inverse = rays[near], 1.0 / measured[near]
    middle = np.array([u[near].mean(), v[near].mean()])
    keep = np.ones(len(rays), bool)
    plane: FloatArray = np.zeros(3)
    spread = 0.0
    for _ in range(4):
        plane = np.asarray(np.linalg.solve(rays[keep].T @ rays[keep], rays[keep].T @ inverse[keep]), float)
        off = inverse - rays @ plane
        spread = 1.4826 * float(np.median(np.abs(off[keep]))) + 1e-6
        # Steps of the reading can be wider than the noise: never cut inside three of them.
        keep = np.abs(off) < max(4.0 * spread, 3.0 * float(off[keep].std()))
    at = float(camera.rays(middle[None])[0] @ plane)
    if at <= 0:
        return None
    z = 1.0 / at
    return PlaneDepth(
        (float(middle[0]), float(middle[1])),
        z,
        float((inverse - rays @ plane)[keep].std() * z * z),
        int(keep.sum()),
    )
