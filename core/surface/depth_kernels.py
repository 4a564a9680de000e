"""Compiled loops over depth images. Imported only when used: numba is slow to load."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def fuse_frames(
    frames: NDArray[np.uint16],
    gate: int,
    least: int,
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
    first_row: int,
    last_row: int,
) -> None:
    """Robust mean and standard deviation of each pixel over the frames, in raw units.

    Values within ``gate`` of the median count; a pixel needs ``least`` of them. The median is found by
    bisection on the value, a whole row at a time: every inner loop is free of branches and runs in vector
    instructions.
    """
    n, _, width = frames.shape
    for row in range(first_row, last_row):
        low = np.full(width, 65535, np.uint16)
        high = np.zeros(width, np.uint16)
        zeros = np.zeros(width, np.uint16)
        for k in range(n):
            values = frames[k, row]
            for x in range(width):
                value = values[x]
                zeros[x] += np.uint16(value == 0)
                low[x] = min(low[x], value if value > 0 else np.uint16(65535))
                high[x] = max(high[x], value)
        half = np.empty(width, np.uint16)
        widest = 0
        for x in range(width):
            half[x] = zeros[x] + (n - zeros[x] + 1) // 2
            if zeros[x] < n:
                widest = max(widest, int(high[x]) - int(low[x]))
            else:
                low[x] = 0
        middle = np.empty(width, np.uint16)
        below = np.empty(width, np.uint16)
        while widest > 0:
            widest //= 2
            for x in range(width):
                middle[x] = (np.uint32(low[x]) + np.uint32(high[x])) >> 1
                below[x] = 0
            for k in range(n):
                values = frames[k, row]
                for x in range(width):
                    below[x] += np.uint16(values[x] <= middle[x])
            for x in range(width):
                enough = below[x] >= half[x]
                high[x] = middle[x] if enough else high[x]
                low[x] = low[x] if enough else middle[x] + 1
        count = np.zeros(width, np.int32)
        total = np.zeros(width, np.int32)
        squares = np.zeros(width, np.float32)
        for k in range(n):
            values = frames[k, row]
            for x in range(width):
                value = np.int32(values[x])
                away = value - np.int32(low[x])
                away = away if (value > 0) & (abs(away) <= gate) else np.int32(65536)
                count[x] += np.int32(away != 65536)
                total[x] += away if away != 65536 else np.int32(0)
                squares[x] += np.float32(away) * np.float32(away) if away != 65536 else np.float32(0)
        for x in range(width):
            c = count[x]
            good = (c >= least) & (c > 0)
            offset = total[x] / max(c, 1)
            mean[row, x] = low[x] + offset if good else 0.0
            variance = max(squares[x] - offset * total[x], 0.0) / max(c - 1, 1)
            spread[row, x] = np.sqrt(variance) if good and c > 1 else np.nan


@njit(cache=True, nogil=True)
def fit_planes(
    depth: NDArray[np.float32],
    inverse: NDArray[np.float32],
    reference: NDArray[np.float32],
    weights: NDArray[np.float32],
    gate_m: float,
    out: NDArray[np.float64],
    first_row: int,
    last_row: int,
) -> None:
    """Value at each pixel of the plane fitted to the inverse depth around it.

    A plane in space is linear in inverse depth over the image, so the fit has no bias on slopes. Neighbours
    across a depth jump of ``gate_m`` do not count. ``depth`` and ``inverse`` carry a border of ``radius``
    zeros; ``out`` does not. Whole rows are summed tap by tap, so that the inner loop runs in vector
    instructions.
    """
    radius = weights.shape[0] // 2
    width = out.shape[1]
    per_gate = np.float32(1.0 / gate_m)
    one, zero = np.float32(1.0), np.float32(0.0)
    for y in range(first_row, last_row):
        first, last = width, -1
        for x in range(width):
            out[y, x] = 0.0
            if depth[y + radius, x + radius] > 0.0:
                first, last = min(first, x), x
        n = last - first + 1
        if n <= 0:
            continue
        center = reference[y + radius, first + radius : first + radius + n]
        own = depth[y + radius, first + radius : first + radius + n]
        base = inverse[y + radius, first + radius : first + radius + n]
        sums = np.zeros((9, n), np.float32)
        part = np.zeros((5, n), np.float32)
        p0, p1, p2, q0, q1 = part[0], part[1], part[2], part[3], part[4]
        for j in range(2 * radius + 1):
            part[:] = zero
            for i in range(2 * radius + 1):
                dx = np.float32(i - radius)
                dx2 = dx * dx
                weight = weights[j, i]
                z = depth[y + j, first + i : first + i + n]
                q = inverse[y + j, first + i : first + i + n]
                for x in range(n):
                    r = (z[x] - center[x]) * per_gate
                    e = max(one - r * r, zero)
                    w = weight * e * e
                    wq = w * (q[x] - base[x])
                    p0[x] += w
                    p1[x] += w * dx
                    p2[x] += w * dx2
                    q0[x] += wq
                    q1[x] += wq * dx
            dy = np.float32(j - radius)
            for x in range(n):
                sums[0, x] += p0[x]
                sums[1, x] += p1[x]
                sums[2, x] += dy * p0[x]
                sums[3, x] += p2[x]
                sums[4, x] += dy * p1[x]
                sums[5, x] += dy * dy * p0[x]
                sums[6, x] += q0[x]
                sums[7, x] += q1[x]
                sums[8, x] += dy * q0[x]
        for x in range(n):
            z0 = np.float64(center[x])
            if own[x] <= 0.0:
                continue
            s0, sx, sy = np.float64(sums[0, x]), np.float64(sums[1, x]), np.float64(sums[2, x])
            # A little weight on level planes keeps the fit defined where few neighbours are left.
            sxx = np.float64(sums[3, x]) + 0.02 * s0
            sxy = np.float64(sums[4, x])
            syy = np.float64(sums[5, x]) + 0.02 * s0
            c11 = sxx * syy - sxy * sxy
            c12 = sx * syy - sxy * sy
            c13 = sx * sxy - sxx * sy
            shift = (sums[6, x] * c11 - sums[7, x] * c12 + sums[8, x] * c13) / (
                s0 * c11 - sx * c12 + sy * c13
            )
            fitted = base[x] + shift
            sound = fitted > 0.0 and abs(1.0 / fitted - z0) < gate_m
            out[y, first + x] = 1.0 / fitted if sound else own[x]


@njit(cache=True, nogil=True)
def _root(parents: NDArray[np.int32], i: int) -> int:
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True, nogil=True)
def label_components(depth: NDArray[np.float64], jump: NDArray[np.float64]) -> tuple[NDArray[np.int32], int]:
    """Connected parts of a depth image: 8-neighbours that differ by less than ``jump`` at either pixel.

    Returns labels (h, w) from 0, -1 where there is no depth, and their number.
    """
    height, width = depth.shape
    parents = np.arange(height * width).astype(np.int32)
    for y in range(height):
        for x in range(width):
            z = depth[y, x]
            if z <= 0.0:
                continue
            i = y * width + x
            for k in range(4):
                dy, dx = (0, -1) if k == 0 else (-1, k - 2)
                yy, xx = y + dy, x + dx
                if yy < 0 or xx < 0 or xx >= width or depth[yy, xx] <= 0.0:
                    continue
                if abs(depth[yy, xx] - z) < max(jump[y, x], jump[yy, xx]):
                    a, b = _root(parents, i), _root(parents, yy * width + xx)
                    if a != b:
                        parents[max(a, b)] = min(a, b)
    labels = np.full((height, width), -1, np.int32)
    count = 0
    for y in range(height):
        for x in range(width):
            if depth[y, x] > 0.0:
                i = y * width + x
                r = _root(parents, i)
                if r == i:
                    labels[y, x] = count
                    count += 1
                else:
                    labels[y, x] = labels[r // width, r % width]
    return labels, count


@njit(cache=True, nogil=True)
def measure_parts(
    labels: NDArray[np.int32], points: NDArray[np.float64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Per part the number of pixels, and rows of sum(z^2), sum(x y z), low (x y z), high (x y z)."""
    pixels = np.zeros(count, np.int64)
    measures = np.zeros((count, 10))
    measures[:, 4:7] = np.inf
    measures[:, 7:10] = -np.inf
    height, width = labels.shape
    for y in range(height):
        for x in range(width):
            part = labels[y, x]
            if part < 0:
                continue
            pixels[part] += 1
            measures[part, 0] += points[y, x, 2] * points[y, x, 2]
            for k in range(3):
                value = points[y, x, k]
                measures[part, 1 + k] += value
                measures[part, 4 + k] = min(measures[part, 4 + k], value)
                measures[part, 7 + k] = max(measures[part, 7 + k], value)
    return pixels, measures
