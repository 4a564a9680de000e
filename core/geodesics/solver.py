"""The one call behind which every geodesic method stands, and how sources are shared between threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol, runtime_checkable

from core.geodesics.meshes import FloatArray, IntArray, Source
from core.surface.points import SurfacePoint


@runtime_checkable
class GeodesicSolver(Protocol):
    """Distances along a surface from any number of sources; built once per surface."""

    method: str

    @property
    def vertices(self) -> FloatArray:
        """Positions (n, 3) of the surface's vertices."""

    @property
    def triangles(self) -> IntArray:
        """Corner numbers (m, 3), which `SurfacePoint.triangle` counts."""

    def distances(self, sources: Sequence[Source], *, threads: int = 2) -> FloatArray:
        """Distances (s, n) from every source to every vertex, in the vertices' unit; inf = unreachable."""

    def path(self, distances: FloatArray, target: SurfacePoint, source: Source | None = None) -> FloatArray:
        """Shortest path (k, 3) from ``target`` back to the source of ``distances`` (n,)."""


def each_source(count: int, threads: int, work: Callable[[int], None]) -> None:
    """Call ``work(i)`` for every i < count on ``threads`` threads (kernels release the interpreter lock)."""
    threads = max(1, min(threads, count))
    if threads == 1:
        for i in range(count):
            work(i)
        return
    with ThreadPoolExecutor(threads, thread_name_prefix="geodesics") as pool:
        for _ in pool.map(work, range(count)):
            pass
