"""Compiled normal equations of embedded deformation, straight into banded storage. Imported only when used.

Node k turns by a small rotation ``omega_k`` and shifts by ``t_k``. A place ``y = sum_k w_k (R_k (p - g_k) +
x_k)`` then moves by ``sum_k w_k (omega_k x a_k + t_k)`` with ``a_k = R_k (p - g_k)``. The matrix keeps its lower
half as ``band[i - j, j]``, six unknowns per node; it is 95 % zeros outside the band.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@njit(cache=True, nogil=True)
def warp_places(
    rest: FloatArray,
    carriers: IntArray,
    weights: FloatArray,
    rotation: FloatArray,
    node_rest: FloatArray,
    node_now: FloatArray,
) -> FloatArray:
    """Where the nodes carry places (k, 3) of the rest skin."""
    out = np.zeros((len(rest), 3))
    for i in range(len(rest)):
        for c in range(carriers.shape[1]):
            w = weights[i, c]
            if w == 0.0:
                continue
            n = carriers[i, c]
            for r in range(3):
                total = node_now[n, r]
                for k in range(3):
                    total += rotation[n, r, k] * (rest[i, k] - node_rest[n, k])
                out[i, r] += w * total
    return out


@njit(cache=True, nogil=True)
def turn_normals(normals: FloatArray, carriers: IntArray, weights: FloatArray, rotation: FloatArray) -> FloatArray:
    """Unit normals (k, 3) turned by the weighted rotations of their nodes."""
    out = np.zeros((len(normals), 3))
    for i in range(len(normals)):
        for c in range(carriers.shape[1]):
            n = carriers[i, c]
            for r in range(3):
                for k in range(3):
                    out[i, r] += weights[i, c] * rotation[n, r, k] * normals[i, k]
        size = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        if size > 1e-12:
            for r in range(3):
                out[i, r] /= size
    return out


@njit(cache=True, nogil=True)
def add_places(
    rest: FloatArray,
    carriers: IntArray,
    weights: FloatArray,
    normal: FloatArray,
    target: FloatArray,
    along_normal: FloatArray,
    isotropic: FloatArray,
    rotation: FloatArray,
    node_rest: FloatArray,
    node_now: FloatArray,
    band: FloatArray,
    right: FloatArray,
) -> None:
    """Add ``sum_i along_normal_i (n_i . r_i)^2 + isotropic_i |r_i|^2`` with ``r_i = y_i - target_i``."""
    count = carriers.shape[1]
    jacobian = np.empty((count, 3, 6))
    weighted = np.empty((count, 3, 6))
    residual = np.empty(3)
    for i in range(len(rest)):
        wn, wt = along_normal[i], isotropic[i]
        if wn == 0.0 and wt == 0.0:
            continue
        for r in range(3):
            residual[r] = -target[i, r]
        for c in range(count):
            w, n = weights[i, c], carriers[i, c]
            ax = ay = az = 0.0
            for k in range(3):
                d = rest[i, k] - node_rest[n, k]
                ax += rotation[n, 0, k] * d
                ay += rotation[n, 1, k] * d
                az += rotation[n, 2, k] * d
            residual[0] += w * (ax + node_now[n, 0])
            residual[1] += w * (ay + node_now[n, 1])
            residual[2] += w * (az + node_now[n, 2])
            j = jacobian[c]
            j[:, :] = 0.0
            j[0, 1], j[0, 2] = w * az, -w * ay
            j[1, 0], j[1, 2] = -w * az, w * ax
            j[2, 0], j[2, 1] = w * ay, -w * ax
            j[0, 3] = j[1, 4] = j[2, 5] = w
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        for c in range(count):
            for k in range(6):
                x, y, z = jacobian[c, 0, k], jacobian[c, 1, k], jacobian[c, 2, k]
                s = wn * (nx * x + ny * y + nz * z)
                weighted[c, 0, k] = s * nx + wt * x
                weighted[c, 1, k] = s * ny + wt * y
                weighted[c, 2, k] = s * nz + wt * z
        for c in range(count):
            if weights[i, c] == 0.0:
                continue
            row = 6 * carriers[i, c]
            for k in range(6):
                right[row + k] -= (
                    weighted[c, 0, k] * residual[0]
                    + weighted[c, 1, k] * residual[1]
                    + weighted[c, 2, k] * residual[2]
                )
            for e in range(count):
                column = 6 * carriers[i, e]
                if column > row or weights[i, e] == 0.0:
                    continue
                for k in range(6):
                    x, y, z = jacobian[c, 0, k], jacobian[c, 1, k], jacobian[c, 2, k]
                    last = k + 1 if column == row else 6
                    for m in range(last):
                        band[row + k - column - m, column + m] += (
                            x * weighted[e, 0, m] + y * weighted[e, 1, m] + z * weighted[e, 2, m]
                        )


@njit(cache=True, nogil=True)
def add_stiffness(
    edges: IntArray,
    share: FloatArray,
    weight: float,
    slip_m: float,
    rotation: FloatArray,
    node_rest: FloatArray,
    node_now: FloatArray,
    band: FloatArray,
    right: FloatArray,
) -> None:
    """Add ``weight sum_ij share_ij phi_ij |R_i (g_j - g_i) + x_i - x_j|^2``, as rigid as possible.

    ``phi = 1 / (1 + |residual|^2 / slip^2)^2`` lets an edge go that is stretched much: the robust form without
    which raised arms snap back (METHOD section 3).
    """
    a = np.empty(3)
    r = np.empty(3)
    skew = np.zeros((3, 3))
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        square = 0.0
        for k in range(3):
            a[k] = 0.0
            for m in range(3):
                a[k] += rotation[i, k, m] * (node_rest[j, m] - node_rest[i, m])
            r[k] = a[k] + node_now[i, k] - node_now[j, k]
            square += r[k] * r[k]
        w = weight * share[e] / (1.0 + square / (slip_m * slip_m)) ** 2
        # residual changes by omega x a + t_i - t_j; skew maps omega to omega x a
        skew[0, 1], skew[0, 2] = a[2], -a[1]
        skew[1, 0], skew[1, 2] = -a[2], a[0]
        skew[2, 0], skew[2, 1] = a[1], -a[0]
        one, two = 6 * i, 6 * j
        for k in range(3):
            s = skew[0, k] * r[0] + skew[1, k] * r[1] + skew[2, k] * r[2]
            right[one + k] -= w * s
            right[one + 3 + k] -= w * r[k]
            right[two + 3 + k] += w * r[k]
            band[0, one + 3 + k] += w
            band[0, two + 3 + k] += w
            for m in range(k + 1):
                band[k - m, one + m] += w * (
                    skew[0, k] * skew[0, m] + skew[1, k] * skew[1, m] + skew[2, k] * skew[2, m]
                )
            for m in range(3):
                # rows t_i (3 + k), columns omega_i (m)
                band[3 + k - m, one + m] += w * skew[k, m]
                # rows or columns t_j against omega_i
                p, q = two + 3 + k, one + m
                if p > q:
                    band[p - q, q] -= w * skew[k, m]
                else:
                    band[q - p, p] -= w * skew[k, m]
            p, q = two + 3 + k, one + 3 + k
            if p > q:
                band[p - q, q] -= w
            else:
                band[q - p, p] -= w


@njit(cache=True, nogil=True)
def apply_step(step: FloatArray, rotation: FloatArray, node_now: FloatArray) -> None:
    """Turn and shift the nodes by a solution (6 m,), in place."""
    turn = np.empty((3, 3))
    old = np.empty((3, 3))
    for n in range(len(rotation)):
        x, y, z = step[6 * n], step[6 * n + 1], step[6 * n + 2]
        angle = np.sqrt(x * x + y * y + z * z)
        s = 1.0 - angle * angle / 6.0 if angle < 1e-4 else np.sin(angle) / angle
        c = 0.5 - angle * angle / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / (angle * angle)
        turn[0, 0], turn[1, 1], turn[2, 2] = (
            1.0 - c * (y * y + z * z),
            1.0 - c * (x * x + z * z),
            1.0 - c * (x * x + y * y),
        )
        turn[0, 1], turn[1, 0] = c * x * y - s * z, c * x * y + s * z
        turn[0, 2], turn[2, 0] = c * x * z + s * y, c * x * z - s * y
        turn[1, 2], turn[2, 1] = c * y * z - s * x, c * y * z + s * x
        old[:, :] = rotation[n]
        for r in range(3):
            for k in range(3):
                rotation[n, r, k] = turn[r, 0] * old[0, k] + turn[r, 1] * old[1, k] + turn[r, 2] * old[2, k]
            node_now[n, r] += step[6 * n + 3 + r]
