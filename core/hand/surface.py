"""The surface of a hand held before the camera: cut from a depth image around a place on it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError
from core.surface.body_surface import BodySurface
from core.surface.denoise import denoise_depth

FloatArray = NDArray[np.float64]

REACH_M = 0.26
"""How far from the marker a hand can reach: wrist to fingertip of a large hand."""

JUMP_M = 0.012
"""Neighbouring pixels of one skin differ by less (fingers before the palm differ by more)."""

_SMOOTH_PX = 1.5
_GATE_M = 0.010
_MARGIN_PX = 8


@dataclass(frozen=True, eq=False)
class HandSurface:
    """The skin of hand and forearm within reach of the marker, in the depth camera's frame.

    Attributes
    ----------
    surface : BodySurface
        Its camera is the depth camera cropped by `corner_px` and thinned by `step_px`.
    corner_px : tuple of int
        Upper left pixel (u, v) of the crop in the depth image.
    step_px : int
        Every so many pixels became a vertex.
    """

    surface: BodySurface
    corner_px: tuple[int, int]
    step_px: int


def cut_hand(
    depth_m: FloatArray, camera: PinholeCamera, seed_m: FloatArray, *, step_px: int = 1
) -> HandSurface:
    """Skin connected to a place on the hand.

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    camera : PinholeCamera
    seed_m : ndarray (k, 3)
        Places on the back of the hand, for example the marker's corners; depth frame.

    Raises
    ------
    WorkError
        If there is no surface at these places.
    """
    centre = seed_m.mean(axis=0)
    u0, v0, u1, v1 = _window(camera, centre)
    crop = np.ascontiguousarray(depth_m[v0:v1, u0:u1])
    cropped = replace(camera, width=u1 - u0, height=v1 - v0, cx=camera.cx - u0, cy=camera.cy - v0)
    part = _connected(crop, cropped, seed_m)
    smooth = denoise_depth(np.where(part, crop, 0.0), sigma_px=_SMOOTH_PX, gate_m=_GATE_M)
    points = cropped.backproject(smooth)
    smooth[((points - centre) ** 2).sum(axis=2) > REACH_M**2] = 0.0
    if step_px > 1:
        smooth = np.ascontiguousarray(smooth[::step_px, ::step_px])
        cropped = PinholeCamera(
            smooth.shape[1],
            smooth.shape[0],
            cropped.fx / step_px,
            cropped.fy / step_px,
            cropped.cx / step_px,
            cropped.cy / step_px,
            cropped.distortion,
        )
    surface = BodySurface.from_depth(smooth, cropped, jump_m=JUMP_M * step_px, smallest_part=200)
    return HandSurface(surface, (u0, v0), step_px)


def _window(camera: PinholeCamera, centre: FloatArray) -> tuple[int, int, int, int]:
    middle = camera.project(centre)[0]
    if not np.isfinite(middle).all():
        raise WorkError("The hand is behind the camera.")
    reach = REACH_M / max(float(centre[2]) - 0.1, 0.15) * np.array([camera.fx, camera.fy]) + _MARGIN_PX
    low = np.clip(np.floor(middle - reach), 0, (camera.width - 1, camera.height - 1)).astype(int)
    high = np.clip(np.ceil(middle + reach), low + 1, (camera.width, camera.height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _connected(depth: FloatArray, camera: PinholeCamera, seed_m: FloatArray) -> NDArray[np.bool_]:
    """Pixels of the part that most of the seeds lie on."""
    from core.surface.depth_kernels import label_components

    jump = np.full(depth.shape, JUMP_M)
    labels, _ = label_components(depth, jump)
    pixels = np.rint(camera.project(seed_m)).astype(np.int64)
    found = []
    for (u, v), place in zip(pixels, seed_m, strict=True):
        near = (slice(max(v - 2, 0), v + 3), slice(max(u - 2, 0), u + 3))
        close = (labels[near] >= 0) & (np.abs(depth[near] - place[2]) < 2 * JUMP_M) & (depth[near] > 0)
        found += list(labels[near][close])
    if not found:
        raise WorkError(
            "There is no measured skin at the marker.", "Hold the hand 0.5 to 1 m from the camera."
        )
    values, counts = np.unique(found, return_counts=True)
    return np.asarray(labels == values[np.argmax(counts)])
