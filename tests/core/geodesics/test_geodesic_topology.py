"""Meshes as depth cameras make them: holes, loose parts, bow ties, degenerate and repeated triangles."""

import numpy as np
import pytest

from core.errors import InputError
from core.geodesics import GEODESIC_METHODS, geodesic_solver, register_geodesic_method

METHODS = list(GEODESIC_METHODS)


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_reached_is_infinitely_far(method):
    square = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], float)
    vertices = np.vstack([square, square + np.array([5, 0, 0]), [[9, 9, 9]]])
    triangles = [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]
    distances = geodesic_solver(vertices, triangles, method).distances([0, 8])
    assert np.isfinite(distances[0, :4]).all()
    assert np.isinf(distances[0, 4:]).all()
    assert distances[1, 8] == 0.0
    assert np.isinf(distances[1, :8]).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_bow_tie_is_crossed_at_its_knot(method):
    vertices = np.array([[0, 0, 0], [1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], float)
    distances = geodesic_solver(vertices, [[0, 1, 2], [0, 3, 4]], method).distances([1])[0]
    assert distances == pytest.approx([2**0.5, 0, 2, 2 * 2**0.5, 2 * 2**0.5], rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_two_cones_that_share_their_tip_are_crossed_there(method):
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rim = np.stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), np.ones(12)], axis=1)
    vertices = np.vstack([[[0, 0, 0]], rim, rim * [1, 1, -1]])
    ring = np.arange(12)
    up = np.stack([np.zeros(12, int), 1 + ring, 1 + (ring + 1) % 12], axis=1)
    down = np.stack([np.zeros(12, int), 13 + ring, 13 + (ring + 1) % 12], axis=1)
    distances = geodesic_solver(vertices, np.vstack([up, down]), method).distances([1])[0]
    assert distances[13:] == pytest.approx(2 * np.hypot(0.5, 1.0), rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_degenerate_and_repeated_triangles_change_nothing(plane, method):
    clean = geodesic_solver(plane.vertices, plane.triangles, method).distances([1777])
    line = plane.triangles[:5].copy()
    line[:, 2] = line[:, 1]
    again = plane.triangles[::3][:, [1, 0, 2]]
    dirty = np.vstack([plane.triangles, line, again])
    assert geodesic_solver(plane.vertices, dirty, method).distances([1777]) == pytest.approx(clean, rel=1e-5)


@pytest.mark.parametrize("method", METHODS)
def test_coincident_vertices_and_needles_are_walked_through(method):
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, 2, 0], [0, 0, 0]], float)
    triangles = [[0, 1, 4], [2, 3, 4], [1, 2, 4], [0, 4, 5], [0, 1, 3], [0, 6, 1]]
    distances = geodesic_solver(vertices, triangles, method).distances([0])[0]
    assert distances[:5] == pytest.approx([0, 1, 1, 2, 2**0.5], rel=1e-5)
    assert distances[6] == pytest.approx(0.0, abs=1e-9)


def test_a_path_bends_around_the_corner_of_a_hole(plane):
    # A slot from the left edge to the middle: the way from below to above bends at the slot's end.
    u, v = plane.pixels[plane.triangles].mean(axis=1).T
    open_ = ~((np.abs(v - 29.5) < 0.4) & (u < 29.0))
    distances = geodesic_solver(plane.vertices, plane.triangles[open_]).distances([20 * 60 + 5])[0]
    target = 40 * 60 + 5
    legs = [
        np.linalg.norm(plane.vertices[a, :2] - plane.vertices[b, :2], axis=-1)
        for a, b in ((20 * 60 + 5, 29 * 60 + 29), (29 * 60 + 29, 30 * 60 + 29), (30 * 60 + 29, target))
    ]
    assert distances[target] == pytest.approx(sum(legs), rel=0.01)
    assert distances[target] > 1.5 * np.linalg.norm(plane.vertices[20 * 60 + 5] - plane.vertices[target])


