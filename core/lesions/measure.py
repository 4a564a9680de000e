"""How a blob looks from near: sampled on rings that are round on the skin, not in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lesions.body_picture import BodyPicture, Image

FloatArray = NDArray[np.float64]

_ANGLES = 16
_RINGS = np.arange(0.15, 3.2, 0.3)
"""Radii in units of the blob's radius; the step of 0.3 is also each ring's width."""
_INNER = _RINGS < 0.6
_OUTER = (_RINGS > 1.6) & (_RINGS < 2.7)
_QUICK_RINGS = np.array([0.3, 1.8, 2.2])
_QUICK_CLOSED = 0.1
_WINDOW = 0.8
_ROUNDS = 2
_REMAP_ROWS = 16_000
_LEAST_PIXELS = 1.0
_LEAST_FORESHORTENING = 0.35
_COLOR_ANGLES = slice(0, _ANGLES, 2)


@dataclass(frozen=True, eq=False)
class Looks:
    """Measurements of blobs, row by row.

    Attributes
    ----------
    places : ndarray (n, 2)
        Centre of darkness, crop pixels.
    radius : ndarray (n,)
        Where the darkness has fallen to half, crop pixels along the less foreshortened axis.
    contrast : ndarray (n,)
        Log-contrast of the core against the median of the surroundings.
    closed : ndarray (n,)
        Second smallest contrast of all directions over `contrast`: 1 for a spot, 0 for a line or border.
    tail : ndarray (n,)
        1 minus the smallest contrast of any single direction over `contrast`: the ends of hairs have one.
    across : ndarray (n,)
        Smallest contrast against two opposite directions together, over `contrast`: 0 only for a line.
    rough : ndarray (n,)
        Unevenness of the surroundings over `contrast`.
    fill : ndarray (n,)
        Mean darkness within the radius over the darkness of the core: low for rings and loose groups.
    color, skin_color : ndarray (n, 3)
        sRGB 0..255 of core and surroundings.
    """

    places: FloatArray
    radius: FloatArray
    contrast: FloatArray
    closed: FloatArray
    tail: FloatArray
    across: FloatArray
    rough: FloatArray
    fill: FloatArray
    color: FloatArray
    skin_color: FloatArray


def skin_axes(view: FloatArray, right: FloatArray, down: FloatArray, normals: FloatArray) -> FloatArray:
    """How a unit circle on the skin looks: its axes (n, 2, 2) in the picture, longest of length 1.

    Parameters
    ----------
    view : ndarray (n, 3)
        Unit directions of sight.
    right, down : ndarray (3,)
        The picture's axes in the same frame.
    normals : ndarray (n, 3)
        Unit, toward the camera.

    Returns
    -------
    ndarray (n, 2, 2)
        Rows: the axis seen at full length, and the one foreshortened by the tilt.
    """
    short = np.clip(-np.einsum("nx,nx->n", view, normals), _LEAST_FORESHORTENING, 1.0)
    tilt = np.stack([normals @ right, normals @ down], axis=1)
    tilt -= np.stack([view @ right, view @ down], axis=1) * np.einsum("nx,nx->n", view, normals)[:, None]
    length = np.linalg.norm(tilt, axis=1, keepdims=True)
    along = np.where(length > 1e-6, tilt / np.maximum(length, 1e-6), [1.0, 0.0])
    full = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.stack([full, short[:, None] * along], axis=1)


def darker_all_round(
    picture: BodyPicture, places: FloatArray, radius: FloatArray, axes: FloatArray
) -> NDArray[np.bool_]:
    """A quick look, (n,): is the middle darker than the surroundings in all directions but one?

    The arguments are those of `measure_blobs`; what fails here would get next to no likeness.
    """
    if len(places) == 0:
        return np.zeros(0, np.bool_)
    grid = _grid(places, np.maximum(radius, _LEAST_PIXELS), axes, _QUICK_RINGS)[:, ::2]
    rings = np.asarray(_remap(picture.darkness, grid), np.float32)
    core = rings[:, :, 0].mean(axis=1)
    towards = np.sort(core[:, None] - rings[:, :, 1:].mean(axis=2), axis=1)
    return np.asarray(towards[:, 1] > _QUICK_CLOSED * np.maximum(towards[:, towards.shape[1] // 2], 0.0))


def measure_blobs(picture: BodyPicture, places: FloatArray, radius: FloatArray, axes: FloatArray) -> Looks:
    """Centre, size and contrast of at least one blob at crop pixels (n, 2), round in ``axes`` (n, 2, 2).

    ``radius`` (n,) is a first guess of the longer half-axis in crop pixels.
    """
    places, radius = places.copy(), np.maximum(radius, _LEAST_PIXELS)
    start = places.copy()
    for _ in range(_ROUNDS):
        rings = _sample(picture.darkness, places, radius, axes)
        level, slope = _surroundings(rings)
        dark = rings - level[:, None, None]
        step = _shift(dark, slope)
        limit = np.minimum(1.0, 0.5 * np.ones(len(radius)))
        step *= np.minimum(1.0, limit / np.maximum(np.linalg.norm(step, axis=1), 1e-9))[:, None]
        places = places + np.einsum("nk,nkx->nx", step * radius[:, None], axes)
        radius = np.clip(_half_radius(dark) * radius, 0.7 * radius, 1.4 * radius)
        radius = np.maximum(radius, _LEAST_PIXELS)
    strayed = np.linalg.norm(places - start, axis=1) > np.maximum(2.0, radius)
    places[strayed] = start[strayed]
    rings = _sample(picture.darkness, places, radius, axes)
    core = rings[:, :, _INNER].mean(axis=(1, 2))
    outer = np.median(rings[:, :, _OUTER], axis=2)
    darkest = outer.max(axis=1)
    outer = (outer + np.roll(outer, 1, axis=1) + np.roll(outer, -1, axis=1)) / 3.0
    towards = core[:, None] - outer
    contrast = np.median(towards, axis=1)
    scale = np.maximum(contrast, 1e-3)
    half = _ANGLES // 2
    both = 0.5 * (towards[:, :half] + towards[:, half:])
    ring = rings[:, :, _OUTER]
    smooth = outer[:, :, None]
    level = np.asarray(np.median(outer, axis=1), np.float32)
    within = (rings - level[:, None, None])[:, :, _RINGS < 1.0]
    weight = _RINGS[_RINGS < 1.0]
    color, skin_color = _colors(picture.rgb, places, radius, axes)
    return Looks(
        places=places,
        radius=radius * _half_radius(rings - level[:, None, None]),
        contrast=contrast,
        closed=np.sort(towards, axis=1)[:, 1] / scale,
        tail=1.0 - (core - darkest) / scale,
        across=both.min(axis=1) / scale,
        rough=1.4826 * np.median(np.abs(ring - smooth), axis=(1, 2)) / scale,
        fill=(within.mean(axis=1) @ weight) / weight.sum() / np.maximum(core - level, 1e-3),
        color=color,
        skin_color=skin_color,
    )


def _directions() -> FloatArray:
    angle = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _grid(places: FloatArray, radius: FloatArray, axes: FloatArray, rings: FloatArray) -> Image:
    """Crop pixels (n, angles, rings, 2) of the samples."""
    toward = (_directions() @ (axes * radius[:, None, None])).astype(np.float32)
    grid = toward[:, :, None, :] * rings.astype(np.float32)[:, None]
    grid += places.astype(np.float32)[:, None, None, :]
    return np.asarray(grid)


def _remap(image: NDArray[np.generic], grid: Image) -> NDArray[np.generic]:
    n, a, k = grid.shape[:3]
    xy = grid.reshape(n, a * k, 2)
    parts = [
        cv2.remap(image, xy[i : i + _REMAP_ROWS], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for i in range(0, n, _REMAP_ROWS)
    ]
    return np.concatenate(parts).reshape(n, a, k, *image.shape[2:])


def _sample(darkness: Image, places: FloatArray, radius: FloatArray, axes: FloatArray) -> Image:
    return np.asarray(_remap(darkness, _grid(places, radius, axes, _RINGS)), np.float32)


def _surroundings(rings: Image) -> tuple[Image, FloatArray]:
    """Level (n,) and slope (n, 2) per radius of the darkness around."""
    outer = np.median(rings[:, :, _OUTER], axis=2)
    level = np.asarray(np.median(outer, axis=1), np.float32)
    off = outer - level[:, None]
    spread = 1.4826 * np.median(np.abs(off), axis=1, keepdims=True)
    off = np.clip(off, -2.0 * spread, 2.0 * spread)
    slope = 2.0 * off @ _directions() / _ANGLES / _RINGS[_OUTER].mean()
    return level, np.asarray(slope, float)


def _shift(dark: Image, slope: FloatArray) -> FloatArray:
    """Windowed centroid (n, 2) in radii, the surroundings' slope taken out."""
    weight = _RINGS * np.exp(-0.5 * (_RINGS / _WINDOW) ** 2)
    mass = dark.mean(axis=1) @ weight
    first = np.einsum("nak,ad,k->nd", dark, _directions(), weight * _RINGS) / _ANGLES
    first -= 0.5 * slope * float(weight @ _RINGS**2)
    return np.asarray(2.0 * first / np.maximum(mass, 1e-6)[:, None])


def _half_radius(dark: Image) -> FloatArray:
    """Radius (n,), in units of the sampling's, at which the mean profile falls to half."""
    profile = dark.mean(axis=1)
    core = profile[:, _INNER].mean(axis=1)
    below = profile < 0.5 * core[:, None]
    below[:, 0] = False
    first = np.where(below.any(axis=1), below.argmax(axis=1), len(_RINGS) - 1)
    rows = np.arange(len(dark))
    high, low = profile[rows, first - 1], profile[rows, first]
    share = np.clip((high - 0.5 * core) / np.maximum(high - low, 1e-9), 0.0, 1.0)
    step = _RINGS[1] - _RINGS[0]
    return np.asarray(_RINGS[first - 1] + step * share)


def _colors(
    rgb: NDArray[np.uint8], places: FloatArray, radius: FloatArray, axes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    rings = np.concatenate([_RINGS[_INNER], _RINGS[_OUTER]])
    grid = _grid(places, radius, axes, rings)[:, _COLOR_ANGLES]
    values = _remap(rgb, grid).astype(float)
    inner = int(_INNER.sum())
    around = np.median(values[:, :, inner:], axis=(1, 2))
    return values[:, :, :inner].mean(axis=(1, 2)), around
