"""Dark blobs of every size: maxima of differences of Gaussians against the local noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.lesions.body_picture import BodyPicture, Image

FloatArray = NDArray[np.float64]

_FIRST_SIGMA = 0.8
_STEP = np.sqrt(2.0)
# A disc answers most at the scale of its radius over the square root of two.
_RADIUS_PER_SIGMA = np.sqrt(2.0)
_LARGEST_M = 0.011
_REACH_M = 0.012
_LEAST_RESPONSE = 0.008
_GLOBAL_NOISES = 3.5
_LOCAL_NOISES = 3.0
_LEAST_ROUND = 0.1
_LOCAL_SHRINK = 4
_LOCAL_CELLS = 7
_MOST = 6000
# Before they are measured only blobs of neighbouring scales exclude each other: a shadow answers more
# strongly than the mole that lies in it.
_SIMILAR = 1.6


@dataclass(frozen=True, eq=False)
class Blobs:
    """Candidates, strongest first.

    Attributes
    ----------
    places : ndarray (n, 2)
        Crop pixels (x, y).
    radius : ndarray (n,)
        Crop pixels; of the disc that would answer most at this scale.
    response : ndarray (n,)
        Difference of Gaussians: about a quarter of a disc's log-contrast.
    noises : ndarray (n,)
        Response over the local root mean square of responses at the same scale.
    """

    places: FloatArray
    radius: FloatArray
    response: FloatArray
    noises: FloatArray

    def __len__(self) -> int:
        return len(self.places)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Blobs:
        """Only these rows, in this order."""
        return Blobs(self.places[rows], self.radius[rows], self.response[rows], self.noises[rows])


def find_blobs(picture: BodyPicture) -> Blobs:
    """Dark blobs on the body and up to 12 mm beside it, where the depth camera may have lost the rim."""
    reach = max(1, round(_REACH_M * picture.pixels_per_m / picture.cell))
    near = _grown(picture.on_body, reach)
    core = ~_grown(~picture.on_body, 2)
    if not core.any():
        core = picture.on_body
    search, quiet = picture.mask(near), picture.mask(core)
    found: list[Blobs] = []
    image, sigma, size = picture.darkness, _FIRST_SIGMA, 1
    image = cv2.GaussianBlur(image, (0, 0), sigma)
    largest = _LARGEST_M * picture.pixels_per_m
    while sigma * size * _RADIUS_PER_SIGMA < largest and min(image.shape) > 16:
        wider = cv2.GaussianBlur(image, (0, 0), sigma * np.sqrt(_STEP**2 - 1.0))
        found.append(_maxima(cv2.subtract(image, wider), sigma, size, search, quiet))
        image, sigma = wider, sigma * _STEP
        if sigma > 2.2:
            image, sigma, size = np.ascontiguousarray(image[::2, ::2]), sigma / 2.0, size * 2
            search, quiet = (np.ascontiguousarray(m[::2, ::2]) for m in (search, quiet))
    return _without_doubles(found)


def _grown(cells: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    return np.asarray(cv2.dilate(cells.view(np.uint8), kernel).view(np.bool_))


def _maxima(
    response: Image, sigma: float, size: int, search: NDArray[np.bool_], quiet: NDArray[np.bool_]
) -> Blobs:
    """Local maxima of one level; ``size`` crop pixels per pixel of the level."""
    sample = response[::3, ::3][quiet[::3, ::3]]
    noise = 1.4826 * float(np.median(np.abs(sample))) if len(sample) else 0.0
    threshold = max(_LEAST_RESPONSE, _GLOBAL_NOISES * noise)
    top = cv2.compare(response, cv2.dilate(response, np.ones((3, 3), np.uint8)), cv2.CMP_GE)
    top &= cv2.compare(response, threshold, cv2.CMP_GT)
    top &= search.view(np.uint8)
    top[[0, -1]] = 0
    top[:, [0, -1]] = 0
    where = cv2.findNonZero(top)
    x, y = (np.zeros((0, 2), np.int64) if where is None else where.reshape(-1, 2).astype(np.int64)).T
    local = _local_noise(response, quiet, noise)
    at = response[y, x]
    noises = (
        at
        / local[
            np.minimum(y // (2 * _LOCAL_SHRINK), local.shape[0] - 1),
            np.minimum(x // (2 * _LOCAL_SHRINK), local.shape[1] - 1),
        ]
    )
    keep = (noises > _LOCAL_NOISES) & (_roundness(response, y, x) > _LEAST_ROUND)
    x, y, at, noises = x[keep], y[keep], at[keep], noises[keep]
    dx = _vertex(response[y, x - 1], at, response[y, x + 1])
    dy = _vertex(response[y - 1, x], at, response[y + 1, x])
    places = np.stack([x + dx, y + dy], axis=1).astype(float) * size
    radius = np.full(len(x), sigma * np.sqrt(_STEP) * size * _RADIUS_PER_SIGMA)
    return Blobs(places, radius, at.astype(float), noises.astype(float))


def _roundness(response: Image, y: NDArray[np.int64], x: NDArray[np.int64]) -> Image:
    """Smaller over larger curvature at places of the image: 1 on a round top, 0 on a ridge."""
    at = response[y, x]
    xx = 2.0 * at - response[y, x - 1] - response[y, x + 1]
    yy = 2.0 * at - response[y - 1, x] - response[y + 1, x]
    xy = response[y + 1, x - 1] + response[y - 1, x + 1] - response[y - 1, x - 1] - response[y + 1, x + 1]
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), 0.25 * xy)
    return np.asarray((mean - half) / np.maximum(mean + half, 1e-9))


def _vertex(before: Image, at: Image, after: Image) -> Image:
    """Offset of a parabola's vertex from its middle sample."""
    bend = np.maximum(2.0 * at - before - after, 1e-9)
    return np.asarray(np.clip((after - before) / (2.0 * bend), -0.5, 0.5))


