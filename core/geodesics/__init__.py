"""Distances and shortest paths along a surface: one call, several methods.

Kernels are compiled (or loaded from the cache) on first use; `warm_up` does it ahead of time.
"""

from core.geodesics.delaunay import delaunay_mesh
from core.geodesics.fields import GeodesicFields, geodesic_fields, interpolate_distances
from core.geodesics.mesh_io import read_mesh
from core.geodesics.meshes import DepthGridSurface, Source, TriangleSurface
from core.geodesics.registry import (
    DEFAULT_GEODESIC_METHOD,
    GEODESIC_METHODS,
    geodesic_solver,
    grid_solver,
    register_geodesic_method,
    trace_path,
)
from core.geodesics.solver import GeodesicSolver
from core.geodesics.warm import warm_up

__all__ = [
    "DEFAULT_GEODESIC_METHOD",
    "GEODESIC_METHODS",
    "DepthGridSurface",
    "GeodesicFields",
    "GeodesicSolver",
    "Source",
    "TriangleSurface",
    "delaunay_mesh",
    "geodesic_fields",
    "geodesic_solver",
    "grid_solver",
    "interpolate_distances",
    "read_mesh",
    "register_geodesic_method",
    "trace_path",
    "warm_up",
]
