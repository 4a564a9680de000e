"""The geodesic methods by name. A method's module, with its compiled kernel, is loaded on first use."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from core.errors import InputError
from core.geodesics.meshes import DepthGridSurface, FloatArray, Source
from core.geodesics.solver import GeodesicSolver
from core.surface.points import SurfacePoint

DEFAULT_GEODESIC_METHOD = "virtual-source"

SolverFactory = Callable[[ArrayLike, ArrayLike, ArrayLike | None], GeodesicSolver]
"""Builds a solver from vertices (n, 3), triangles (m, 3) and, for a depth grid, pixels (n, 2) or None."""


def _dijkstra(vertices: ArrayLike, triangles: ArrayLike, pixels: ArrayLike | None) -> GeodesicSolver:
    from core.geodesics.dijkstra import DijkstraSolver

    return DijkstraSolver(vertices, triangles)


def _fast_marching(vertices: ArrayLike, triangles: ArrayLike, pixels: ArrayLike | None) -> GeodesicSolver:
    from core.geodesics.fast_marching import FastMarchingSolver

    return FastMarchingSolver(vertices, triangles)


def _virtual_source(vertices: ArrayLike, triangles: ArrayLike, pixels: ArrayLike | None) -> GeodesicSolver:
    from core.geodesics.virtual_source import VirtualSourceSolver

    return VirtualSourceSolver(vertices, triangles)


GEODESIC_METHODS: dict[str, SolverFactory] = {
    "dijkstra": _dijkstra,
    "fast-marching": _fast_marching,
    "virtual-source": _virtual_source,
}


def register_geodesic_method(name: str, factory: SolverFactory) -> None:
    """Add a geodesic method, or replace one."""
    GEODESIC_METHODS[name] = factory


def geodesic_solver(
    vertices: ArrayLike,
    triangles: ArrayLike,
    method: str = DEFAULT_GEODESIC_METHOD,
    *,
    pixels: ArrayLike | None = None,
) -> GeodesicSolver:
    """Build a solver for one surface.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions, any unit; distances come back in it.
    triangles : array (m, 3)
        Corner numbers. Holes, loose parts, bow ties, degenerate and duplicated triangles are allowed.
    method : str
        A key of `GEODESIC_METHODS`.
    pixels : array (n, 2), optional
        Column and row of every vertex when the mesh is a depth grid: a hint for registered methods that use
        the grid. The built-in ones need none.

    Raises
    ------
    InputError
        Unknown method or a mesh that is not one.
    """
    if method not in GEODESIC_METHODS:
        raise InputError(
            f"There is no geodesic method '{method}'.",
            f"Choose one of: {', '.join(sorted(GEODESIC_METHODS))}.",
        )
    return GEODESIC_METHODS[method](vertices, triangles, pixels)


def grid_solver(surface: DepthGridSurface, *, jump_m: float = 0.05) -> GeodesicSolver:
    """Dijkstra on the 8-neighbour graph of a surface's depth pixels (the thesis's "DM", figure 6).

    Parameters
    ----------
    surface : DepthGridSurface
        Its vertices are depth pixels, in the depth camera's frame.
    jump_m : float
        Neighbours whose depths differ by more (metres) are not joined: an arm is not joined to the torso
        behind it.
    """
    from core.geodesics.grid import build_grid_solver

    return build_grid_solver(surface, jump_m)


def trace_path(
    solver: GeodesicSolver | tuple[ArrayLike, ArrayLike],
    distances: FloatArray,
    target: SurfacePoint,
    *,
    source: Source | None = None,
) -> FloatArray:
    """Shortest path (k, 3) from ``target`` to the source of a distance field.

    Parameters
    ----------
    solver : GeodesicSolver or (vertices, triangles)
        The solver that made the distances (Dijkstra's paths follow edges, the others cross faces), or the
        mesh alone.
    distances : ndarray (n,)
        One row of `GeodesicSolver.distances`.
    target : SurfacePoint
    source : SurfacePoint or int, optional
        Where the distances start; found from the distances when not given.
    """
    if isinstance(solver, tuple):
        solver = geodesic_solver(*solver)
    return solver.path(np.asarray(distances), target, source)
