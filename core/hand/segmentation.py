"""Which pixels of a depth image are the hand: skin that goes on without a step from where the marker is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

REACH_M = 0.21
"""How far a hand reaches from the middle of its back: the longest finger of a large hand, and more."""

STEEP = 5.0
"""Tangent of the steepest skin that is still followed; what is steeper is a step to another thing."""

DOUBTFUL = 1.8
"""What lies beyond a slope steeper than this may be a finger, or a thing held; its thickness tells."""

FINGER_M = 0.026
"""A finger is not thicker."""

FINGER_M2 = 0.0030
"""Nor has it more skin in view."""

CORE_M = 0.018
"""Half the thickness of palm, wrist and forearm, and of things held, is more; half of a finger's less."""

_ON_TOP_M = 0.005

_LEAST_STEP_M, _AT_M = 0.0045, 0.75
"""Steps below this are noise, at this distance; depth noise grows with the distance's square."""

_SEED_GATE_M = 0.024
_SEED_PX = 3
_MARGIN_PX = 6
_LEAST_PIXELS = 150
_RIM_ROUNDS = 2

_RING = 0.86
_RING_BINS = 48
_ARM_SPAN = 0.30
"""Share of all directions in which a forearm leaves the reach, seen at its widest."""


@dataclass(frozen=True, eq=False)
class HandPart:
    """The pixels of a hand.

    Attributes
    ----------
    mask : ndarray (h, w) bool
        Within the crop.
    depth_m : ndarray (h, w) float32
        Of the crop; 0 beyond reach.
    median_m : ndarray (h, w) float32
        3 x 3 median of it.
    corner_px : tuple of int
        Upper left pixel (u, v) of the crop.
    camera : PinholeCamera
        The depth camera, cropped.
    centre_m : ndarray (3,)
    touching : str or None
        A sentence if what was cut goes on in more directions than a forearm does.
    """

    mask: Mask
    depth_m: Image
    median_m: Image
    corner_px: tuple[int, int]
    camera: PinholeCamera
    centre_m: FloatArray
    touching: str | None


def part_of_hand(
    depth_m: FloatArray, camera: PinholeCamera, seed_m: FloatArray, reach_m: float = REACH_M
) -> HandPart:
    """Pixels connected with places on the hand, within reach of their middle.

    Two neighbouring pixels belong together where the depth does not change more steeply than skin does
    (`STEEP`): a finger before the palm, a bottle behind the fingers, the body behind the hand are each behind
    a step. Where they touch in a few pixels only, the bridge is too narrow to be crossed.

    Raises
    ------
    WorkError
        If there is no measured skin at these places.
    """
    from core.hand.segmentation_kernels import (
        EVEN,
        flood,
        give_back_rim,
        mark_slopes,
        within_reach,
    )

    known = seed_m[np.isfinite(seed_m).all(axis=1)]
    if len(known) == 0:
        raise WorkError("It is not known where the hand is.", "Show the marker to the camera.")
    centre = known.mean(axis=0)
    u0, v0, u1, v1 = _window(camera, centre, reach_m)
    crop = np.empty((v1 - v0, u1 - u0), np.float32)
    lens = camera.fx, camera.fy, camera.cx, camera.cy
    within_reach(np.asarray(depth_m, dtype=float), u0, v0, lens, centre, reach_m, crop)
    cropped = replace(camera, width=u1 - u0, height=v1 - v0, cx=camera.cx - u0, cy=camera.cy - v0)
    smooth = np.asarray(cv2.medianBlur(crop, 3))
    change = 2.0 / camera.fx
    marks = mark_slopes(smooth, STEEP * change, DOUBTFUL * change, _LEAST_STEP_M, _AT_M)
    skin = np.zeros(crop.shape, np.bool_)
    places = _seed_places(known)
    starts = _near_seeds(marks, EVEN, smooth, cropped, places)
    count, left, top, right, bottom = flood(marks, EVEN, starts, skin)
    if count < _LEAST_PIXELS:
        raise _no_skin()
    box = (
        slice(max(top - _RIM_ROUNDS, 0), bottom + _RIM_ROUNDS),
        slice(max(left - _RIM_ROUNDS, 0), right + _RIM_ROUNDS),
    )
    cropped = replace(
        cropped,
        width=len(range(crop.shape[1])[box[1]]),
        height=len(range(crop.shape[0])[box[0]]),
        cx=cropped.cx - box[1].start,
        cy=cropped.cy - box[0].start,
    )
    pixel_m = float(centre[2]) / camera.fx
    skin, smooth = np.ascontiguousarray(skin[box]), smooth[box]
    # the median has filled single holes
    crop = np.where(crop[box] > 0, crop[box], smooth)
    chosen, foreign = _without_things(skin, marks[box], smooth, cropped, places, pixel_m)
    give_back_rim(chosen, foreign, crop, 0.5 * STEEP * change, 0.5 * _LEAST_STEP_M, _RIM_ROUNDS)
    starts = _near_seeds(chosen.view(np.uint8), 1, smooth, cropped, places)
    chosen &= ~_beyond_necks(chosen, crop, starts, pixel_m)
    if int(chosen.sum()) < _LEAST_PIXELS:
        raise _no_skin()
    touching = _goes_on(skin, crop, cropped, centre, reach_m)
    corner = u0 + box[1].start, v0 + box[0].start
    return HandPart(chosen, crop, np.ascontiguousarray(smooth), corner, cropped, centre, touching)


