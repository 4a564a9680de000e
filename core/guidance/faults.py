"""The picture of what is missing: faults of a capture, drawn where they are in the photo."""

from __future__ import annotations

from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from core.anchors import BONES, Skeleton
from core.capture.rgbd import RgbdCapture
from core.guidance.framing import cut_sides
from core.guidance.person import missing_within

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

Fault = Literal["no depth", "blurred", "over-exposed", "outside"]

FAULTS: Final[tuple[Fault, ...]] = ("no depth", "blurred", "over-exposed", "outside")
"""Fault of label k + 1 of a fault picture; 0 is no fault."""

FAULT_WIDTH: Final = 640
"""Fault pictures are at most this wide."""

_EDGE_M: Final = 0.05
_LIMB_M: Final = 0.045
_TRUNK_M: Final = 0.09
_BONE_SAMPLES: Final = 16


def label_of(fault: Fault) -> int:
    """Its value in a fault picture."""
    return FAULTS.index(fault) + 1


def fault_size(capture: RgbdCapture) -> tuple[int, int]:
    """Height and width of the fault picture of a capture: the photo's shape, small."""
    camera = capture.rig.picture_camera
    share = min(1.0, FAULT_WIDTH / camera.width)
    return round(camera.height * share), round(camera.width * share)


def unmeasured(
    mask: BoolArray, depth_m: FloatArray, pixels_per_m: float, capture: RgbdCapture, skeleton: Skeleton | None
) -> BoolArray:
    """Depth pixels (h, w) of the body without depth: holes, gaps, and limbs seen but not measured."""
    missing = missing_within(mask, depth_m, pixels_per_m)
    if skeleton is None:
        return missing
    limbs = np.zeros(mask.shape, np.uint8)
    for a, b in BONES:
        if not skeleton.sees(a, b):
            continue
        ends = capture.rig.depth.project(np.stack([skeleton.point(a), skeleton.point(b)]))
        if not np.isfinite(ends).all():
            continue
        wide = _TRUNK_M if "torso" in (a, b) or b.endswith("knee") else _LIMB_M
        radius = max(2, round(wide * pixels_per_m))
        for share in np.linspace(0.0, 1.0, _BONE_SAMPLES):
            u, v = (round(float(c)) for c in ends[0] + share * (ends[1] - ends[0]))
            if 0 <= v < mask.shape[0] and 0 <= u < mask.shape[1] and not mask[v, u] and depth_m[v, u] <= 0:
                cv2.circle(limbs, (u, v), radius, 1, cv2.FILLED)
    return np.asarray(missing | ((limbs > 0) & ~mask & (depth_m <= 0)))


def cut_off(mask: BoolArray, depth_m: FloatArray, pixels_per_m: float) -> tuple[list[str], BoolArray]:
    """Edges at which the body leaves the depth image, and the strips (h, w) where it does."""
    measured = depth_m > 0
    sides = cut_sides(mask, measured, pixels_per_m)
    strip = np.zeros(mask.shape, np.bool_)
    wide = max(3, round(_EDGE_M * pixels_per_m))
    rows, columns = np.flatnonzero(measured.any(axis=1)), np.flatnonzero(measured.any(axis=0))
    for side in sides:
        if side == "top":
            strip[rows[0] : rows[0] + wide] = True
        elif side == "bottom":
            strip[rows[-1] - wide + 1 : rows[-1] + 1] = True
        elif side == "left":
            strip[:, columns[0] : columns[0] + wide] = True
        else:
            strip[:, columns[-1] - wide + 1 : columns[-1] + 1] = True
    return sides, np.asarray(strip & mask)


def draw(
    picture: NDArray[np.uint8], fault: Fault, where: BoolArray, depth_m: FloatArray, capture: RgbdCapture
) -> None:
    """Mark depth pixels (h, w) in a fault picture; those without depth get that of the nearest.

    Parameters
    ----------
    picture : ndarray (h', w') uint8
        Changed in place.
    fault : str
    where : ndarray (h, w) bool
    depth_m : ndarray (h, w)
        Of the body alone, 0 elsewhere.
    capture : RgbdCapture
    """
    if not where.any() or not (depth_m > 0).any():
        return
    rows, columns = np.nonzero(where | (depth_m > 0))
    box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    body, asked = depth_m[box], where[box]
    nearest = distance_transform_edt(body <= 0, return_distances=False, return_indices=True)
    z = body[tuple(nearest)][asked]
    rays = capture.rig.depth.pixel_rays[box][asked]
    pixels = capture.rig.project_to_picture(rays * z[:, None])
    share = picture.shape[1] / capture.rig.picture_camera.width
    at = np.rint((pixels + 0.5) * share - 0.5)
    ok = np.isfinite(at).all(1)
    at = at[ok].astype(int)
    ok = (at >= 0).all(1) & (at[:, 0] < picture.shape[1]) & (at[:, 1] < picture.shape[0])
    hit = np.zeros(picture.shape, np.uint8)
    hit[at[ok, 1], at[ok, 0]] = 1
    focal = capture.rig.picture_camera.fx * share
    gap = (int(np.ceil(focal / capture.rig.depth.fx)) | 1) + 2
    closed = cv2.morphologyEx(hit, cv2.MORPH_CLOSE, np.ones((gap, gap), np.uint8))
    picture[closed > 0] = label_of(fault)
