"""Geodesics: speed against potpourri3d and scipy, interleaved in one run, and error against formulas.

60,025 vertices; a round solves the same sources with every method in turn, so that whatever else the
machine does slows all of them alike. A ratio is peer time / our time, its median and range over the rounds.
Solvers are built beforehand; building is a row of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from core.geodesics import geodesic_solver, warm_up

SIDE = 245
RADIUS = 0.5
OURS = ("virtual-source", "fast-marching", "dijkstra")
Row = dict[str, Any]


def make_shape(name: str, side: int, jitter: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    """Plane, sphere or cylinder of ``side`` x ``side`` vertices, inner ones moved along it at random."""
    v, u = np.divmod(np.arange(side * side), side)
    c = np.flatnonzero((u < side - 1) & (v < side - 1))
    triangles = np.stack([c, c + 1, c + side, c + 1, c + side + 1, c + side], axis=1).reshape(-1, 3)
    inner = (u > 0) & (v > 0) & (u < side - 1) & (v < side - 1)
    moved = np.stack([u, v]) + inner * np.random.default_rng(0).uniform(-jitter, jitter, (2, side * side))
    x, y = moved / (side - 1)
    if name == "plane":
        return np.stack([x, y, 0 * x], axis=1), triangles.astype(np.int32)
    if name == "cylinder":
        places = np.stack([RADIUS * np.sin(x / RADIUS), y, RADIUS * np.cos(x / RADIUS)], axis=1)
        return places, triangles.astype(np.int32)
    places = np.stack([2 * x - 1, 2 * y - 1, np.ones(len(x))], axis=1)
    return places / np.linalg.norm(places, axis=1, keepdims=True), triangles.astype(np.int32)


def true_distances(name: str, vertices: np.ndarray, source: int) -> np.ndarray:
    """Distances from a vertex by formula."""
    place = vertices[source]
    if name == "plane":
        return np.linalg.norm(vertices - place, axis=1)
    if name == "cylinder":
        turn = np.arctan2(vertices[:, 0], vertices[:, 2]) - np.arctan2(place[0], place[2])
        return np.hypot(RADIUS * turn, vertices[:, 1] - place[1])
    return np.arctan2(np.linalg.norm(np.cross(vertices, place), axis=1), vertices @ place)


def builders(
    vertices: np.ndarray, triangles: np.ndarray
) -> dict[str, Callable[[], Callable[[list[int]], Any]]]:
    """For every method a function that builds it, returning one that gives distances (s, n) from sources."""
    import potpourri3d as pp
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    def ours(method: str) -> Callable[[], Callable[[list[int]], Any]]:
        return lambda: geodesic_solver(vertices, triangles, method).distances

    def pp_fast_marching() -> Callable[[list[int]], Any]:
        solver = pp.MeshFastMarchingDistanceSolver(vertices, triangles)
        return lambda sources: [solver.compute_distance([[(s, [])]]) for s in sources]

    def pp_heat() -> Callable[[list[int]], Any]:
        solver = pp.MeshHeatMethodDistanceSolver(vertices, triangles)
        return lambda sources: [solver.compute_distance(s) for s in sources]

    def scipy_dijkstra() -> Callable[[list[int]], Any]:
        edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
        lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        i, j = np.vstack([edges, edges[:, ::-1]]).T
        graph = coo_matrix((np.tile(lengths, 2), (i, j)), shape=(len(vertices),) * 2).tocsr()
        return lambda sources: dijkstra(graph, indices=sources)

    return {
        **{method: ours(method) for method in OURS},
        "potpourri3d fast marching": pp_fast_marching,
        "potpourri3d heat": pp_heat,
        "scipy dijkstra": scipy_dijkstra,
    }


def interleaved(work: dict[str, Callable[[], Any]], rounds: int) -> dict[str, np.ndarray]:
    """Wall-clock seconds (rounds,) of each piece of work, done in turn."""
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, call in work.items():
            begin = time.perf_counter()
            call()
            seconds[name].append(time.perf_counter() - begin)
    return {name: np.array(values) for name, values in seconds.items()}


def speed_rows(figure: str, seconds: dict[str, np.ndarray], pairs: list[tuple[str, str]]) -> list[Row]:
    """A row for each (ours, peer): our median milliseconds, and the ratio of the same rounds."""
    rows = []
    for mine, peer in pairs:
        ratio = seconds[peer] / seconds[mine]
        rows.append(
            {
                "figure": f"{figure}: {mine}",
                "value": float(np.median(seconds[mine]) * 1e3),
                "unit": "ms",
                "peer": peer,
                "median": float(np.median(seconds[peer]) * 1e3),
                "ratio": float(np.median(ratio)),
                "spread": f"{ratio.min():.2f}-{ratio.max():.2f}",
                "rounds": len(ratio),
            }
        )
    return rows


def accuracy_rows(side: int) -> list[Row]:
    """Mean relative error of every method on shapes whose geodesics are known."""
    rows = []
    for shape in ("plane", "sphere", "cylinder"):
        vertices, triangles = make_shape(shape, side)
        source = side * (side // 2) + side // 3
        truth = true_distances(shape, vertices, source)
        errors = {}
        for name, build in builders(vertices, triangles).items():
            distances = np.asarray(build()([source]))[0]
            relative = np.delete(np.abs(distances - truth), source) / np.delete(truth, source)
            errors[name] = float(relative.mean() * 100)
        for name in OURS:
            peer = "scipy dijkstra" if name == "dijkstra" else "potpourri3d fast marching"
            rows.append(
                {
                    "figure": f"mean error on the {shape}: {name}",
                    "value": errors[name],
                    "unit": "%",
                    "peer": peer,
                    "median": errors[peer],
                    "ratio": errors[peer] / errors[name],
                    "spread": f"heat {errors['potpourri3d heat']:.2f} %",
                }
            )
    return rows


def run(quick: bool = False) -> list[Row]:
    """Measure; ``quick`` uses fewer rounds and a smaller mesh for the errors."""
    warm_up()
    rounds = 5 if quick else 9
    vertices, triangles = make_shape("cylinder", SIDE)
    build = builders(vertices, triangles)
    solve = {name: make() for name, make in build.items()}
    one = [SIDE * (SIDE // 2) + SIDE // 2]
    many = np.linspace(500, len(vertices) - 500, 15).astype(int).tolist()
    size = f"x {len(vertices) // 1000}k vertices"
    virtual = [("virtual-source", peer) for peer in list(solve)[3:]]
    rest = [("fast-marching", "potpourri3d fast marching"), ("dijkstra", "scipy dijkstra")]
    rows = speed_rows(
        f"15 sources {size}",
        interleaved({name: lambda s=s: s(many) for name, s in solve.items()}, rounds),
        virtual + rest,
    )
    rows += speed_rows(
        f"1 source {size}",
        interleaved({name: lambda s=s: s(one) for name, s in solve.items()}, 3 * rounds),
        virtual + rest,
    )
    rows += speed_rows("building the solver", interleaved(build, rounds), virtual[:2])
    return rows + accuracy_rows(100 if quick else SIDE)


if __name__ == "__main__":
    for row in run():
        print(
            f"{row['figure']:45s} {row['value']:9.4g} {row['unit']:3s} {row['peer']:26s} {row['median']:9.4g}"
            f"  ratio {row['ratio']:7.2f} ({row['spread']})"
        )
