"""Compiled loops over the sides of a marker. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_TERMS = 4
_SPAN = 13
_EVEN = 3


@njit(cache=True, nogil=True)
def _brightness(gray: NDArray[np.uint8], x: float, y: float) -> float:
    """Between the four pixels around (x, y); those beyond the picture's rim repeat the rim."""
    height, width = gray.shape
    x = min(max(x, 0.0), width - 1.001)
    y = min(max(y, 0.0), height - 1.001)
    u, v = int(x), int(y)
    a, b = x - u, y - v
    top = (1.0 - a) * gray[v, u] + a * gray[v, u + 1]
    below = (1.0 - a) * gray[v + 1, u] + a * gray[v + 1, u + 1]
    return float((1.0 - b) * top + b * below)


@njit(cache=True, nogil=True)
def _locate_side(
    gray: NDArray[np.uint8],
    start: NDArray[np.float64],
    along: NDArray[np.float64],
    outward: NDArray[np.float64],
    shares: NDArray[np.float64],
    reach_px: float,
    least_contrast: float,
) -> NDArray[np.float64]:
    """Way outward (n,) in pixels at which a side goes half from black to white; NaN where it does not.

    The side is looked at in the places ``start + share * along``, ``reach_px`` inward and outward.
    """
    n = len(shares)
    profile = np.empty((n, _SPAN))
    step = 2.0 * reach_px / (_SPAN - 1)
    for i in range(n):
        x = start[0] + shares[i] * along[0]
        y = start[1] + shares[i] * along[1]
        for k in range(_SPAN):
            way = k * step - reach_px
            profile[i, k] = _brightness(gray, x + way * outward[0], y + way * outward[1])
    ways = np.empty(n)
    for i in range(n):
        # light changes slowly along a side: the levels of neighbours are put together against noise
        low, high, count = 0.0, 0.0, 0
        for j in range(max(i - _EVEN, 0), min(i + _EVEN + 1, n)):
            low += profile[j, 0] + profile[j, 1] + profile[j, 2]
            high += profile[j, _SPAN - 1] + profile[j, _SPAN - 2] + profile[j, _SPAN - 3]
            count += 3
        ways[i] = np.nan
        if high - low < least_contrast * count:
            continue
        half = 0.5 * (low + high) / count
        for k in range(_SPAN - 1):
            a, b = profile[i, k] - half, profile[i, k + 1] - half
            if a < 0.0 and b >= 0.0:
                way = (k + a / (a - b)) * step - reach_px
                # of several crossings the one nearest to where the side is believed to be
                if np.isnan(ways[i]) or abs(way) < abs(ways[i]):
                    ways[i] = way
    return ways


@njit(cache=True, nogil=True)
def _fit_side(
    shares: NDArray[np.float64], ways: NDArray[np.float64], stiffness: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Coefficients (4,) of the cubic way(share - 1/2) through the measured ones, robust; NaN if too few."""
    out = np.full(_TERMS, np.nan)
    known = 0
    for i in range(len(ways)):
        known += not np.isnan(ways[i])
    if known < 8 or 2 * known < len(ways):
        return out
    weight = np.ones(len(ways))
    away = np.empty(known)
    for _ in range(3):
        matrix = np.diag(stiffness)
        right = np.zeros(_TERMS)
        for i in range(len(ways)):
            if np.isnan(ways[i]):
                continue
            s = shares[i] - 0.5
            row = weight[i]
            for p in range(_TERMS):
                right[p] += row * ways[i]
                entry = row
                for q in range(_TERMS):
                    matrix[p, q] += entry
                    entry *= s
                row *= s
        out = np.linalg.solve(matrix, right)
        k = 0
        for i in range(len(ways)):
            if np.isnan(ways[i]):
                continue
            s = shares[i] - 0.5
            away[k] = abs(ways[i] - (out[0] + s * (out[1] + s * (out[2] + s * out[3]))))
            k += 1
        scale = 3.0 * max(1.5 * float(np.median(away)), 0.05)
        k = 0
        for i in range(len(ways)):
            if not np.isnan(ways[i]):
                weight[i] = 1.0 / (1.0 + (away[k] / scale) ** 2) ** 2
                k += 1
    return out


@njit(cache=True, nogil=True)
def fit_sides(
    gray: NDArray[np.uint8],
    corners: NDArray[np.float64],
    along: NDArray[np.float64],
    outward: NDArray[np.float64],
    shares: NDArray[np.float64],
    reach_px: float,
    least_contrast: float,
    stiffness: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Coefficients (4, 4) of the four sides' ways outward; a NaN among them where one is not made out."""
    out = np.full((4, _TERMS), np.nan)
    for k in range(4):
        ways = _locate_side(gray, corners[k], along[k], outward[k], shares, reach_px, least_contrast)
        out[k] = _fit_side(shares, ways, stiffness)
        if np.isnan(out[k, 0]):
            break
    return out


@njit(cache=True, nogil=True)
def fit_quadric(
    depth: NDArray[np.float64],
    mask: NDArray[np.uint8],
    left: int,
    top: int,
    middle_u: float,
    middle_v: float,
    size_px: float,
    near_m: float,
    gate_m: float,
    least_spread_m: float,
) -> tuple[NDArray[np.float64], float, int]:
    """Robust quadric of inverse depth over the pixels of a mask that lie within ``gate_m`` of ``near_m``.

    ``mask`` begins at pixel (left, top) of ``depth``. Returns the terms (6,) of 1, x, y, x^2, x y, y^2 with
    x = (u - middle) / size, the robust standard deviation in metres, and the number of pixels.
    """
    height, width = mask.shape
    base = np.empty((height * width, 6))
    inverse = np.empty(height * width)
    n = 0
    for row in range(height):
        for column in range(width):
            z = depth[top + row, left + column]
            if mask[row, column] == 0 or z <= 0.0 or abs(z - near_m) > gate_m:
                continue
            x, y = (left + column - middle_u) / size_px, (top + row - middle_v) / size_px
            base[n, 0], base[n, 1], base[n, 2] = 1.0, x, y
            base[n, 3], base[n, 4], base[n, 5] = x * x, x * y, y * y
            inverse[n] = 1.0 / z
            n += 1
    terms: NDArray[np.float64] = np.zeros(6)
    spread = 0.0
    if n < 6:
        return terms, spread, n
    weight, away = np.ones(n), np.empty(n)
    for _ in range(4):
        # curvature is held back by a millionth: only an empty side of the patch feels it
        matrix = np.eye(6) * (1e-6 * n)
        right = np.zeros(6)
        for i in range(n):
            for p in range(6):
                row_weight = weight[i] * base[i, p]
                right[p] += row_weight * inverse[i]
                for q in range(p + 1):
                    matrix[p, q] += row_weight * base[i, q]
        for p in range(6):
            for q in range(p):
                matrix[q, p] = matrix[p, q]
        terms[:] = np.linalg.solve(matrix, right)
        for i in range(n):
            fitted = 0.0
            for p in range(6):
                fitted += base[i, p] * terms[p]
            away[i] = abs(inverse[i] - fitted) * near_m * near_m
        spread = max(1.48 * float(np.median(away)), least_spread_m)
        for i in range(n):
            weight[i] = max(1.0 - (away[i] / (4.0 * spread)) ** 2, 0.0) ** 2
    return terms, spread, n
