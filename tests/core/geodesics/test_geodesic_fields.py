"""Distances between the vertices: exact where the skin unfolds flat, also beside the anchor."""

import numpy as np
import pytest

from core.errors import InputError
from core.geodesics import GeodesicFields, geodesic_fields


@pytest.fixture(scope="module")
def fields(plane):
    anchors = {"chest": plane.point(3000, [0.3, 0.3, 0.4]), "elbow": plane.vertex_point(1234)}
    return geodesic_fields(plane, anchors), anchors


def test_between_the_vertices_the_plane_is_exact(plane, fields):
    rng = np.random.default_rng(1)
    points = [plane.point(t, rng.dirichlet([1, 1, 1])) for t in rng.integers(0, len(plane.triangles), 300)]
    places = np.array([p.position_m for p in points])
    for row, anchor in zip(fields[0].at(points), fields[1].values(), strict=True):
        truth = plane.true_distance(anchor.position_m, places)
        assert np.abs(row - truth).max() < 2e-4  # a hundredth of an edge
        assert np.abs(row - truth).mean() < 5e-6


def test_in_and_beside_the_anchors_own_triangle_the_distance_is_the_straight_one(plane, fields):
    anchor = fields[1]["chest"]
    corners = plane.triangles[3000]
    beside = np.flatnonzero(np.isin(plane.triangles, corners).any(axis=1))
    rng = np.random.default_rng(2)
    points = [plane.point(t, rng.dirichlet([1, 1, 1])) for t in np.repeat(beside, 5)]
    truth = plane.true_distance(anchor.position_m, np.array([p.position_m for p in points]))
    assert fields[0].at(points)[0] == pytest.approx(truth, abs=1e-6)
    assert fields[0].at([anchor])[0, 0] == pytest.approx(0.0, abs=1e-6)


def test_at_a_vertex_the_field_has_the_vertexs_value(plane, fields):
    values = fields[0].at([plane.vertex_point(v) for v in (0, 77, 3599)])
    assert values == pytest.approx(fields[0].distances[:, [0, 77, 3599]], rel=1e-12)


def test_on_curved_skin_values_between_vertices_are_as_good_as_at_them(shape):
    anchor = shape.point(9000, [0.6, 0.2, 0.2])
    field = geodesic_fields(shape, {"a": anchor})
    rng = np.random.default_rng(3)
    points = [shape.point(t, rng.dirichlet([1, 1, 1])) for t in rng.integers(0, len(shape.triangles), 300)]
    truth = shape.true_distance(anchor.position_m, np.array([p.position_m for p in points]))
    assert (np.abs(field.at(points)[0] - truth) / truth).mean() < 0.0008


def test_distances_are_named_and_in_order(plane, fields):
    assert fields[0].names == ("chest", "elbow")
    assert fields[0].of("elbow")[1234] == 0.0
    with pytest.raises(InputError, match="'knee'"):
        fields[0].of("knee")


def test_unreachable_corners_make_a_point_unreachable_unless_it_has_no_part_in_them():
    triangles = np.array([[0, 1, 2]], np.int32)
    vertices = np.eye(3)
    field = GeodesicFields(("a",), np.array([[1.0, 1.0, np.inf]]), vertices, triangles)

    def point(weights):
        from core.surface.points import SurfacePoint

        return SurfacePoint(0, np.array(weights), np.zeros(3))

    values = field.at([point([0.4, 0.4, 0.2]), point([0.5, 0.5, 0.0])])[0]
    assert np.isinf(values[0])
    assert np.isfinite(values[1])
    assert field.at([]).shape == (1, 0)


def test_fields_of_another_size_are_refused():
    with pytest.raises(InputError, match="2 anchors"):
        GeodesicFields(("a", "b"), np.zeros((1, 3)), np.zeros((3, 3)), np.zeros((0, 3), np.int32))
