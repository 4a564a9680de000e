"""Dijkstra's shortest paths along graph edges, the thesis's first method ("DM")."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.geodesics.buckets import append, bucket_sizes, new_queue, remove
from core.geodesics.meshes import FloatArray, IntArray, Source, checked_mesh, seed_sources
from core.geodesics.paths import trace_edge_path
from core.geodesics.solver import each_source
from core.geodesics.wedges import UnsignedArray, build_wedges
from core.surface.points import SurfacePoint

EdgeGraph = tuple[UnsignedArray, UnsignedArray, NDArray[np.float32]]
"""Neighbours in compressed sparse rows: start (n + 1,), neighbours (e,), lengths (e,)."""


@numba.njit(nogil=True, cache=True, error_model="numpy")
def dijkstra_front(start, neighbours, lengths, width, buckets, seeds, starts, d):  # type: ignore[no-untyped-def]
    """Fill ``d`` (n,) float64 with graph distances to one source given by ``seeds`` and ``starts`` (3,)."""
    n = d.shape[0]
    d[:] = np.inf
    ring, link = new_queue(n, buckets)
    queued = 0
    per_width = 1.0 / width
    for i in range(seeds.shape[0]):
        v = np.uint32(seeds[i])
        if starts[i] < d[v]:
            d[v] = starts[i]
            if link[v, 2] >= 0:
                remove(ring, link, v)
                queued -= 1
            append(ring, link, v, np.uint32(np.int64(starts[i] * per_width) & (buckets - 1)))
            queued += 1
    present = np.int64(0)
    while queued > 0:
        first = ring[np.uint32(present & (buckets - 1)), 0]
        if first < 0:
            present += 1
            continue
        a = np.uint32(first)
        remove(ring, link, a)
        queued -= 1
        da = d[a]
        for k in range(start[a], start[a + np.uint32(1)]):
            t = neighbours[k]
            candidate = da + np.float64(lengths[k])
            if candidate < d[t]:
                d[t] = candidate
                # Behind the front only by rounding or by a wide corner: then its turn is now.
                bucket = np.uint32(max(np.int64(candidate * per_width), present) & (buckets - 1))
                if link[t, 2] != np.int32(bucket):
                    if link[t, 2] >= 0:
                        remove(ring, link, t)
                        queued -= 1
                    append(ring, link, t, bucket)
                    queued += 1


@numba.njit(nogil=True, cache=True)
def _edges_of_wedges(start, corners, shape):  # type: ignore[no-untyped-def]
    n = start.shape[0] - 1
    seen = np.full(n, -1, np.int32)
    first = np.zeros(n + 1, np.uint32)
    neighbours = np.empty(2 * corners.shape[0], np.uint32)
    lengths = np.empty(2 * corners.shape[0], np.float32)
    total = 0
    for a in range(n):
        for k in range(start[a], start[a + 1]):
            for side in range(2):
                t = corners[k, side]
                if seen[t] != a:
                    seen[t] = a
                    neighbours[total] = t
                    lengths[total] = shape[k, side]
                    total += 1
        first[a + 1] = total
    return first, neighbours[:total].copy(), lengths[:total].copy()


class GraphSolver:
    """Dijkstra on a given graph over a surface's vertices."""

    method = "dijkstra"

    def __init__(self, vertices: FloatArray, triangles: IntArray, graph: EdgeGraph) -> None:
        self.vertices, self.triangles, self.graph = vertices, triangles, graph
        self._width, self._buckets = bucket_sizes(graph[2])

    def distances(self, sources: Sequence[Source], *, threads: int = 2) -> FloatArray:
        """Distances (s, n); see `core.geodesics.solver.GeodesicSolver`."""
        seeds, starts = seed_sources(self.vertices, self.triangles, sources)
        out = np.empty((len(sources), len(self.vertices)), dtype=np.float64)

        def solve(i: int) -> None:
            dijkstra_front(*self.graph, self._width, self._buckets, seeds[i], starts[i], out[i])

        each_source(len(sources), threads, solve)
        return out

    def path(self, distances: FloatArray, target: SurfacePoint, source: Source | None = None) -> FloatArray:
        """Polyline (k, 3) from vertex to vertex."""
        return trace_edge_path(self.vertices, self.triangles, self.graph, distances, target, source)


class DijkstraSolver(GraphSolver):
    """Dijkstra on the edges of a triangle mesh."""

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        places, corners = checked_mesh(vertices, triangles)
        wedges = build_wedges(places, corners)
        super().__init__(places, corners, _edges_of_wedges(wedges.start, wedges.corners, wedges.shape))
