"""CPU time of one geodesic field at 60,000 points, all methods in turn on one surface."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeVar

import numpy as np

from core.capture.camera import PinholeCamera
from core.geodesics import GeodesicSolver, delaunay_mesh, geodesic_solver, grid_solver, warm_up
from core.progress import Progress, no_progress
from core.surface import BodySurface

_T = TypeVar("_T")

POINTS: Final = 60_000
_CAMERA: Final = PinholeCamera(300, 200, 400.0, 400.0, 149.5, 99.5)
THESIS_CPU_S: Final = {"DM": 0.065, "FMM": 1.75}


@dataclass(frozen=True)
class MethodTime:
    """CPU seconds of one method, medians over the rounds; building is not part of solving.

    Attributes
    ----------
    method : str
        "DM", "FMM" or "virtual source".
    build_s : float
        Graph or mesh from the depth grid, with the Delaunay triangulation for FMM.
    one_source_s, low_s, high_s : float
        One field from one source on one thread: median, least, most.
    fifteen_sources_s : float
    thesis_s : float or None
        What the thesis reports.
    """

    method: str
    build_s: float
    one_source_s: float
    low_s: float
    high_s: float
    fifteen_sources_s: float
    thesis_s: float | None


def sixty_thousand_points() -> BodySurface:
    """A trunk-like half cylinder of 300 x 200 depth pixels at 2 m with 3 mm of noise."""
    rays = _CAMERA.pixel_rays
    across = 2.0 * rays[..., 0]
    depth = 2.0 - 0.25 * np.cos(np.clip(across / 0.8, -1, 1) * np.pi / 2)
    depth += np.random.default_rng(5).normal(0.0, 0.003, depth.shape)
    return BodySurface.from_depth(depth, _CAMERA, jump_m=0.05)


def _builders(surface: BodySurface) -> dict[str, Callable[[], GeodesicSolver]]:
    return {
        "DM": lambda: grid_solver(surface),
        "FMM": lambda: geodesic_solver(surface.vertices, delaunay_mesh(surface), "fast-marching"),
        "virtual source": lambda: geodesic_solver(surface.vertices, surface.triangles, "virtual-source"),
    }


def time_methods(
    surface: BodySurface | None = None, *, rounds: int = 9, progress: Progress = no_progress
) -> tuple[int, list[MethodTime]]:
    """Number of points, and the times of every method.

    A round runs every method in turn, so that whatever else the machine does slows all of them alike. CPU
    time of this process, on one thread.
    """
    warm_up()
    surface = surface or sixty_thousand_points()
    count = len(surface.vertices)
    sources = np.linspace(0.1 * count, 0.9 * count, 15).astype(int).tolist()
    one = [int(surface.vertex_of_pixel[surface.camera.height // 2, surface.camera.width // 2])]
    builders = _builders(surface)
    build: dict[str, list[float]] = {name: [] for name in builders}
    single: dict[str, list[float]] = {name: [] for name in builders}
    many: dict[str, list[float]] = {name: [] for name in builders}
    for number in range(rounds):
        progress(number / rounds, "CPU time at 60,000 points")
        for name, make in builders.items():
            seconds, solver = _timed(make)
            build[name].append(seconds)
            single[name].append(_timed(partial(solver.distances, one, threads=1))[0])
            many[name].append(_timed(partial(solver.distances, sources, threads=1))[0])
    progress(1.0)
    return count, [
        MethodTime(
            name,
            _median(build[name]),
            _median(single[name]),
            min(single[name]),
            max(single[name]),
            _median(many[name]),
            THESIS_CPU_S.get(name),
        )
        for name in builders
    ]


def _timed(work: Callable[[], _T]) -> tuple[float, _T]:
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def _median(values: Sequence[float]) -> float:
    return float(np.median(values))
