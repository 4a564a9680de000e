"""A hand found in a depth image without any marker: the nearest part of an arm's size, and its hand end."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEAREST_M, _FARTHEST_M = 0.25, 1.3
_PIXEL_M = 0.004
"""Fine enough for fingers; everything beyond is done on the whole hand."""

_STEEP = 2.5
_NOISE_M = 0.012
_LEAST_M2 = 0.004
_WHOLE_M = 0.62
"""Longest arm from elbow to fingertip; what is larger has the body with it."""

_AROUND_NEAREST_M = 0.26
_END_M = 0.13
_PALM_RADIUS_M = (0.016, 0.065)
_FINGER_RADIUS_M = 0.0125
_SEED_SHARE = 0.45
_BEFORE_WRIST_M = 0.05
_SLICE_M = 0.010
_WRIST_SCORE = 3.0
_THICK_SCORE = 800.0
_LEAVES_SCORE = 40.0


@dataclass(frozen=True, eq=False)
class _Part:
    """One connected thing in the thinned depth image."""

    mask: Mask
    points: FloatArray
    pixels: NDArray[np.int64]


def find_hand(depth_m: FloatArray, camera: PinholeCamera) -> FloatArray:
    """Places (5, 3) on the hand nearest to the camera, to begin `core.hand.surface.cut_hand` with.

    Of the connected parts of the image, from the nearest on, the first that has the thickness of an arm. Its
    hand is the end with fingers; of a closed hand the thicker end, and the one nearer to the wrist. The
    places lie around the middle of the palm (or of its back), where the part is thickest.

    Raises
    ------
    WorkError
        If there is no such part between 0.25 and 1.3 m.
    """
    step = _step(depth_m, camera)
    z = np.asarray(cv2.medianBlur(np.ascontiguousarray(depth_m[::step, ::step], dtype=np.float32), 3))
    z = np.where((z > _NEAREST_M) & (z < _FARTHEST_M), z, np.float32(0.0))
    rays = camera.pixel_rays[::step, ::step]
    points = rays * z[..., None].astype(float)
    for part in _parts(z, points, step / camera.fx):
        seeds = _palm(part, z, points, step / camera.fx)
        if seeds is not None:
            return seeds
    raise WorkError("No hand is in view.", "Hold one hand free, 0.5 to 1 m before the camera.")


def _step(depth_m: FloatArray, camera: PinholeCamera) -> int:
    near = depth_m[(depth_m > _NEAREST_M) & (depth_m < _FARTHEST_M)]
    if len(near) == 0:
        raise WorkError("No hand is in view.", "Hold one hand free, 0.5 to 1 m before the camera.")
    return max(1, int(_PIXEL_M * camera.fx / float(np.percentile(near, 5))))


def _parts(z: NDArray[np.float32], points: FloatArray, pixel: float) -> list[_Part]:
    """Connected parts that are large enough for a hand, the nearest first."""
    block = np.ones((3, 3), np.uint8)
    step = np.maximum(2.0 * _STEEP * pixel * z, _NOISE_M)
    lowest = cv2.erode(np.where(z > 0, z, np.float32(100.0)), block)
    even = (z > 0) & (cv2.dilate(z, block) - lowest < step)
    count, labels = cv2.connectedComponents(even.view(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    found = []
    sizes = np.bincount(labels.ravel(), minlength=count)
    least = _LEAST_M2 / (pixel * _FARTHEST_M) ** 2
    for label in np.flatnonzero(sizes[1:] >= least) + 1:
        mask = np.asarray(labels == label)
        places = points[mask]
        middle = float(np.median(places[:, 2]))
        if len(places) * (pixel * middle) ** 2 < _LEAST_M2:
            continue
        if float(np.ptp(places, axis=0).max()) > _WHOLE_M:
            # the body is in it, too: only what is about its nearest place can be a hand held out
            order = np.argsort(places[:, 2])
            nearest = np.median(places[order[: max(10, len(order) // 200)]], axis=0)
            mask = mask & (((points - nearest) ** 2).sum(axis=2) < _AROUND_NEAREST_M**2)
        v, u = np.nonzero(mask)
        found.append(_Part(mask, points[v, u], np.stack([u, v], axis=1)))
    return sorted(found, key=lambda part: float(np.percentile(part.points[:, 2], 5)))


def _palm(part: _Part, z: NDArray[np.float32], points: FloatArray, pixel: float) -> FloatArray | None:
    """Seeds on the palm of a part; None if it is not of a hand's thickness."""
    middle = float(np.median(part.points[:, 2]))
    pixel_m = pixel * middle
    filled = cv2.morphologyEx(part.mask.view(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    # the image's border is no border of the part
    padded = cv2.copyMakeBorder(filled, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    inner = cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1] * pixel_m
    fingers = _fingers(filled, pixel_m)
    best, most = None, -np.inf
    for end, judged in _ends(part, pixel_m, (z.shape[1], z.shape[0])):
        near = part.mask & (((points - end) ** 2).sum(axis=2) < _END_M**2)
        if not near.any():
            continue
        radius = np.where(near, inner, 0.0)
        v, u = np.unravel_index(int(radius.argmax()), radius.shape)
        thick = float(radius[v, u])
        if not _PALM_RADIUS_M[0] < thick < _PALM_RADIUS_M[1]:
            continue
        # square centimetres of finger, then the palm's thickness against the elbow's, then the wrist's place
        score = 1e4 * float((fingers & near).sum()) * pixel_m**2 + _THICK_SCORE * thick + judged
        if score > most:
            most, best = score, _around(points, part.mask, int(u), int(v), _SEED_SHARE * thick / pixel_m)
    return best


def _fingers(mask: NDArray[np.uint8], pixel_m: float) -> Mask:
    """What is thinner than a finger, without ragged rims."""
    size = 2 * max(1, round(_FINGER_RADIUS_M / pixel_m)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    thin = mask & ~cv2.morphologyEx(mask, cv2.MORPH_OPEN, disc)
    return np.asarray(cv2.morphologyEx(thin, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))) > 0


def _ends(part: _Part, pixel_m: float, size: tuple[int, int]) -> list[tuple[FloatArray, float]]:
    """The two ends of a part along its longest direction, and how much speaks for its being the hand.

    The wrist is the narrowest place and nearer to the hand's end; the other leaves the picture or goes on.
    """
    centred = part.points - part.points.mean(axis=0)
    axis = np.linalg.svd(centred.T @ centred)[0][:, 0]
    along = centred @ axis
    low, high = np.percentile(along, (1, 99))
    inner = (along > low + _BEFORE_WRIST_M) & (along < high - _BEFORE_WRIST_M)
    wrist = 0.5 * (low + high)
    if inner.any():
        bins = ((along[inner] - low) / _SLICE_M).astype(np.int64)
        widths = np.bincount(bins).astype(float)[bins.min() :]
        widths = np.convolve(np.pad(widths, 1, mode="edge"), np.ones(3) / 3.0, mode="valid")
        if len(widths) > 2:
            wrist = low + _SLICE_M * (int(bins.min()) + 1 + int(widths[1:-1].argmin()) + 0.5)
    found = []
    for chosen, toward in ((along <= low, wrist - low), (along >= high, high - wrist)):
        pixels = part.pixels[chosen]
        out = (pixels <= 1).any(axis=1) | (pixels >= np.array(size) - 2).any(axis=1)
        judged = _WRIST_SCORE * float(toward < 0.5 * (high - low)) - _LEAVES_SCORE * float(out.mean() > 0.2)
        found.append((part.points[chosen].mean(axis=0), judged))
    return found


def _around(points: FloatArray, mask: Mask, u: int, v: int, radius_px: float) -> FloatArray:
    """The middle and four places around it, as far as they are measured."""
    found = []
    for du, dv in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        x, y = round(u + du * radius_px), round(v + dv * radius_px)
        inside = 0 <= y < mask.shape[0] and 0 <= x < mask.shape[1] and mask[y, x]
        found.append(points[y, x] if inside else points[v, u])
    return np.array(found)
