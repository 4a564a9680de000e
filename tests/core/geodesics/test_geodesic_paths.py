"""The path itself: from target to source, on the surface, as long as the distance says."""

import numpy as np
import pytest

from core.errors import InputError, WorkError
from core.geodesics import geodesic_solver, grid_solver, trace_path
from core.surface.points import SurfacePoint


def length(path):
    return np.linalg.norm(np.diff(path, axis=0), axis=1).sum()


def targets(shape, count=40, seed=5):
    rng = np.random.default_rng(seed)
    rows = rng.integers(0, len(shape.triangles), count)
    return [shape.point(t, rng.dirichlet([1, 1, 1])) for t in rows]


@pytest.mark.parametrize("method", ["virtual-source", "fast-marching"])
def test_a_path_is_as_long_as_the_distance(shape, method):
    source = shape.point(10000, [0.2, 0.3, 0.5])
    solver = geodesic_solver(shape.vertices, shape.triangles, method)
    distances = solver.distances([source])[0]
    for target in targets(shape):
        path = trace_path(solver, distances, target, source=source)
        truth = shape.true_distance(source.position_m, target.position_m[None])[0]
        assert length(path) == pytest.approx(truth, rel=0.01)
        assert path[0] == pytest.approx(target.position_m)
        assert path[-1] == pytest.approx(source.position_m)


def test_on_a_plane_the_path_is_the_straight_line(plane):
    source = plane.point(200, [0.5, 0.25, 0.25])
    solver = geodesic_solver(plane.vertices, plane.triangles)
    distances = solver.distances([source])[0]
    for target in targets(plane):
        path = trace_path(solver, distances, target)
        way = (source.position_m - target.position_m)[:2]
        off = path[:, :2] - target.position_m[:2]
        aside = off @ np.array([-way[1], way[0]]) / np.linalg.norm(way)
        assert np.abs(aside).max() < 1e-4


def test_path_points_lie_on_the_surface(shape_of):
    cylinder = shape_of("cylinder", jitter=0.0)
    solver = geodesic_solver(cylinder.vertices, cylinder.triangles, "fast-marching")
    distances = solver.distances([0])[0]
    path = trace_path(solver, distances, cylinder.vertex_point(9999))
    radius = np.hypot(path[:, 0], path[:, 2])
    chord = 0.5 * (1.0 - np.cos(0.5 * 2.0 / 99))
    assert radius.max() < 0.5 + 1e-9
    assert radius.min() > 0.5 - 1.1 * chord


def test_the_source_is_found_from_the_distances_alone(shape):
    for triangle in (5, 4321, 15000):
        source = shape.point(triangle, [0.15, 0.7, 0.15])
        solver = geodesic_solver(shape.vertices, shape.triangles)
        distances = solver.distances([source])[0]
        target = shape.point(9000, [0.3, 0.3, 0.4])
        end = trace_path((shape.vertices, shape.triangles), distances, target)[-1]
        assert end == pytest.approx(source.position_m, abs=1e-5)


def test_dijkstras_path_goes_from_vertex_to_vertex_and_sums_up_exactly(plane):
    solver = geodesic_solver(plane.vertices, plane.triangles, "dijkstra")
    distances = solver.distances([61])[0]
    path = trace_path(solver, distances, plane.vertex_point(3500))
    nearest = np.linalg.norm(plane.vertices[:, None] - path[None], axis=2).min(axis=0)
    assert nearest.max() == 0.0
    assert length(path) == pytest.approx(distances[3500], rel=1e-6)


def test_the_front_takes_a_shorter_way_than_dijkstra(plane):
    target = plane.vertex_point(59 * 60 + 25)
    lengths = []
    for method in ("fast-marching", "dijkstra"):
        solver = geodesic_solver(plane.vertices, plane.triangles, method)
        lengths.append(length(trace_path(solver, solver.distances([62])[0], target)))
    assert lengths[0] < 0.97 * lengths[1]


def test_a_path_goes_around_a_hole(plane):
    u, v = plane.pixels[plane.triangles].mean(axis=1).T
    triangles = plane.triangles[~((np.abs(v - 29.5) < 3) & (np.abs(u - 29.5) < 20))]
    for method in ("virtual-source", "fast-marching"):
        solver = geodesic_solver(plane.vertices, triangles, method)
        distances = solver.distances([15 * 60 + 30])[0]
        row, corner = np.argwhere(triangles == 45 * 60 + 30)[0]
        target = SurfacePoint(int(row), np.eye(3)[corner], plane.vertices[45 * 60 + 30])
        path = trace_path(solver, distances, target)
        assert length(path) == pytest.approx(distances[45 * 60 + 30], rel=0.015)


def test_paths_on_a_depth_grid_follow_pixels(plane):
    solver = grid_solver(plane)
    distances = solver.distances([0])[0]
    path = trace_path(solver, distances, plane.vertex_point(3599))
    assert length(path) == pytest.approx(distances[3599], rel=1e-6)
    assert len(path) >= 60


def test_a_target_in_the_sources_triangle_is_joined_by_a_straight_line(plane):
    source, target = plane.point(90, [0.8, 0.1, 0.1]), plane.point(90, [0.1, 0.1, 0.8])
    for method in ("dijkstra", "virtual-source"):
        solver = geodesic_solver(plane.vertices, plane.triangles, method)
        path = trace_path(solver, solver.distances([source])[0], target)
        assert path == pytest.approx(np.array([target.position_m, source.position_m]), abs=1e-6)


def test_a_target_on_another_part_has_no_path():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]], float)
    solver = geodesic_solver(vertices, [[0, 1, 2], [3, 4, 5]])
    distances = solver.distances([0])[0]
    with pytest.raises(WorkError, match="separate parts"):
        trace_path(solver, distances, SurfacePoint(1, np.full(3, 1 / 3), np.zeros(3)))


def test_distances_of_another_surface_are_refused(plane):
    solver = geodesic_solver(plane.vertices, plane.triangles)
    with pytest.raises(InputError, match="one distance per vertex"):
        trace_path(solver, np.zeros(5), plane.point(0, [1, 0, 0]))
    with pytest.raises(InputError, match="no source"):
        trace_path(solver, np.full(3600, 1.0), plane.point(0, [1, 0, 0]))
