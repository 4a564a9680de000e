"""Rays and nearest points on a depth surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.surface.threads import in_chunks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

_TILE = 4
_CHUNK = 2048


@dataclass(frozen=True, eq=False)
class RayHits:
    """First hits of rays.

    Attributes
    ----------
    hit : ndarray (k,) bool
    t : ndarray (k,)
        Ray parameter: the hit is ``origin + t * direction``; inf without a hit.
    triangle : ndarray (k,) int32
        -1 without a hit.
    barycentric : ndarray (k, 3)
        Weights of the triangle's corners.
    """

    hit: NDArray[np.bool_]
    t: FloatArray
    triangle: IntArray
    barycentric: FloatArray


class GridTree:
    """A pyramid of boxes over the tiles of the depth grid; see `core.surface.tree_kernels`."""

    def __init__(self, vertices: FloatArray, triangles: IntArray, pixels: IntArray) -> None:
        from core.surface.tree_kernels import build_tree

        self._vertices, self._triangles = vertices, triangles
        width, height = (int(pixels[:, k].max()) + 1 if len(pixels) else 1 for k in (0, 1))
        dims = [(-(-height // _TILE), -(-width // _TILE))]
        while dims[-1] != (1, 1):
            dims.append((-(-dims[-1][0] // 2), -(-dims[-1][1] // 2)))
        self._dims = np.array(dims, np.int32)
        self._offsets = np.concatenate([[0], np.cumsum([r * c for r, c in dims])]).astype(np.int32)
        self._tree = build_tree(vertices, triangles, pixels, _TILE, self._dims, self._offsets)

    def cast(self, origin: ArrayLike, directions: ArrayLike) -> RayHits:
        """First hits of rays from ``origin`` (3,) along ``directions`` (k, 3)."""
        from core.surface.tree_kernels import cast_rays

        d = np.ascontiguousarray(np.asarray(directions, dtype=float).reshape(-1, 3))
        o = np.ascontiguousarray(np.asarray(origin, dtype=float).reshape(3))
        t, triangle = np.empty(len(d)), np.empty(len(d), np.int32)
        weights = np.empty((len(d), 3))

        def work(first: int, last: int) -> None:
            k = slice(first, last)
            cast_rays(*self._mesh, o, d[k], t[k], triangle[k], weights[k])

        in_chunks(work, len(d), _CHUNK)
        return RayHits(triangle >= 0, t, triangle, weights)

    def nearest(self, points: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Triangle (k,) and barycentric weights (k, 3) of the surface points nearest to points (k, 3)."""
        from core.surface.tree_kernels import nearest_points

        p = np.ascontiguousarray(np.asarray(points, dtype=float).reshape(-1, 3))
        triangle, weights = np.full(len(p), -1, np.int32), np.zeros((len(p), 3))

        def work(first: int, last: int) -> None:
            k = slice(first, last)
            nearest_points(*self._mesh, p[k], triangle[k], weights[k])

        in_chunks(work, len(p), _CHUNK)
        return triangle, weights

    @property
    def _mesh(self) -> tuple[NDArray[np.generic], ...]:
        return (self._vertices, self._triangles, *self._tree, self._dims, self._offsets)