def _local_noise(response: Image, quiet: NDArray[np.bool_], noise: float) -> Image:
    """Root mean square of the responses around, on a coarse grid; single strong spots are clipped."""
    response, quiet = response[::2, ::2], quiet[::2, ::2]
    h, w = response.shape
    size = (max(1, -(-w // _LOCAL_SHRINK)), max(1, -(-h // _LOCAL_SHRINK)))
    power = np.minimum(np.abs(response), np.float32(6.0 * noise + 1e-6))
    power *= power
    weight = quiet.astype(np.float32)
    power *= weight
    window = (_LOCAL_CELLS, _LOCAL_CELLS)
    mean, share = (
        cv2.blur(cv2.resize(m, size, interpolation=cv2.INTER_AREA), window, borderType=cv2.BORDER_CONSTANT)
        for m in (power, weight)
    )
    return np.asarray(
        np.maximum(np.sqrt(np.maximum(mean, 0.0) / np.maximum(share, 1e-3)), 0.7 * noise + 1e-6), np.float32
    )


def _without_doubles(levels: list[Blobs]) -> Blobs:
    """All levels in one, each spot once: at the scale where it answers most."""
    blobs = (
        Blobs(*(np.concatenate([getattr(b, name) for b in levels]) for name in Blobs.__dataclass_fields__))
        if levels
        else Blobs(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
    )
    blobs = blobs.take(np.argsort(-blobs.response, kind="stable")[: 3 * _MOST])
    keep = strongest_only(blobs.places, blobs.radius, _SIMILAR)
    return blobs.take(np.flatnonzero(keep)[:_MOST])


def strongest_only(places: FloatArray, radius: FloatArray, similar: float = np.inf) -> NDArray[np.bool_]:
    """Which of overlapping blobs, given strongest first, stay (n,).

    One gives way to a stronger that stays if their centres are nearer than most of the larger radius and
    neither is more than ``similar`` times as large as the other.
    """
    if len(places) < 2:
        return np.ones(len(places), np.bool_)
    reach = np.maximum(2.0, 0.9 * radius)
    pairs = np.sort(cKDTree(places).query_pairs(float(reach.max()), output_type="ndarray"), axis=1)
    one, two = pairs.T
    apart = np.linalg.norm(places[one] - places[two], axis=1)
    ratio = np.maximum(radius[one] / radius[two], radius[two] / radius[one])
    strong, weak = pairs[(apart < np.maximum(reach[one], reach[two])) & (ratio < similar)].T
    # 0 undecided, 1 kept, 2 dropped: whoever has no stronger neighbour left stays and drops its neighbours.
    state = np.zeros(len(places), np.int8)
    while (state == 0).any():
        blocked = np.zeros(len(places), np.bool_)
        blocked[weak[state[strong] == 0]] = True
        state[(state == 0) & ~blocked] = 1
        dropped = weak[state[strong] == 1]
        state[dropped] = 2
    return np.asarray(state == 1)
