"""The mesh on the depth grid is a surface, whatever the depth image."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from core.capture import PinholeCamera
from core.errors import WorkError
from core.surface import BodySurface, SurfacePoint

SMALL = PinholeCamera(9, 8, 20.0, 20.0, 4.0, 3.5)
CAMERA = PinholeCamera(120, 90, 110.0, 110.0, 59.5, 44.5)

depths = arrays(np.float64, (8, 9), elements=st.sampled_from([0.0, 1.0, 1.01, 1.02, 1.05, 1.2]))


def ball(radius: float = 0.3, z: float = 1.2) -> np.ndarray:
    rays = CAMERA.pixel_rays
    a, b, c = (rays**2).sum(-1), rays[..., 2] * z, z * z - radius * radius
    root = b * b - a * c
    return np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 0.0)


@settings(max_examples=150, deadline=None)
@given(depths)
def test_every_edge_has_two_sides_and_every_vertex_one_fan(depth: np.ndarray) -> None:
    try:
        surface = BodySurface.from_depth(depth, SMALL, jump_m=0.03, smallest_part=3)
    except WorkError:
        return
    edges: Counter[tuple[int, int]] = Counter()
    for triangle in surface.triangles.tolist():
        for k in range(3):
            edges[(triangle[k], triangle[(k + 1) % 3])] += 1
    assert max(edges.values()) == 1, "no directed edge twice: consistent winding, at most two triangles"
    rim = {vertex for (a, b) in edges if (b, a) not in edges for vertex in (a, b)}
    assert set(np.flatnonzero(surface.boundary)) == rim
    outgoing = Counter(a for (a, b) in edges if (b, a) not in edges)
    assert max(outgoing.values(), default=1) == 1, "a bow tie leaves its vertex by two rims"
    z = surface.vertices[:, 2][surface.triangles]
    assert (z.max(1) - z.min(1) <= 0.03 + 1e-12).all()
    cross = np.cross(
        surface.vertices[surface.triangles[:, 1]] - surface.vertices[surface.triangles[:, 0]],
        surface.vertices[surface.triangles[:, 2]] - surface.vertices[surface.triangles[:, 0]],
    )
    assert (np.sum(cross * surface.vertices[surface.triangles[:, 0]], axis=1) < 0).all(), "faces the camera"


@settings(max_examples=50, deadline=None)
@given(depths)
def test_vertices_and_pixels_name_each_other(depth: np.ndarray) -> None:
    try:
        surface = BodySurface.from_depth(depth, SMALL, smallest_part=3)
    except WorkError:
        return
    u, v = surface.pixels.T
    np.testing.assert_array_equal(surface.vertex_of_pixel[v, u], np.arange(len(surface.vertices)))
    assert (surface.vertex_of_pixel >= 0).sum() == len(surface.vertices)
    np.testing.assert_allclose(surface.vertices, SMALL.backproject(depth)[v, u])
    sizes = np.bincount(surface.component)
    assert (np.diff(sizes) <= 0).all(), "component 0 is the largest"
    assert (surface.component[surface.triangles] == surface.component[surface.triangles[:, :1]]).all()


def test_normals_are_those_of_the_ball() -> None:
    surface = BodySurface.from_depth(ball(), CAMERA)
    expected = (surface.vertices - (0, 0, 1.2)) / 0.3
    inner = ~surface.boundary
    cosine = np.sum(surface.normals * expected, axis=1)
    assert cosine[inner].mean() > 0.998
    assert np.linalg.norm(surface.normals, axis=1) == pytest.approx(1.0)


def test_an_empty_image_is_no_surface() -> None:
    with pytest.raises(WorkError, match="no connected surface"):
        BodySurface.from_depth(np.zeros((90, 120)), CAMERA)


def test_rays_hit_what_brute_force_finds() -> None:
    surface = BodySurface.from_depth(ball() + 0.02 * np.sin(np.arange(120) / 5.0) * (ball() > 0), CAMERA)
    rng = np.random.default_rng(0)
    origin = np.array([0.4, -0.1, 0.1])
    directions = np.array([0.0, 0.0, 1.2]) + rng.uniform(-0.4, 0.4, (300, 3)) - origin
    hits = surface.raycast(origin, directions)
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    for i, d in enumerate(directions):
        solution = np.linalg.solve(
            np.stack([b - a, c - a, np.broadcast_to(-d, a.shape)], axis=2), (origin - a)[..., None]
        )[..., 0]
        inside = (
            (solution[:, :2] >= -1e-9).all(1) & (solution[:, :2].sum(1) <= 1 + 1e-9) & (solution[:, 2] > 0)
        )
        expected = solution[inside, 2].min() if inside.any() else np.inf
        assert hits.t[i] == pytest.approx(expected, abs=1e-9)
        assert hits.hit[i] == np.isfinite(expected)
        if hits.hit[i]:
            point = surface.point(int(hits.triangle[i]), hits.barycentric[i])
            np.testing.assert_allclose(point.position_m, origin + expected * d, atol=1e-9)
    assert 50 < hits.hit.sum() < 300


def test_the_nearest_point_is_nearest() -> None:
    surface = BodySurface.from_depth(ball(), CAMERA)
    rng = np.random.default_rng(1)
    queries = np.array([0, 0, 1.0]) + rng.normal(0, 0.4, (200, 3))
    dense = np.concatenate(
        [
            np.einsum("k,mkx->mx", np.array(w), surface.vertices[surface.triangles])
            for w in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.5, 0), (0, 0.5, 0.5), (1 / 3, 1 / 3, 1 / 3))
        ]
    )
    for query, point in zip(queries, surface.nearest(queries), strict=True):
        assert (point.barycentric >= -1e-12).all()
        assert point.barycentric.sum() == pytest.approx(1.0)
        found = np.linalg.norm(point.position_m - query)
        best = np.linalg.norm(dense - query, axis=1).min()
        assert found <= best + 1e-12
        assert found >= best - 0.01


def test_a_point_of_the_surface_is_its_own_nearest_and_fields_are_linear() -> None:
    surface = BodySurface.from_depth(ball(), CAMERA)
    weights = np.array([0.2, 0.3, 0.5])
    points = [surface.point(t, weights) for t in range(0, len(surface.triangles), 97)]
    positions = surface.positions(points)
    for p, q in zip(points, surface.nearest(positions), strict=True):
        np.testing.assert_allclose(q.position_m, p.position_m, atol=1e-12)
    field = surface.vertices @ np.array([1.0, -2.0, 0.5]) + 3.0
    for p, x in zip(points, positions, strict=True):
        assert surface.interpolate(field, p) == pytest.approx(x @ [1.0, -2.0, 0.5] + 3.0)
        assert surface.interpolate(surface.vertices, p) == pytest.approx(x)


def test_nearest_vertices_are_found() -> None:
    surface = BodySurface.from_depth(ball(), CAMERA)
    picked = np.array([0, 17, len(surface.vertices) - 1])
    np.testing.assert_array_equal(surface.nearest_vertex(surface.vertices[picked] + 1e-6), picked)
    assert isinstance(surface.vertex_point(17), SurfacePoint)
    np.testing.assert_allclose(surface.vertex_point(17).position_m, surface.vertices[17], atol=1e-12)


@pytest.mark.parametrize("lens", [(), (0.02, -0.01, 0.001, 0.0)])
def test_vertices_within_reach_are_the_nearest_of_all(lens: tuple[float, ...]) -> None:
    camera = PinholeCamera(120, 90, 110.0, 110.0, 59.5, 44.5, lens)
    surface = BodySurface.from_depth(ball(), camera)
    rng = np.random.default_rng(2)
    near = surface.vertices[rng.integers(0, len(surface.vertices), 400)] + rng.normal(0, 0.04, (400, 3))
    aside = rng.uniform((-2.0, -2.0, 0.2), (2.0, 2.0, 4.2), (40, 3))
    points = np.concatenate([near, aside])
    away = np.linalg.norm(points[:, None] - surface.vertices[None], axis=2)
    for reach in (0.01, 0.05, 0.6):
        expected = np.where(away.min(axis=1) < reach, away.argmin(axis=1), -1)
        np.testing.assert_array_equal(surface.vertices_within(points, reach), expected)
    behind = surface.vertices_within([[0.0, 0.0, -0.5], [0.0, 0.0, 0.9]], 0.05)
    assert behind[0] == -1
    assert behind[1] >= 0


def test_nearest_points_come_one_by_one_or_as_arrays() -> None:
    surface = BodySurface.from_depth(ball(), CAMERA)
    queries = np.array([0, 0, 1.0]) + np.random.default_rng(3).normal(0, 0.3, (50, 3))
    triangles, weights, places = surface.nearest_arrays(queries)
    points = surface.nearest(queries)
    np.testing.assert_array_equal(triangles, [p.triangle for p in points])
    np.testing.assert_array_equal(weights, [p.barycentric for p in points])
    np.testing.assert_allclose(places, surface.positions(points), atol=1e-12)
    assert len(surface.nearest_arrays(np.zeros((0, 3)))[2]) == 0
    assert surface.nearest(np.zeros((0, 3))) == []