def test_at_a_saddle_the_way_through_the_tip_is_the_sum_of_both_legs():
    # Twenty unfolded sectors of 27 degrees close up to 540 degrees: no straight line reaches beyond 180.
    sectors, rings = 20, 30
    turn = np.arange(sectors) * 2 * np.pi / sectors
    wave = 1.6 * np.sin(turn * 3)
    spoke = np.stack([np.cos(turn), np.sin(turn), wave], axis=1)
    spoke /= np.linalg.norm(spoke, axis=1, keepdims=True)
    vertices = np.vstack([[[0, 0, 0]], *[spoke * (r + 1) / rings for r in range(rings)]])
    triangles = []
    for i in range(sectors):
        j = (i + 1) % sectors
        triangles.append([0, 1 + i, 1 + j])
        for r in range(rings - 1):
            a, b, c, d = (1 + r * sectors + k for k in (i, j, sectors + i, sectors + j))
            triangles += [[a, c, b], [b, c, d]]
    angles = np.arccos(np.clip((spoke * np.roll(spoke, -1, axis=0)).sum(axis=1), -1, 1))
    assert angles.sum() > 2.4 * np.pi
    source = 1 + 19 * sectors
    reach = np.concatenate([[0], np.cumsum(angles)[:-1]])
    opposite = int(np.argmin(np.abs(reach - angles.sum() / 2)))
    assert min(reach[opposite], angles.sum() - reach[opposite]) > np.pi
    distances = geodesic_solver(vertices, triangles).distances([source])[0]
    assert distances[1 + 9 * sectors + opposite] == pytest.approx(20 / rings + 10 / rings, rel=2e-3)


@pytest.mark.parametrize("method", METHODS)
def test_edge_lengths_of_a_thousandfold_range_are_handled(method):
    x = np.concatenate([np.arange(50) * 1e-4, 1.0 + np.arange(30)])
    vertices = np.vstack([np.stack([x, 0 * x, 0 * x], axis=1), np.stack([x, 0 * x + 1e-4, 0 * x], axis=1)])
    i, n = np.arange(len(x) - 1), len(x)
    triangles = np.vstack([np.stack([i, i + 1, i + n], 1), np.stack([i + 1, i + n + 1, i + n], 1)])
    distances = geodesic_solver(vertices, triangles, method).distances([0])[0]
    assert distances[:n] == pytest.approx(x, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_threads_do_not_change_the_answer(plane, method):
    solver = geodesic_solver(plane.vertices, plane.triangles, method)
    sources = list(range(0, 3600, 400))
    assert (solver.distances(sources, threads=1) == solver.distances(sources, threads=3)).all()


def test_no_sources_give_an_empty_table(plane):
    assert geodesic_solver(plane.vertices, plane.triangles).distances([]).shape == (0, 3600)


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        ([[0, 0, 0], [1, 0, 0], [0, 1, np.nan]], [[0, 1, 2]], "vertex 2"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "triangle 0"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "triangle 0"),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], "shape"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0.0, 1.0, 2.0]], "whole numbers"),
    ],
)
def test_what_is_no_mesh_is_refused_and_named(vertices, triangles, words):
    with pytest.raises(InputError, match=words):
        geodesic_solver(vertices, triangles)


def test_sources_off_the_mesh_are_refused(plane):
    solver = geodesic_solver(plane.vertices, plane.triangles)
    with pytest.raises(InputError, match="Source 1 is vertex 3600"):
        solver.distances([0, 3600])
    with pytest.raises(InputError, match="outside its triangle"):
        solver.distances([plane.point(0, [1.5, -0.5, 0.0])])
    with pytest.raises(InputError, match="sum to 1"):
        solver.distances([plane.point(0, [0.5, 0.1, 0.0])])


def test_an_unknown_method_is_refused_with_the_known_ones(plane):
    with pytest.raises(InputError, match=r"'heat'.*dijkstra, fast-marching, virtual-source"):
        geodesic_solver(plane.vertices, plane.triangles, "heat")


def test_a_new_method_can_be_registered(plane, monkeypatch):
    monkeypatch.setattr("core.geodesics.registry.GEODESIC_METHODS", dict(GEODESIC_METHODS))
    register_geodesic_method("mine", lambda v, t, pixels: geodesic_solver(v, t, "dijkstra"))
    assert geodesic_solver(plane.vertices, plane.triangles, "mine").distances([0])[0, 0] == 0.0
