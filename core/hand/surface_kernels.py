"""Compiled loops that smooth the hand's depth where a vertex will be. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True, fastmath=True)
def smooth_grid(
    depth: NDArray[np.float32],
    mask: NDArray[np.bool_],
    step: int,
    offset: int,
    weights: NDArray[np.float32],
    gate_m: float,
) -> NDArray[np.float64]:
    """Depth (h', w') at every ``step``-th pixel, from a plane fitted to the inverse depth around it.

    A plane in space is linear in inverse depth over the image, so that slopes get no bias. Pixels beyond the
    mask, and those that differ by more than ``gate_m``, do not count. 0 where the mask is not.
    """
    height, width = depth.shape
    radius = weights.shape[0] // 2
    rows, columns = (height - offset + step - 1) // step, (width - offset + step - 1) // step
    out = np.zeros((rows, columns))
    per_gate = np.float32(1.0 / gate_m)
    one, zero = np.float32(1.0), np.float32(0.0)
    for row in range(rows):
        y = row * step + offset
        top, bottom = max(y - radius, 0), min(y + radius + 1, height)
        for column in range(columns):
            x = column * step + offset
            if not mask[y, x]:
                continue
            own = depth[y, x]
            left, right = max(x - radius, 0), min(x + radius + 1, width)
            reference = own
            for _ in range(2):
                base = one / reference
                s0, sx, sy, sxx, sxy, syy, q0, qx, qy = zero, zero, zero, zero, zero, zero, zero, zero, zero
                for j in range(top, bottom):
                    dy = np.float32(j - y)
                    for i in range(left, right):
                        z = depth[j, i]
                        r = (z - reference) * per_gate
                        e = max(one - r * r, zero)
                        w = weights[j - y + radius, i - x + radius] * e * e if mask[j, i] else zero
                        dx = np.float32(i - x)
                        wq = w * (one / max(z, np.float32(0.05)) - base)
                        s0 += w
                        sx += w * dx
                        sy += w * dy
                        sxx += w * dx * dx
                        sxy += w * dx * dy
                        syy += w * dy * dy
                        q0 += wq
                        qx += wq * dx
                        qy += wq * dy
                # a little weight on level planes keeps the fit defined where few neighbours are left
                a, b = sxx + np.float32(0.02) * s0, syy + np.float32(0.02) * s0
                c11 = a * b - sxy * sxy
                c12 = sx * b - sxy * sy
                c13 = sx * sxy - a * sy
                below = s0 * c11 - sx * c12 + sy * c13
                if below <= zero:
                    break
                fitted = base + (q0 * c11 - qx * c12 + qy * c13) / below
                if fitted <= zero or abs(one / fitted - own) > np.float32(gate_m):
                    break
                reference = one / fitted
            out[row, column] = reference
    return out
