"""Compiled loops of trilateration: cost of every vertex, areas of the skin. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]

_BLOCK = 512
# Logarithms are taken of products of so many terms: single precision holds them.
_PRODUCT = 16


@njit(cache=True, nogil=True)
def sum_costs(
    distances: SingleArray,
    rows: NDArray[np.int64],
    targets: SingleArray,
    scales: SingleArray,
    limit: np.float32,
    unknown: np.float32,
    cost: SingleArray,
    reached: NDArray[np.bool_],
) -> None:
    """Cost (n,) of every vertex by the anchors ``rows``, and whether one of them reaches it (n,).

    ``distances`` (a, n); ``targets`` and ``scales`` belong to ``rows``. Residuals are cut at ``limit`` and
    are ``unknown`` where a distance is NaN. Blocks of vertices stay in the cache while the anchors go by.
    """
    n = distances.shape[1]
    one, four = np.float32(1.0), np.float32(4.0)
    product = np.empty(_BLOCK, np.float32)
    nearest = np.empty(_BLOCK, np.float32)
    for first in range(0, n, _BLOCK):
        last = min(first + _BLOCK, n)
        for x in range(first, last):
            cost[x] = 0.0
        nearest[:] = np.inf
        for start in range(0, len(rows), _PRODUCT):
            product[:] = one
            for k in range(start, min(start + _PRODUCT, len(rows))):
                target, scale = targets[k], scales[k]
                values = distances[rows[k], first:last]
                for x in range(last - first):
                    away = abs(values[x] - target) * scale
                    cut = away if away < limit else limit
                    cut = cut if away == away else unknown
                    product[x] *= one + cut * cut
                    nearest[x] = away if away < nearest[x] else nearest[x]
            for x in range(first, last):
                cost[x] += np.log(product[x - first])
        for x in range(first, last):
            cost[x] *= four
            reached[x] = nearest[x - first] < np.inf


@njit(cache=True, nogil=True)
def place_costs(vertices: FloatArray, place: FloatArray, per_square: float, cost: SingleArray) -> None:
    """``4 ln(1 + per_square |vertex - place|^2)`` of every vertex (n,)."""
    x, y, z = place[0], place[1], place[2]
    for i in range(len(vertices)):
        dx, dy, dz = vertices[i, 0] - x, vertices[i, 1] - y, vertices[i, 2] - z
        cost[i] = np.float32(4.0) * np.log(np.float32(1.0 + per_square * (dx * dx + dy * dy + dz * dz)))


@njit(cache=True, nogil=True)
def sum_areas(vertices: FloatArray, triangles: NDArray[np.int32], areas: FloatArray) -> None:
    """Add a third of every triangle's area to its corners' entries of ``areas`` (n,)."""
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        px, py, pz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        qx, qy, qz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        share = np.sqrt(x * x + y * y + z * z) / 6.0
        areas[a] += share
        areas[b] += share
        areas[c] += share
