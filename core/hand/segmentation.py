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
"""How far from the middle of the back of the hand a hand reaches: the longest finger of a large hand, and more."""

STEEP = 5.0
"""Tangent of the steepest skin that is still followed; what is steeper is a step from one thing to another."""

DOUBTFUL = 1.8
"""What lies beyond a slope steeper than this may be a finger, or a thing held; its thickness tells."""

FINGER_M = 0.026
"""A finger is not thicker."""

FINGER_M2 = 0.0030
"""Nor has it more skin in view."""

_LEAST_STEP_M, _AT_M = 0.0045, 0.75
"""Steps below this are noise, at this distance; depth noise grows with the distance's square."""

_SEED_GATE_M = 0.024
_SEED_PX = 3
_MARGIN_PX = 6
_LEAST_PIXELS = 150
_RIM_ROUNDS = 2
_BLOCK = np.ones((3, 3), np.uint8)
_FAR_M = np.float32(100.0)

_RING = (0.86, 0.99)
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
        Of the crop, without its isolated errors (3 x 3 median).
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
    known = seed_m[np.isfinite(seed_m).all(axis=1)]
    if len(known) == 0:
        raise WorkError("It is not known where the hand is.", "Show the marker to the camera.")
    centre = known.mean(axis=0)
    u0, v0, u1, v1 = _window(camera, centre, reach_m)
    crop = np.ascontiguousarray(depth_m[v0:v1, u0:u1], dtype=np.float32)
    cropped = replace(camera, width=u1 - u0, height=v1 - v0, cx=camera.cx - u0, cy=camera.cy - v0)
    crop = np.where(np.abs(crop - np.float32(centre[2])) < np.float32(reach_m), crop, np.float32(0.0))
    smooth = np.asarray(cv2.medianBlur(crop, 3))
    step = _steps(smooth, camera.fx, STEEP)
    skin = _connected(_even(smooth, step), smooth, cropped, known)
    chosen, foreign = _without_things(skin, smooth, cropped, known)
    mask = _with_rim(chosen, crop, 0.5 * step) & ~foreign
    near = _within(mask, crop, cropped, centre, reach_m)
    if int(near.sum()) < _LEAST_PIXELS:
        raise _no_skin()
    touching = _goes_on(skin, crop, cropped, centre, reach_m)
    return HandPart(near, crop, (u0, v0), cropped, centre, touching)


def _window(camera: PinholeCamera, centre: FloatArray, reach_m: float) -> tuple[int, int, int, int]:
    middle = camera.project(centre)[0]
    if not np.isfinite(middle).all():
        raise WorkError("The hand is behind the camera.", "Hold it 0.5 to 1 m before the camera.")
    reach = reach_m / max(float(centre[2]) - 0.05, 0.15) * np.array([camera.fx, camera.fy]) + _MARGIN_PX
    low = np.clip(np.floor(middle - reach), 0, (camera.width - 8, camera.height - 8)).astype(int)
    high = np.clip(np.ceil(middle + reach), low + 8, (camera.width, camera.height)).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _steps(smooth: Image, focal_px: float, tangent: float) -> Image:
    """Change of depth (h, w) over two pixels at this slope, or by noise."""
    noise = np.float32(_LEAST_STEP_M / _AT_M**2) * np.maximum(smooth, np.float32(_AT_M)) ** 2
    return np.asarray(np.maximum(smooth * np.float32(2.0 * tangent / focal_px), noise))


def _even(smooth: Image, step: Image) -> Mask:
    """Pixels about which, one pixel each way, nothing is steeper than skin."""
    highest = cv2.dilate(smooth, _BLOCK)
    lowest = cv2.erode(np.where(smooth > 0, smooth, _FAR_M), _BLOCK)
    return np.asarray((smooth > 0) & (highest - lowest < step))


def _connected(even: Mask, smooth: Image, camera: PinholeCamera, seed_m: FloatArray) -> Mask:
    """The connected part that most of the seeds lie on."""
    labels = _labels(even)
    return np.asarray(labels == _at_seeds(labels, smooth, camera, seed_m))


def _labels(mask: Mask) -> NDArray[np.int32]:
    return np.asarray(cv2.connectedComponents(mask.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)[1])