def _window(camera: PinholeCamera, centre: FloatArray, reach_m: float) -> tuple[int, int, int, int]:
    middle = camera.project(centre)[0]
    if not np.isfinite(middle).all():
        raise WorkError("The hand is behind the camera.", "Hold it 0.5 to 1 m before the camera.")
    reach = reach_m / max(float(centre[2]) - 0.05, 0.15) * np.array([camera.fx, camera.fy]) + _MARGIN_PX
    low = np.clip(np.floor(middle - reach), 0, (camera.width - 8, camera.height - 8)).astype(int)
    high = np.clip(np.ceil(middle + reach), low + 8, (camera.width, camera.height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _seed_places(seed_m: FloatArray) -> FloatArray:
    """Seeds, and places between them: between corners that lie on the hand's rim there is skin, too."""
    middle = seed_m.mean(axis=0)
    return np.vstack([seed_m, middle, 0.5 * (seed_m + middle)])


def _near_seeds(
    marks: NDArray[np.uint8], mark: int, smooth: Image, camera: PinholeCamera, places: FloatArray
) -> NDArray[np.int64]:
    """Pixels (k, 2) with a mark close to where the seeds are."""
    pixels = np.rint(camera.project(places))
    inside = camera.contains(pixels)
    found = [np.zeros((0, 2), np.int64)]
    for (u, v), place in zip(pixels[inside].astype(np.int64), places[inside], strict=True):
        top, left = max(v - _SEED_PX, 0), max(u - _SEED_PX, 0)
        box = slice(top, v + _SEED_PX + 1), slice(left, u + _SEED_PX + 1)
        rows, columns = np.nonzero((marks[box] & mark > 0) & (np.abs(smooth[box] - place[2]) < _SEED_GATE_M))
        found.append(np.stack([columns + left, rows + top], axis=1))
    starts = np.concatenate(found)
    if len(starts) == 0:
        raise _no_skin()
    return starts


def _without_things(
    skin: Mask,
    marks: NDArray[np.uint8],
    smooth: Image,
    camera: PinholeCamera,
    places: FloatArray,
    pixel_m: float,
) -> tuple[Mask, Mask]:
    """Leave out what lies behind a doubtful slope and is thicker or larger than a finger.

    Returns
    -------
    chosen, foreign : ndarray (h, w) bool
    """
    from core.hand.segmentation_kernels import SMOOTH

    sure = np.ascontiguousarray(skin & (marks & SMOOTH > 0))
    _, labels = cv2.connectedComponents(sure.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    starts = _near_seeds(sure.view(np.uint8), 1, smooth, camera, places)
    own = int(np.bincount(labels[starts[:, 1], starts[:, 0]]).argmax())
    area_m2 = np.bincount(labels.ravel()) * pixel_m**2
    area_m2[[0, own]] = 0.0
    is_thing = area_m2 > FINGER_M2
    doubtful = (area_m2 > FINGER_M**2 / 2) & ~is_thing
    if doubtful.any():
        inner = cv2.distanceTransform(doubtful[labels].view(np.uint8), cv2.DIST_L2, 3)
        is_thing[np.unique(labels[inner > 0.5 * FINGER_M / pixel_m])] = True
    foreign = is_thing[labels] if is_thing.any() else np.zeros_like(sure)
    return sure & ~foreign, foreign


def _beyond_necks(chosen: Mask, depth: Image, starts: NDArray[np.int64], pixel_m: float) -> Mask:
    """What is thicker than any finger and hangs on the hand by fingers or narrower bridges only.

    Where fingertips lie flat on a bottle no step is seen; but a hand is thick in one piece, palm and forearm.
    """
    nothing = np.zeros_like(chosen)
    inner = cv2.distanceTransform(chosen.view(np.uint8), cv2.DIST_L2, 3)
    broad = np.ascontiguousarray(inner > 0.5 * FINGER_M / pixel_m)
    count, cores = cv2.connectedComponents(broad.view(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    own = np.unique(cores[starts[:, 1], starts[:, 0]])
    own = own[own > 0]
    if count <= 1 + len(own) or len(own) == 0:
        return nothing
    things = (inner > CORE_M / pixel_m) & ~np.isin(cores, own)
    if not things.any():
        return nothing
    away, nearest = cv2.distanceTransformWithLabels(
        (~things).view(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    # fingers lie on the thing, nearer to the camera than its middle
    level = np.zeros(int(nearest.max()) + 1, np.float32)
    level[nearest[things]] = depth[things]
    foreign = chosen & (away <= CORE_M / pixel_m + 2.0) & (depth > level[nearest] - _ON_TOP_M)
    left = np.ascontiguousarray(chosen & ~foreign)
    _, labels = cv2.connectedComponents(left.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    beside = cv2.dilate(foreign.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    loose = np.unique(labels[beside & left])
    hand = np.unique(labels[starts[:, 1], starts[:, 0]])
    loose = loose[~np.isin(loose, hand) & (loose > 0)]
    return np.asarray(foreign | np.isin(labels, loose))


def _no_skin() -> WorkError:
    return WorkError(
        "There is no measured skin at the marker.", "Hold the hand 0.5 to 1 m from the camera, not edge on."
    )


def _goes_on(
    mask: Mask, depth: Image, camera: PinholeCamera, centre: FloatArray, reach_m: float
) -> str | None:
    """Whether the part leaves the reach in more directions than one arm does."""
    from core.hand.segmentation_kernels import directions_at_rim

    lens = camera.fx, camera.fy, camera.cx, camera.cy
    met = directions_at_rim(mask, depth, lens, centre, _RING * reach_m, _RING_BINS) > 2
    if met.sum() <= _ARM_SPAN * _RING_BINS:
        return None
    return "The hand touches something large, a body or a table: hold it free."
