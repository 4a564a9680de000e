"""Compiled normal equations of embedded deformation, straight into banded storage. Imported only when used.

Node k turns by a small rotation ``omega_k`` and shifts by ``t_k``. A place ``y = sum_k w_k (R_k (p - g_k) +
x_k)`` then moves by ``sum_k w_k (omega_k x a_k + t_k)`` with ``a_k = R_k (p - g_k)``. The matrix keeps its
lower half as ``band[i - j, j]``, six unknowns per node; it is 95 % zeros outside the band.
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
def turn_normals(
    normals: FloatArray, carriers: IntArray, weights: FloatArray, rotation: FloatArray
) -> FloatArray:
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
def _add_rows(
    jacobian: FloatArray,
    residual: FloatArray,
    weight: float,
    i: int,
    j: int,
    band: FloatArray,
    right: FloatArray,
) -> None:
    """Add ``weight |J (u_i, u_j) + residual|^2`` for three rows over the unknowns of two nodes, J (3, 12)."""
    for k in range(12):
        row = 6 * i + k if k < 6 else 6 * j + k - 6
        x, y, z = jacobian[0, k], jacobian[1, k], jacobian[2, k]
        right[row] -= weight * (x * residual[0] + y * residual[1] + z * residual[2])
        for m in range(12):
            column = 6 * i + m if m < 6 else 6 * j + m - 6
            if column <= row:
                band[row - column, column] += weight * (
                    x * jacobian[0, m] + y * jacobian[1, m] + z * jacobian[2, m]
                )


@njit(cache=True, nogil=True)
def _rotation_vector(one: FloatArray, two: FloatArray, out: FloatArray) -> None:
    """Rotation vector of ``one two^T``, exact enough to a right angle."""
    trace = 0.0
    for c in range(3):
        out[c] = 0.0
    for k in range(3):
        trace += one[0, k] * two[0, k] + one[1, k] * two[1, k] + one[2, k] * two[2, k]
        out[0] += one[2, k] * two[1, k] - one[1, k] * two[2, k]
        out[1] += one[0, k] * two[2, k] - one[2, k] * two[0, k]
        out[2] += one[1, k] * two[0, k] - one[0, k] * two[1, k]
    angle = np.arccos(min(1.0, max(-1.0, 0.5 * (trace - 1.0))))
    sine = np.sin(angle)
    share = 0.5 * angle / sine if sine > 1e-4 else 0.5
    for c in range(3):
        out[c] *= share


@njit(cache=True, nogil=True)
def add_stiffness(
    edges: IntArray,
    weight: float,
    slip_m: float,
    turning: float,
    rotation: FloatArray,
    start: FloatArray,
    node_rest: FloatArray,
    node_now: FloatArray,
    band: FloatArray,
    right: FloatArray,
) -> None:
    """Add ``weight sum_ij phi_ij |(R_i + R_j) / 2 (g_j - g_i) + x_i - x_j|^2`` and a resistance to turning.

    An edge over a bent elbow is half of the upper arm and half of the forearm: with the mean of both
    rotations a bend costs nothing, where the one-sided form (Sumner 2007) must break the edge. ``phi = 1 /
    (1 + |residual|^2 / slip^2)^2`` lets go of edges that are stretched nevertheless. What a node turns
    beyond the skeleton's turn ``start`` should be what its neighbours turn: ``weight turning |log S_i
    S_j^T|^2`` with ``S = R start^T`` keeps a limb from rolling about its axis, which no surface of its
    shape would resist.
    """
    jacobian = np.zeros((3, 12))
    residual = np.empty(3)
    a, b = np.empty(3), np.empty(3)
    one, two = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        square = 0.0
        for k in range(3):
            a[k] = b[k] = 0.0
            for m in range(3):
                d = 0.5 * (node_rest[j, m] - node_rest[i, m])
                a[k] += rotation[i, k, m] * d
                b[k] += rotation[j, k, m] * d
            residual[k] = a[k] + b[k] + node_now[i, k] - node_now[j, k]
            square += residual[k] * residual[k]
        jacobian[:, :] = 0.0
        jacobian[0, 1], jacobian[0, 2] = a[2], -a[1]
        jacobian[1, 0], jacobian[1, 2] = -a[2], a[0]
        jacobian[2, 0], jacobian[2, 1] = a[1], -a[0]
        jacobian[0, 7], jacobian[0, 8] = b[2], -b[1]
        jacobian[1, 6], jacobian[1, 8] = -b[2], b[0]
        jacobian[2, 6], jacobian[2, 7] = b[1], -b[0]
        for k in range(3):
            jacobian[k, 3 + k], jacobian[k, 9 + k] = 1.0, -1.0
        phi = 1.0 / (1.0 + square / (slip_m * slip_m)) ** 2
        _add_rows(jacobian, residual, weight * phi, i, j, band, right)
        for r in range(3):
            for k in range(3):
                one[r, k] = two[r, k] = 0.0
                for m in range(3):
                    one[r, k] += rotation[i, r, m] * start[i, k, m]
                    two[r, k] += rotation[j, r, m] * start[j, k, m]
        _rotation_vector(one, two, residual)
        jacobian[:, :] = 0.0
        for k in range(3):
            jacobian[k, k], jacobian[k, 6 + k] = 1.0, -1.0
        _add_rows(jacobian, residual, weight * turning, i, j, band, right)


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
