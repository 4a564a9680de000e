"""What fast marching and virtual source share: the wedge table, the seeds, the threads, the path."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from core.geodesics.meshes import FloatArray, IntArray, Source, checked_mesh, seed_sources
from core.geodesics.paths import trace_front_path
from core.geodesics.solver import each_source
from core.geodesics.wedges import build_wedges
from core.surface.points import SurfacePoint


class WedgeSolver(ABC):
    """A solver whose front runs over wedges.

    Parameters
    ----------
    vertices : array (n, 3)
    triangles : array (m, 3)
    """

    method: str

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        self.vertices, self.triangles = checked_mesh(vertices, triangles)
        self.wedges = build_wedges(self.vertices, self.triangles)

    @abstractmethod
    def _front(self, seeds: IntArray, starts: FloatArray, out: FloatArray) -> None:
        """Fill ``out`` (n,) with the distances from one source."""

    def distances(self, sources: Sequence[Source], *, threads: int = 2) -> FloatArray:
        """Distances (s, n); see `core.geodesics.solver.GeodesicSolver`."""
        seeds, starts = seed_sources(self.vertices, self.triangles, sources)
        out = np.empty((len(sources), len(self.vertices)), dtype=np.float64)
        each_source(len(sources), threads, lambda i: self._front(seeds[i], starts[i], out[i]))
        return out

    def path(self, distances: FloatArray, target: SurfacePoint, source: Source | None = None) -> FloatArray:
        """Polyline (k, 3) across the faces, down the distance field."""
        return trace_front_path(self.vertices, self.triangles, self.wedges, distances, target, source)
