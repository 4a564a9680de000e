"""Corners of the board to a few hundredths of a pixel: the known print is fitted to the picture.

Around every corner the picture is looked at in board coordinates and compared with the print, blurred as
the lens blurs it (Lucas and Kanade's registration, with gain and offset of the light). A search for the
saddle point alone is disturbed by the markers beside the corner; here they help.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from core.calibration.board import BoardSpec

FloatArray = NDArray[np.float64]
Image = NDArray[np.float32]

_TEXEL = 8
"""Texture pixels a module (an eighth of a square)."""

_REACH = 0.46
"""Half the side of the fitted window, in squares."""

_SAMPLES = (21, 35)
_ROUNDS = 6
_STOP_PX = (0.05, 0.004)
_MIN_LIKENESS = 0.80
_EDGE_SIGMAS = float(np.sqrt(2 * np.pi))


class _Map:
    """Pixels of board places: a homography plus a smooth rest for the lens."""

    def __init__(self, plane: FloatArray, ids: NDArray[np.int64], pixels: FloatArray) -> None:
        self.middle, self.scale = plane.mean(axis=0), float(np.ptp(plane, axis=0).max()) / 2
        homography, inliers = cv2.findHomography(plane[ids], pixels, cv2.RANSAC, 4.0)
        self.homography = homography
        self.rest: FloatArray = np.zeros((10, 2))
        if homography is None:
            return
        good = np.asarray(inliers).ravel() > 0
        if good.sum() >= 24:
            left = pixels[good] - self._straight(plane[ids][good])
            basis = self._basis(plane[ids][good])
            # A little ridge keeps the cubic terms quiet where few corners are seen.
            self.rest = np.asarray(np.linalg.solve(basis.T @ basis + 0.05 * np.eye(10), basis.T @ left))

    def _straight(self, at: FloatArray) -> FloatArray:
        shape = at.shape
        return np.asarray(
            cv2.perspectiveTransform(np.ascontiguousarray(at).reshape(-1, 1, 2), self.homography).reshape(
                shape
            )
        )

    def _basis(self, at: FloatArray) -> FloatArray:
        x, y = np.moveaxis((at - self.middle) / self.scale, -1, 0)
        return np.stack([x**0, x, y, x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3], axis=-1)

    def __call__(self, at: FloatArray) -> FloatArray:
        return self._straight(at) + self._basis(at) @ self.rest


@lru_cache(maxsize=4)
def _print(spec: BoardSpec) -> tuple[Image, int]:
    """The print (1 white, 0 black) with a rim of two modules of paper, and the rim in texture pixels."""
    white = np.kron(~spec.modules(), np.ones((_TEXEL, _TEXEL))).astype(np.float32)
    rim = 2 * _TEXEL
    return np.pad(white, rim, constant_values=1.0), rim


def fit_corners(
    gray: NDArray[np.uint8], spec: BoardSpec, ids: NDArray[np.int64], found: FloatArray
) -> tuple[NDArray[np.int64], FloatArray, float] | None:
    """Place every corner that can be seen.

    Parameters
    ----------
    gray : ndarray (h, w)
    spec : BoardSpec
    ids : ndarray (k,)
        Corners that the markers gave.
    found : ndarray (k, 2)
        Their rough pixels.

    Returns
    -------
    (ids, pixels, rise) or None
        Corners that fit the print, their pixels, and the width of edges in pixels.
    """
    plane = spec.corners_m[:, :2]
    mapped = _Map(plane, ids, found)
    if mapped.homography is None:
        return None
    pixels, use = found, ids
    rise = edge_rise(gray, mapped, plane[ids], spec.square_m)
    for again in range(2):
        rise = min(rise, 12.0)
        use = _inside(gray, spec, mapped)
        if len(use) < 4:
            return None
        start = mapped(plane[use])
        if not again:
            known = {int(i): p for i, p in zip(ids, found, strict=True)}
            start = np.array([known.get(int(i), p) for i, p in zip(use, start, strict=True)])
        pixels, good, side = _registered(gray, spec, mapped, use, start, rise / _EDGE_SIGMAS, _STOP_PX[again])
        good &= _agree(plane[use], pixels, good, side)
        use, pixels = use[good], pixels[good]
        if len(use) < 4:
            return None
        better = _Map(plane, use, pixels)
        if better.homography is None:
            return None
        mapped = better
        rise = edge_rise(gray, mapped, plane[use], spec.square_m)
    return use, pixels, rise


def _inside(gray: NDArray[np.uint8], spec: BoardSpec, mapped: _Map) -> NDArray[np.int64]:
    """Corners whose surroundings lie in the picture."""
    plane, h = spec.corners_m[:, :2], 0.3 * spec.square_m
    around = np.stack([mapped(plane + np.array(s) * h) for s in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=1)
    limit = np.array(gray.shape[::-1]) - 2
    inside = ((around >= 1) & (around <= limit)).all(axis=(1, 2))
    a, b = around[:, 2] - around[:, 0], around[:, 3] - around[:, 1]
    # Squares seen edge on, or by a map gone wrong, tell nothing.
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    return np.flatnonzero(inside & (area > 4.0)).astype(np.int64)


def _registered(
    gray: NDArray[np.uint8],
    spec: BoardSpec,
    mapped: _Map,
    use: NDArray[np.int64],
    start: FloatArray,
    sigma_px: float,
    stop_px: float,
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Pixels (k, 2) of corners, whether the print is there, and the side (k,) of a square in pixels."""
    plane, square = spec.corners_m[use, :2], spec.square_m
    h = 0.05 * square
    right, down = np.array([h, 0.0]), np.array([0.0, h])
    jx = (mapped(plane + right) - mapped(plane - right)) / (2 * h)
    jy = (mapped(plane + down) - mapped(plane - down)) / (2 * h)
    jacobian = np.stack([jx, jy], axis=2)  # pixels a metre, (k, 2, 2)
    side = np.minimum(np.hypot(*jx.T), np.hypot(*jy.T)) * square
    samples = int(np.clip(2 * _REACH * float(np.median(side)), *_SAMPLES))
    picture, sigma_px = _softened(
        gray, sigma_px, 2 * _REACH * float(np.median(side)) / (samples - 1), mapped, spec
    )
    texture, rim = _print(spec)
    texels = 8 * _TEXEL / square
    blur = [max(sigma_px / float(np.median(np.hypot(*j.T))) * texels, 0.3) for j in (jx, jy)]
    soft = cv2.GaussianBlur(texture, (0, 0), sigmaX=blur[0], sigmaY=blur[1], borderType=cv2.BORDER_REPLICATE)
    steps = np.linspace(-_REACH, _REACH, samples)
    offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    at = ((plane[:, None] + offsets * square) * texels + rim - 0.5).astype(np.float32)

    def read(image: Image) -> Image:
        return np.asarray(
            cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        )

    template = read(soft)
    slope_x = read(cv2.Sobel(soft, cv2.CV_32F, 1, 0, ksize=3, scale=texels / 8))
    slope_y = read(cv2.Sobel(soft, cv2.CV_32F, 0, 1, ksize=3, scale=texels / 8))
    inverse = np.linalg.inv(jacobian).astype(np.float32)
    relative = _relative(mapped, plane, square, steps)
    high = np.array(gray.shape[::-1], np.float32) - 1
    pixels = start.astype(float).copy()
    where = pixels[:, None].astype(np.float32) + relative
    # Weight falls off toward the rim, where the map is less certain; beyond the picture there is nothing.
    weight = np.exp(-0.5 * (offsets**2).sum(axis=1) / 0.28**2).astype(np.float32)
    w = weight * ((where >= 0) & (where <= high)).all(axis=2)
    total = w.sum(axis=1, keepdims=True) + 1e-9
    # seen(p + d) = gain * print + light - gain * slope . (true - p) to first order: linear in four unknowns
    # whose coefficients do not depend on p, so that the solver is made once.
    columns = np.stack(
        [
            slope_x * inverse[:, 0, 0, None] + slope_y * inverse[:, 1, 0, None],
            slope_x * inverse[:, 0, 1, None] + slope_y * inverse[:, 1, 1, None],
            template,
            np.ones_like(template),
        ],
        axis=1,
    )
    weighted = columns * w[:, None]
    normal = (weighted @ columns.transpose(0, 2, 1)).astype(float)
    normal += 1e-7 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(4)
    solver = (np.linalg.inv(normal) @ weighted).astype(np.float32)
    t0 = template - (w * template).sum(axis=1, keepdims=True) / total
    tt = (w * t0 * t0).sum(axis=1)
    for _ in range(_ROUNDS):
        where = pixels[:, None].astype(np.float32) + relative
        seen = cv2.remap(
            picture, where[..., 0], where[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        answer = (solver @ seen[..., None])[..., 0].astype(float)
        step = -answer[:, :2] / np.maximum(answer[:, 2:3], 1.0)
        length = np.hypot(*step.T)
        step *= np.minimum(1.0, 0.15 * side / np.maximum(length, 1e-12))[:, None]
        pixels += step
        if length.max(initial=0.0) < stop_px:
            break
    s0 = seen - (w * seen).sum(axis=1, keepdims=True) / total
    ss, ts = (w * s0 * s0).sum(axis=1), (w * t0 * s0).sum(axis=1)
    likeness = ts / np.sqrt(np.maximum(tt * ss, 1e-9))
    contrast = np.sqrt(ss / total[:, 0])
    strayed = np.hypot(*(pixels - start).T) > 0.35 * side
    good = (likeness > _MIN_LIKENESS) & (contrast > 5.0) & ~strayed & (side > 4.0)
    return pixels, good, side


def _softened(
    gray: NDArray[np.uint8], sigma_px: float, spacing_px: float, mapped: _Map, spec: BoardSpec
) -> tuple[Image, float]:
    """The picture, so blurred around the board that samples this far apart miss nothing, and its blur."""
    picture = gray.astype(np.float32)
    wanted = 0.7 * spacing_px
    if wanted <= sigma_px:
        return picture, sigma_px
    at = mapped(spec.outline_m[:, :2])
    low = np.clip(np.floor(at.min(axis=0)) - 8, 0, None).astype(int)
    high = np.ceil(at.max(axis=0)).astype(int) + 8
    part = (slice(low[1], max(high[1], low[1] + 1)), slice(low[0], max(high[0], low[0] + 1)))
    if picture[part].size:
        picture[part] = cv2.GaussianBlur(picture[part], (0, 0), float(np.sqrt(wanted**2 - sigma_px**2)))
    return picture, wanted


def _relative(mapped: _Map, plane: FloatArray, square: float, steps: FloatArray) -> Image:
    """Pixels (k, n, 2) of a window's samples relative to its corner, interpolated from nine of them."""
    knots = np.array([-_REACH, 0.0, _REACH])
    places = np.stack(np.meshgrid(knots, knots), axis=-1).reshape(-1, 2) * square
    at = mapped(plane[:, None] + places)
    at = at - at[:, 4:5]
    t = steps / _REACH
    lagrange = np.stack([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2], axis=1)
    weights = np.einsum("yi,xj->yxij", lagrange, lagrange).reshape(len(steps) ** 2, 9)
    return np.asarray(np.einsum("nj,kjc->knc", weights, at, optimize=True), np.float32)


def _agree(
    plane: FloatArray, pixels: FloatArray, good: NDArray[np.bool_], side: FloatArray
) -> NDArray[np.bool_]:
    """Whether corners (k,) lie where their neighbours say: a finger or a fold is no corner."""
    numbers = np.flatnonzero(good).astype(np.int64)
    if len(numbers) < 8:
        return good
    mapped = _Map(plane, numbers, pixels[numbers])
    if mapped.homography is None:
        return good
    off = np.hypot(*(mapped(plane) - pixels).T)
    return np.asarray(off < np.maximum(6.0 * float(np.median(off[numbers])), 0.02 * side + 0.15))


def edge_rise(gray: NDArray[np.uint8], mapped: _Map, plane: FloatArray, square_m: float) -> float:
    """Median width in pixels (contrast over steepest slope) of the edges between squares, beside corners."""
    rises: list[float] = []
    share = np.linspace(-0.11, 0.11, 45)
    for along, across in (((1.0, 0.0), (0.0, 1.0)), ((0.0, 1.0), (1.0, 0.0))):
        middle = plane + np.multiply(along, 0.5 * square_m)
        line = middle[:, None] + share[None, :, None] * np.multiply(across, square_m)
        p = mapped(line).astype(np.float32)
        # An eighth of a square of white beside every edge: what lies farther is the marker.
        profile = cv2.remap(
            gray.astype(np.float32), p[..., 0], p[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        reach = np.hypot(*(p[:, -1] - p[:, 0]).T) / (len(share) - 1)
        slope = np.abs(profile[:, 4:] - profile[:, :-4]) / np.maximum(4 * reach[:, None], 1e-6)
        contrast = profile.max(axis=1) - profile.min(axis=1)
        clear = contrast > 15
        rises.extend((contrast / np.maximum(slope.max(axis=1), 1e-3))[clear])
    return float(np.median(rises)) if rises else float("inf")
