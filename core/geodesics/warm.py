"""Compile every kernel, or load it from the cache, before the first click needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.geodesics.meshes import FloatArray, IntArray
from core.geodesics.registry import GEODESIC_METHODS, geodesic_solver, grid_solver
from core.surface.points import SurfacePoint


@dataclass(frozen=True, eq=False)
class _Patch:
    """A small flat depth grid."""

    vertices: FloatArray
    triangles: IntArray
    pixels: IntArray


def _patch(side: int = 6) -> _Patch:
    v, u = np.divmod(np.arange(side * side), side)
    vertices = np.stack([u, v, np.ones(side * side)], axis=1).astype(np.float64)
    corner = np.flatnonzero((u < side - 1) & (v < side - 1))
    upper = np.stack([corner, corner + 1, corner + side], axis=1)
    lower = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    pixels = np.stack([u, v], axis=1).astype(np.int32)
    return _Patch(vertices, np.vstack([upper, lower]).astype(np.int32), pixels)


def warm_up() -> None:
    """Run every method once, with the types of real use, on a patch of 36 vertices.

    The first run on a machine compiles (seconds); later ones load from the cache. For a background thread.
    """
    patch = _patch()
    target = SurfacePoint(0, np.full(3, 1.0 / 3.0), np.zeros(3))
    sources = [target, *range(15)]
    solvers = [
        geodesic_solver(patch.vertices, patch.triangles, method, pixels=pixels)
        for method in GEODESIC_METHODS
        for pixels in (None, patch.pixels)
    ]
    for solver in [*solvers, grid_solver(patch)]:
        distances = solver.distances(sources)
        solver.path(distances[-1], target)
