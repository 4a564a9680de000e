"""Distance fields of named anchors over one surface, and their values between the vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from core.errors import InputError
from core.geodesics.meshes import FloatArray, IntArray, TriangleSurface, checked_point
from core.geodesics.registry import DEFAULT_GEODESIC_METHOD, geodesic_solver
from core.geodesics.solver import GeodesicSolver
from core.surface.points import SurfacePoint


@dataclass(frozen=True, eq=False)
class GeodesicFields:
    """Distances from several anchors to every vertex of a surface.

    Attributes
    ----------
    names : tuple of str (a)
        The anchors, in the order of the rows.
    distances : ndarray (a, n) float64
        Metres along the skin; inf where the anchor's part of the surface is not connected.
    vertices, triangles : ndarray (n, 3), (m, 3)
        The surface.
    method : str
        The geodesic method.
    """

    names: tuple[str, ...]
    distances: FloatArray
    vertices: FloatArray
    triangles: IntArray
    method: str = DEFAULT_GEODESIC_METHOD

    def __post_init__(self) -> None:
        if self.distances.shape != (len(self.names), len(self.vertices)):
            raise InputError(
                f"{len(self.names)} anchors on {len(self.vertices)} vertices need distances of that shape, "
                f"not {self.distances.shape}."
            )

    def of(self, name: str) -> FloatArray:
        """Distances (n,) from one anchor."""
        if name not in self.names:
            raise InputError(f"There is no distance field of anchor '{name}'.")
        row: FloatArray = self.distances[self.names.index(name)]
        return row

    def at(self, points: Sequence[SurfacePoint]) -> FloatArray:
        """Distances (a, k) from every anchor to points between the vertices.

        On a flat triangle the squared distance to a fixed point is the barycentric mean of the squared corner
        distances less ``sum_{i<j} w_i w_j |e_ij|^2``. That is exact where the surface can be unfolded, down
        to a target beside the anchor or in its very triangle, where linear interpolation is wrong by half an
        edge.
        """
        if not points:
            return np.zeros((len(self.names), 0))
        checked = [checked_point(self.triangles, p, f"Point {i}") for i, p in enumerate(points)]
        corners = np.array([c for c, _ in checked])
        weights = np.array([w for _, w in checked])
        return interpolate_distances(self.distances, self.vertices, corners, weights)


def interpolate_distances(
    distances: FloatArray, vertices: FloatArray, corners: IntArray, weights: FloatArray
) -> FloatArray:
    """Distances (a, k) inside triangles ``corners`` at ``weights``, both (k, 3); see `GeodesicFields.at`."""
    places = vertices[corners]
    spread = np.zeros(len(corners))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        edge = places[:, i] - places[:, j]
        spread += weights[:, i] * weights[:, j] * np.einsum("kc,kc->k", edge, edge)
    values = distances[:, corners]
    squares = np.where(weights > 0.0, values, 0.0) ** 2 * weights
    result: FloatArray = np.sqrt(np.maximum(squares.sum(axis=2) - spread, 0.0))
    return result


def geodesic_fields(
    surface: TriangleSurface,
    anchors: Mapping[str, SurfacePoint],
    method: str = DEFAULT_GEODESIC_METHOD,
    *,
    solver: GeodesicSolver | None = None,
    threads: int = 2,
) -> GeodesicFields:
    """Distances from every anchor over a surface.

    Parameters
    ----------
    surface : TriangleSurface
        Usually a `core.surface.BodySurface`.
    anchors : mapping of str to SurfacePoint
    method : str
        One of `GEODESIC_METHODS`; ignored when ``solver`` is given.
    solver : GeodesicSolver, optional
        A solver already built on this surface (for example `grid_solver`).
    threads : int
        Anchors solved at the same time.
    """
    names = tuple(anchors)
    if solver is None:
        solver = geodesic_solver(
            surface.vertices, surface.triangles, method, pixels=getattr(surface, "pixels", None)
        )
    distances = solver.distances([anchors[name] for name in names], threads=threads)
    return GeodesicFields(names, distances, solver.vertices, solver.triangles, solver.method)
