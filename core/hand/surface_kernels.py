"""Compiled loops that smooth the hand's depth where a vertex will be. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True, fastmath=True)
def smooth_grid(
    depth: NDArray[np.float32],
    middle: NDArray[np.float32],
    mask: NDArray[np.bool_],
    step: int,
    weights: NDArray[np.float32],
    gate_m: float,
) -> NDArray[np.float64]:
    """Depth (h', w') at every ``step``-th pixel, from a plane fitted to the inverse depth around it.

    A plane in space is linear in inverse depth over the image, so that slopes get no bias. Pixels beyond the
    mask, and those that differ by more than ``gate_m`` from ``middle`` (a depth freed from single errors), do
    not count. 0 where the mask is not.
    """
    height, width = depth.shape
    radius = weights.shape[0] // 2
    rows, columns = (height + step - 1) // step, (width + step - 1) // step
    out = np.zeros((rows, columns))
    per_gate = np.float32(1.0 / gate_m)
    one, zero = np.float32(1.0), np.float32(0.0)
    inverse = np.zeros((height, width), np.float32)
    for y in range(height):
        for x in range(width):
            if mask[y, x]:
                inverse[y, x] = one / depth[y, x]
    for row in range(rows):
        y = row * step
        top, bottom = max(y - radius, 0), min(y + radius + 1, height)
        for column in range(columns):
            x = column * step
            if not mask[y, x]:
                continue
            own = middle[y, x] if middle[y, x] > zero else depth[y, x]
            left, right = max(x - radius, 0), min(x + radius + 1, width)
            base = one / own
            s0, sx, sy, sxx, sxy, syy, q0, qx, qy = zero, zero, zero, zero, zero, zero, zero, zero, zero
            for j in range(top, bottom):
                dy = np.float32(j - y)
                p0, p1, p2, r0, r1 = zero, zero, zero, zero, zero
                for i in range(left, right):
                    q = inverse[j, i]
                    r = (depth[j, i] - own) * per_gate
                    e = max(one - r * r, zero)
                    w = weights[j - y + radius, i - x + radius] * e * e
                    w = w if q > zero else zero
                    dx = np.float32(i - x)
                    wq = w * (q - base)
                    p0 += w
                    p1 += w * dx
                    p2 += w * dx * dx
                    r0 += wq
                    r1 += wq * dx
                s0 += p0
                sx += p1
                sxx += p2
                sy += dy * p0
                sxy += dy * p1
                syy += dy * dy * p0
                q0 += r0
                qx += r1
                qy += dy * r0
            # a little weight on level planes keeps the fit defined where few neighbours are left
            a, b = sxx + np.float32(0.02) * s0, syy + np.float32(0.02) * s0
            c11 = a * b - sxy * sxy
            c12 = sx * b - sxy * sy
            c13 = sx * sxy - a * sy
            below = s0 * c11 - sx * c12 + sy * c13
            fitted = base + (q0 * c11 - qx * c12 + qy * c13) / below if below > zero else base
            sound = fitted > zero and abs(one / fitted - own) < np.float32(gate_m)
            out[row, column] = one / fitted if sound else own
    return out
