"""Compiled loops over the pixels around a hand. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

EVEN, SMOOTH = 1, 2
"""Marks of a pixel: not steeper than skin may be; not even doubtful."""


@njit(cache=True, nogil=True)
def within_reach(
    depth: NDArray[np.float64],
    left: int,
    top: int,
    lens: tuple[float, float, float, float],
    centre: NDArray[np.float64],
    reach_m: float,
    out: NDArray[np.float32],
) -> None:
    """Copy a crop that begins at (left, top), 0 where the place is farther than ``reach_m`` from ``centre``.

    A lens's distortion hardly matters here.
    """
    fx, fy, cx, cy = lens
    most = reach_m * reach_m
    for row in range(out.shape[0]):
        y = (row + top - cy) / fy
        for column in range(out.shape[1]):
            z = depth[row + top, column + left]
            dz = z - centre[2]
            out[row, column] = 0.0
            if abs(dz) < reach_m:
                dx = z * ((column + left - cx) / fx) - centre[0]
                dy = z * y - centre[1]
                if dx * dx + dy * dy + dz * dz < most:
                    out[row, column] = z


@njit(cache=True, nogil=True)
def mark_slopes(
    smooth: NDArray[np.float32], steep: float, doubtful: float, noise: float, noise_from_m: float
) -> NDArray[np.uint8]:
    """`EVEN` and `SMOOTH` marks (h, w): how much the depth changes one pixel each way.

    ``steep`` and ``doubtful`` are changes over two pixels in parts of the depth; ``noise`` is what is noise
    at ``noise_from_m`` and nearer, growing with the square of the distance.
    """
    height, width = smooth.shape
    out = np.zeros((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            z = smooth[y, x]
            if z <= 0.0:
                continue
            low, high = z, z
            for j in range(max(y - 1, 0), min(y + 2, height)):
                for i in range(max(x - 1, 0), min(x + 2, width)):
                    other = smooth[j, i]
                    if other > 0.0:
                        low, high = min(low, other), max(high, other)
            least = noise * (max(z, noise_from_m) / noise_from_m) ** 2
            change = high - low
            if change < max(steep * z, least):
                out[y, x] = EVEN | SMOOTH if change < max(doubtful * z, least) else EVEN
    return out


@njit(cache=True, nogil=True)
def flood(
    marks: NDArray[np.uint8], mark: int, starts: NDArray[np.int64], out: NDArray[np.bool_]
) -> tuple[int, int, int, int, int]:
    """Set ``out`` where 4-neighbours with a mark are reached from pixels ``starts`` (k, 2) (u, v).

    Returns the number of pixels and their box: left, top, right, bottom (beyond the last).
    """
    height, width = marks.shape
    stack = np.empty(height * width, np.int32)
    n, count = 0, 0
    left, top, right, bottom = width, height, 0, 0
    for k in range(len(starts)):
        x, y = starts[k, 0], starts[k, 1]
        if marks[y, x] & mark and not out[y, x]:
            out[y, x] = True
            stack[n] = y * width + x
            n += 1
    while n > 0:
        n -= 1
        count += 1
        y, x = stack[n] // width, stack[n] % width
        left, right = min(left, x), max(right, x + 1)
        top, bottom = min(top, y), max(bottom, y + 1)
        for k in range(4):
            j, i = y + (k == 0) - (k == 1), x + (k == 2) - (k == 3)
            inside = 0 <= j < height and 0 <= i < width
            if inside and marks[j, i] & mark and not out[j, i]:
                out[j, i] = True
                stack[n] = j * width + i
                n += 1
    return count, left, top, right, bottom


@njit(cache=True, nogil=True)
def give_back_rim(
    mask: NDArray[np.bool_],
    foreign: NDArray[np.bool_],
    depth: NDArray[np.float32],
    steep: float,
    noise: float,
    rounds: int,
) -> None:
    """Add to a mask, in place, pixels beside it at its own depth; never foreign ones."""
    height, width = mask.shape
    added = np.empty((height * width, 2), np.int32)
    for _ in range(rounds):
        n = 0
        for y in range(height):
            for x in range(width):
                z = depth[y, x]
                if mask[y, x] or foreign[y, x] or z <= 0.0:
                    continue
                step = max(steep * z, noise)
                near = False
                for j in range(max(y - 1, 0), min(y + 2, height)):
                    for i in range(max(x - 1, 0), min(x + 2, width)):
                        near = near or (mask[j, i] and abs(depth[j, i] - z) < step)
                if near:
                    added[n, 0], added[n, 1] = y, x
                    n += 1
        for k in range(n):
            mask[added[k, 0], added[k, 1]] = True


@njit(cache=True, nogil=True)
def directions_at_rim(
    mask: NDArray[np.bool_],
    depth: NDArray[np.float32],
    lens: tuple[float, float, float, float],
    centre: NDArray[np.float64],
    nearest_m: float,
    bins: int,
) -> NDArray[np.int64]:
    """How many pixels (bins,) farther than ``nearest_m`` from the middle lie in each direction."""
    fx, fy, cx, cy = lens
    counts = np.zeros(bins, np.int64)
    for y in range(0, mask.shape[0], 2):
        for x in range(0, mask.shape[1], 2):
            if not mask[y, x]:
                continue
            z = np.float64(depth[y, x])
            px, py = z * (x - cx) / fx - centre[0], z * (y - cy) / fy - centre[1]
            if px * px + py * py + (z - centre[2]) ** 2 > nearest_m * nearest_m:
                turn = np.arctan2(py, px) / (2.0 * np.pi) + 0.5
                counts[min(int(turn * bins), bins - 1)] += 1
    return counts
