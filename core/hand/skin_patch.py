"""A small smooth piece of skin under a marker, fitted to the depth pixels there, and rays met with it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]

_NEAREST_M, _FARTHEST_M = 0.15, 4.0
_TRIALS = 240
_GATE_M = 0.04
_LEAST_PIXELS = 40
_LEAST_SHARE = 0.4
_LEAST_SPREAD_M = 0.001
_MARGIN = 1.25


@dataclass(frozen=True, eq=False)
class SkinPatch:
    """Inverse depth over the depth image as a quadric around a middle.

    Attributes
    ----------
    middle_px : ndarray (2,)
    size_px : float
        Unit of the quadric's coordinates.
    terms : ndarray (6,)
        Of 1, x, y, x^2, x y, y^2; inverse metres. In space a plane is linear in inverse depth.
    spread_m : float
        Robust standard deviation of the pixels about it.
    """

    middle_px: FloatArray
    size_px: float
    terms: FloatArray
    spread_m: float

    def depth_m(self, pixels: FloatArray) -> FloatArray:
        """Depth (n,) at depth pixels (n, 2)."""
        return np.asarray(1.0 / (_base((pixels - self.middle_px) / self.size_px) @ self.terms))


def _base(xy: FloatArray) -> FloatArray:
    x, y = xy[:, 0], xy[:, 1]
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)


def depth_along(
    depth_m: FloatArray, camera: PinholeCamera, origin: FloatArray, ray: FloatArray
) -> float | None:
    """How far along a ray (depth frame) the nearest measured surface is; None if it meets none."""
    ways = 1.0 / np.linspace(1.0 / _NEAREST_M, 1.0 / _FARTHEST_M, _TRIALS)
    places = origin + ways[:, None] * ray
    pixels = np.rint(camera.project(places))
    inside = camera.contains(pixels)
    u, v = (np.where(inside, pixels[:, k], 0).astype(np.int64) for k in (0, 1))
    measured = np.where(inside, depth_m[v, u], 0.0)
    behind = (measured > 0) & (places[:, 2] >= measured)
    before = (measured > 0) & (places[:, 2] < measured)
    crossed = np.flatnonzero(behind[1:] & before[:-1])
    if len(crossed) == 0:
        return None
    first = crossed[0]
    a, b = measured[first] - places[first, 2], places[first + 1, 2] - measured[first + 1]
    return float(ways[first] + (ways[first + 1] - ways[first]) * a / max(a + b, 1e-9))


def fit_patch(
    depth_m: FloatArray, camera: PinholeCamera, outline_px: FloatArray, near_m: float
) -> SkinPatch | None:
    """Skin within an outline (k, 2) of depth pixels about ``near_m`` away; None if there is little."""
    from core.hand.marker_kernels import fit_quadric

    low = np.clip(np.floor(outline_px.min(axis=0)).astype(int), 0, (camera.width - 1, camera.height - 1))
    high = np.clip(np.ceil(outline_px.max(axis=0)).astype(int) + 1, low + 1, (camera.width, camera.height))
    mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(outline_px - low).astype(np.int32), 1)
    middle = outline_px.mean(axis=0)
    size = 0.5 * float(np.linalg.norm(outline_px.max(axis=0) - outline_px.min(axis=0)))
    terms, spread, count = fit_quadric(
        depth_m, mask, low[0], low[1], middle[0], middle[1], size, near_m, _GATE_M, _LEAST_SPREAD_M
    )
    if count < max(_LEAST_PIXELS, _LEAST_SHARE * int(mask.sum())):
        return None
    return SkinPatch(middle, size, terms, spread)


def meet_patch(
    patch: SkinPatch, camera: PinholeCamera, origin: FloatArray, rays: FloatArray, start: float
) -> FloatArray:
    """Places (n, 3) where rays (n, 3) from ``origin`` meet a patch, beginning ``start`` along them.

    Fixed point: cameras stand close beside each other, so that moving along the ray hardly moves the pixel.
    """
    way = np.full(len(rays), start)
    for _ in range(4):
        place = origin + way[:, None] * rays
        way += (patch.depth_m(camera.project(place)) - place[:, 2]) / np.maximum(rays[:, 2], 0.1)
    return np.asarray(origin + way[:, None] * rays)


def lift_corners(depth_m: FloatArray, rig: CameraRig, corners_px: FloatArray) -> FloatArray | None:
    """Corners (4, 2) seen in the picture on the skin, (4, 3) in the depth camera's frame.

    The pixels of depth that the marker covers, with a margin, tell a quadric; a single pixel's noise would
    move a corner by millimetres.

    Returns
    -------
    ndarray or None
        None if the skin is not measured there.
    """
    origin, rays = rig.picture_rays(np.vstack([corners_px, corners_px.mean(axis=0)]))
    start = depth_along(depth_m, rig.depth, origin, rays[4])
    if start is None:
        start = _from_corners(depth_m, rig, origin, rays[:4])
    if start is None:
        return None
    places = origin + start * rays[:4]
    middle = places.mean(axis=0)
    outline = rig.depth.project(middle + _MARGIN * (places - middle))
    patch = fit_patch(depth_m, rig.depth, outline, float(middle[2]))
    if patch is None:
        return None
    places = meet_patch(patch, rig.depth, origin, rays[:4], start)
    return places if np.isfinite(places).all() else None


def _from_corners(depth_m: FloatArray, rig: CameraRig, origin: FloatArray, rays: FloatArray) -> float | None:
    """Depth along the corners' rays where the middle's meets a hole in the depth image."""
    found = [depth_along(depth_m, rig.depth, origin, ray) for ray in rays]
    known = [way for way in found if way is not None]
    return float(np.median(known)) if len(known) >= 2 else None
