"""Distance fields are computed once per surface and anchor set, and forgotten with the surface."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from core.geodesics import (
    GeodesicFields,
    GeodesicSolver,
    delaunay_mesh,
    geodesic_fields,
    geodesic_solver,
    grid_solver,
)
from core.surface import BodySurface, SurfacePoint

GeodesicKind = Literal["virtual-source", "grid-dijkstra", "delaunay-fast-marching"]
"""The shipped engine, and the thesis's "DM" and "FMM"."""

_Key = tuple[str, tuple[tuple[str, bytes], ...]]


class FieldStore:
    """Solvers and fields by surface. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._solvers: WeakKeyDictionary[BodySurface, dict[str, GeodesicSolver]] = WeakKeyDictionary()
        self._fields: WeakKeyDictionary[BodySurface, dict[_Key, GeodesicFields]] = WeakKeyDictionary()

    def solver(self, surface: BodySurface, kind: GeodesicKind) -> GeodesicSolver:
        """The solver of a kind on a surface."""
        with self._lock:
            known = self._solvers.setdefault(surface, {})
            if kind in known:
                return known[kind]
        built = _build(surface, kind)
        with self._lock:
            return known.setdefault(kind, built)

    def fields(
        self, surface: BodySurface, anchors: Mapping[str, SurfacePoint], kind: GeodesicKind
    ) -> GeodesicFields:
        """Distance fields of the anchors, in their order."""
        key = (kind, tuple((name, np.asarray(p.position_m).tobytes()) for name, p in anchors.items()))
        with self._lock:
            known = self._fields.setdefault(surface, {})
            if key in known:
                return known[key]
        built = _solve(surface, anchors, self.solver(surface, kind), kind)
        with self._lock:
            while len(known) >= 4:
                known.pop(next(iter(known)))
            return known.setdefault(key, built)


def nearest_corner(surface: BodySurface, point: SurfacePoint) -> int:
    """The vertex (depth pixel) of a point's triangle that is nearest to it."""
    return int(surface.triangles[point.triangle][int(np.argmax(point.barycentric))])


def _solve(
    surface: BodySurface, anchors: Mapping[str, SurfacePoint], solver: GeodesicSolver, kind: GeodesicKind
) -> GeodesicFields:
    """Fields of anchors; the thesis's two start at depth pixels, whose numbers every mesh shares."""
    if kind == "virtual-source":
        return geodesic_fields(surface, anchors, solver=solver)
    sources = [nearest_corner(surface, point) for point in anchors.values()]
    distances = solver.distances(sources)
    return GeodesicFields(tuple(anchors), distances, solver.vertices, solver.triangles, solver.method)


def _build(surface: BodySurface, kind: GeodesicKind) -> GeodesicSolver:
    if kind == "grid-dijkstra":
        return grid_solver(surface)
    if kind == "delaunay-fast-marching":
        return geodesic_solver(surface.vertices, delaunay_mesh(surface), "fast-marching")
    return geodesic_solver(surface.vertices, surface.triangles, "virtual-source", pixels=surface.pixels)


FIELDS = FieldStore()
"""The store of this process: a click on an analysed capture finds its fields ready."""