def _at_seeds(
    labels: NDArray[np.int32], smooth: Image, camera: PinholeCamera, seed_m: FloatArray
) -> int:
    """Label that most of the seeds lie on."""
    found: list[NDArray[np.int32]] = []
    # between corners that lie on the hand's rim there is skin, too
    places = np.vstack([seed_m, seed_m.mean(axis=0), 0.5 * (seed_m + seed_m.mean(axis=0))])
    pixels = np.rint(camera.project(places))
    inside = camera.contains(pixels)
    for (u, v), place in zip(pixels[inside].astype(np.int64), places[inside], strict=True):
        box = slice(max(v - _SEED_PX, 0), v + _SEED_PX + 1), slice(max(u - _SEED_PX, 0), u + _SEED_PX + 1)
        there = (labels[box] > 0) & (np.abs(smooth[box] - place[2]) < _SEED_GATE_M)
        found.append(labels[box][there])
    numbers = np.concatenate(found) if found else np.zeros(0, np.int32)
    if len(numbers) == 0:
        raise _no_skin()
    return int(np.bincount(numbers).argmax())


def _without_things(
    skin: Mask, smooth: Image, camera: PinholeCamera, seed_m: FloatArray
) -> tuple[Mask, Mask]:
    """Leave out what lies behind a doubtful slope and is thicker or larger than a finger.

    Returns
    -------
    chosen, foreign : ndarray (h, w) bool
    """
    labels = _labels(skin & _even(smooth, _steps(smooth, camera.fx, DOUBTFUL)))
    own = _at_seeds(labels, smooth, camera, seed_m)
    pixel_m = float(np.median(seed_m[:, 2])) / camera.fx
    others = (labels > 0) & (labels != own)
    inner = cv2.distanceTransform(others.view(np.uint8), cv2.DIST_L2, 3)
    thick = np.unique(labels[inner > 0.5 * FINGER_M / pixel_m])
    large = np.flatnonzero(np.bincount(labels.ravel()) > FINGER_M2 / pixel_m**2)
    is_thing = np.zeros(int(labels.max()) + 1, np.bool_)
    is_thing[thick], is_thing[large] = True, True
    is_thing[[0, own]] = False
    foreign = is_thing[labels]
    return np.asarray((labels > 0) & ~foreign), np.asarray(foreign)


def _no_skin() -> WorkError:
    return WorkError(
        "There is no measured skin at the marker.", "Hold the hand 0.5 to 1 m from the camera, not edge on."
    )


def _with_rim(chosen: Mask, depth: Image, step: Image) -> Mask:
    """Give back the pixels beside steps that lie on the near side with the part."""
    mask = chosen
    for _ in range(_RIM_ROUNDS):
        farthest = cv2.dilate(np.where(mask, depth, np.float32(0.0)), _BLOCK)
        nearest = cv2.erode(np.where(mask, depth, _FAR_M), _BLOCK)
        mask = mask | ((depth > 0) & (depth < farthest + step) & (depth > nearest - step))
    return np.asarray(mask)


def _within(mask: Mask, depth: Image, camera: PinholeCamera, centre: FloatArray, reach_m: float) -> Mask:
    return np.asarray(mask & (_way_squared(depth, camera, centre) < np.float32(reach_m**2)))


def _way_squared(depth: Image, camera: PinholeCamera, centre: FloatArray) -> Image:
    """Squared distance of every pixel's place from the middle; a lens's distortion hardly matters here."""
    x = ((np.arange(camera.width) - camera.cx) / camera.fx).astype(np.float32)
    y = ((np.arange(camera.height) - camera.cy) / camera.fy).astype(np.float32)
    c = centre.astype(np.float32)
    return np.asarray(
        (depth * x[None] - c[0]) ** 2 + (depth * y[:, None] - c[1]) ** 2 + (depth - c[2]) ** 2
    )


def _goes_on(
    mask: Mask, depth: Image, camera: PinholeCamera, centre: FloatArray, reach_m: float
) -> str | None:
    """Whether the part leaves the reach in more directions than one arm does."""
    v, u = np.nonzero(mask[::2, ::2])
    v, u = 2 * v, 2 * u
    z = depth[v, u]
    x = z * ((u - camera.cx) / camera.fx) - centre[0]
    y = z * ((v - camera.cy) / camera.fy) - centre[1]
    way = np.sqrt(x * x + y * y + (z - centre[2]) ** 2) / reach_m
    ring = (way > _RING[0]) & (way < _RING[1])
    bins = np.floor((np.arctan2(y[ring], x[ring]) / (2 * np.pi) + 0.5) * _RING_BINS).astype(np.int64)
    met = np.bincount(np.clip(bins, 0, _RING_BINS - 1), minlength=_RING_BINS) > 2
    if met.sum() <= _ARM_SPAN * _RING_BINS:
        return None
    return "The hand touches something large, a body or a table: hold it free."
