"""What a geodesic solver asks of a surface, and the checks of a triangle mesh before any kernel sees it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from core.surface.points import SurfacePoint

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

Source = SurfacePoint | int
"""A place distances start from: a point inside a triangle, or the number of a vertex."""


class TriangleSurface(Protocol):
    """A surface made of triangles, as `core.surface.BodySurface` is."""

    @property
    def vertices(self) -> FloatArray:
        """Positions (n, 3), metres."""

    @property
    def triangles(self) -> IntArray:
        """Corner numbers (m, 3)."""


class DepthGridSurface(TriangleSurface, Protocol):
    """A surface whose vertices are pixels of a depth image."""

    @property
    def pixels(self) -> IntArray:
        """Column and row (u, v) of every vertex (n, 2)."""


def checked_mesh(vertices: ArrayLike, triangles: ArrayLike) -> tuple[FloatArray, IntArray]:
    """Copy a mesh into the arrays that the kernels take, refusing what cannot be a mesh.

    Degenerate, duplicated and non-manifold triangles and isolated vertices are allowed.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions, any unit.
    triangles : array (m, 3)
        Vertex numbers, 0-based.

    Returns
    -------
    vertices : ndarray (n, 3) float64
    triangles : ndarray (m, 3) int32

    Raises
    ------
    InputError
        Wrong shapes, positions that are not finite, or vertex numbers that do not exist.
    """
    places = np.array(vertices, dtype=np.float64, order="C")
    if places.size == 0:
        places = places.reshape(0, 3)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(f"Mesh vertices have shape {places.shape}, not (n, 3).")
    corners = np.asarray(triangles)
    if corners.size == 0:
        corners = np.zeros((0, 3), dtype=np.int32)
    if corners.ndim != 2 or corners.shape[1] != 3:
        raise InputError(f"Mesh triangles have shape {corners.shape}, not (m, 3).")
    if not np.issubdtype(corners.dtype, np.integer):
        raise InputError(f"Mesh triangles are {corners.dtype}, not whole numbers.")
    if not np.isfinite(places).all():
        bad = int(np.flatnonzero(~np.isfinite(places).all(axis=1))[0])
        raise InputError(f"Mesh vertex {bad} has a coordinate that is not a finite number.")
    if len(corners) and (corners.min() < 0 or corners.max() >= len(places)):
        bad = int(np.flatnonzero(((corners < 0) | (corners >= len(places))).any(axis=1))[0])
        raise InputError(
            f"Mesh triangle {bad} names a vertex that does not exist "
            f"({corners[bad].tolist()} of {len(places)} vertices)."
        )
    return places, np.array(corners, dtype=np.int32, order="C")


def seed_sources(
    vertices: FloatArray, triangles: IntArray, sources: Sequence[Source]
) -> tuple[IntArray, FloatArray]:
    """Turn sources into starting values at vertices.

    A vertex starts at distance zero; a point inside a triangle starts the triangle's three corners at their
    straight distances, which are exact because a triangle is flat.

    Returns
    -------
    seeds : ndarray (s, 3) int32
        Starting vertices (a vertex source is repeated).
    starts : ndarray (s, 3) float64
        Their distances to the source.
    """
    seeds = np.zeros((len(sources), 3), dtype=np.int32)
    starts = np.zeros((len(sources), 3), dtype=np.float64)
    for row, source in enumerate(sources):
        if isinstance(source, SurfacePoint):
            corners, weights = checked_point(triangles, source, f"Source {row}")
            place = weights @ vertices[corners]
            seeds[row] = corners
            starts[row] = np.linalg.norm(vertices[corners] - place, axis=1)
        else:
            if not 0 <= int(source) < len(vertices):
                raise InputError(
                    f"Source {row} is vertex {int(source)}, but the mesh has only {len(vertices)} vertices."
                )
            seeds[row] = int(source)
    return seeds, starts


def checked_point(triangles: IntArray, point: SurfacePoint, name: str) -> tuple[IntArray, FloatArray]:
    """Corners (3,) and clean weights (3,) of a surface point, refusing one that is not on this mesh."""
    if not 0 <= int(point.triangle) < len(triangles):
        raise InputError(f"{name} lies in triangle {int(point.triangle)}, but the mesh has {len(triangles)}.")
    weights = np.asarray(point.barycentric, dtype=np.float64).reshape(-1)
    if weights.shape != (3,) or not np.isfinite(weights).all() or abs(weights.sum() - 1.0) > 1e-6:
        raise InputError(f"{name} has barycentric weights {weights.tolist()} that do not sum to 1.")
    if weights.min() < -1e-6:
        raise InputError(f"{name} lies outside its triangle (weights {weights.tolist()}).")
    weights = np.clip(weights, 0.0, None)
    return triangles[int(point.triangle)], weights / weights.sum()
