"""Robust trilateration: sub-vertex, insensitive to a wrong anchor, honest about twins and spread."""

from __future__ import annotations

import numpy as np
import pytest

from core.relocation.trilateration import (
    SkinField,
    cost_field,
    neighbourhood_cost,
    trilaterate,
    vertex_areas,
)

SIGMA = 0.02


def field_of(sheet, anchors, noise=0.0):
    distances = sheet.distances(anchors)
    if noise:
        distances = distances + np.random.default_rng(0).normal(0, noise, distances.shape)
    areas = vertex_areas(sheet.vertices, sheet.triangles)
    return SkinField(distances.astype(np.float32), sheet.vertices, areas, sheet.boundary)


def on_cylinder(place):
    angle = (place[0] - 0.3) / 0.25
    return np.array([0.25 * np.sin(angle), place[1], 2.25 - 0.25 * np.cos(angle)])


@pytest.mark.parametrize("place", [(0.203, 0.304), (0.457, 0.611), (0.318, 0.126)])
def test_a_place_between_vertices_is_found_on_rolled_skin_within_a_third_of_their_spacing(
    rolled_sheet, anchors, place
):
    lesion = np.linalg.norm(anchors - place, axis=1)
    fix = trilaterate(field_of(rolled_sheet, anchors), lesion, np.full(len(anchors), 0.005))
    assert fix is not None
    assert np.linalg.norm(fix.point_m - on_cylinder(place)) < 0.0033
    assert fix.inliers == fix.used == len(anchors)
    assert not fix.others


def test_one_wrong_anchor_does_not_pull_the_answer_away(flat_sheet, anchors):
    place = np.array([0.30, 0.50])
    lesion = np.linalg.norm(anchors - place, axis=1)
    lesion[1] += 0.25
    fix = trilaterate(field_of(flat_sheet, anchors), lesion, np.full(len(anchors), SIGMA))
    assert fix is not None
    assert np.linalg.norm(fix.point_m[:2] - place) < 0.01
    assert fix.inliers == len(anchors) - 1


def test_anchors_on_a_line_leave_two_mirrored_places_and_the_skeleton_decides(flat_sheet):
    line = np.array([[0.3, y] for y in (0.1, 0.3, 0.5, 0.7)])
    place = np.array([0.45, 0.40])
    lesion = np.linalg.norm(line - place, axis=1)
    field = field_of(flat_sheet, line)
    fix = trilaterate(field, lesion, np.full(4, SIGMA))
    assert fix is not None
    assert len(fix.others) == 1
    twins = sorted([flat_sheet.flat[fix.best_vertex][0], flat_sheet.flat[fix.others[0][0]][0]])
    assert twins == pytest.approx([0.15, 0.45], abs=0.011)
    near = neighbourhood_cost(flat_sheet.vertices, np.array([0.15, 0.42, 2.0]), 0.1)
    decided = trilaterate(field, lesion, np.full(4, SIGMA), extra_cost=near)
    assert decided is not None
    assert not decided.others
    assert decided.point_m[0] == pytest.approx(0.15, abs=0.01)


def test_the_spread_grows_with_the_anchors_errors(flat_sheet, anchors):
    lesion = np.linalg.norm(anchors - [0.3, 0.5], axis=1)
    field = field_of(flat_sheet, anchors)
    narrow, wide = (trilaterate(field, lesion, np.full(len(anchors), s)) for s in (0.01, 0.04))
    assert narrow is not None
    assert wide is not None
    assert 1.5 * narrow.spread_m < wide.spread_m


def test_an_anchor_that_was_not_connected_takes_no_part(flat_sheet, anchors):
    lesion = np.linalg.norm(anchors - [0.3, 0.5], axis=1)
    with_gap = lesion.copy()
    with_gap[0] = np.inf
    field = field_of(flat_sheet, anchors)
    fix = trilaterate(field, with_gap, np.full(len(anchors), SIGMA))
    less = SkinField(field.distances[1:], field.vertices, field.areas, field.boundary)
    same = trilaterate(less, lesion[1:], np.full(len(anchors) - 1, SIGMA))
    assert fix is not None
    assert same is not None
    assert np.allclose(fix.point_m, same.point_m)
    assert trilaterate(field, np.full(len(anchors), np.inf), np.full(len(anchors), SIGMA)) is None


def test_the_cost_is_that_of_a_student_t_law():
    distances = np.array([[0.30], [0.52]], np.float32)
    lesion, sigma = np.array([0.32, 0.50]), np.array([0.01, 0.04])
    expected = sum(4 * np.log(1 + r**2 / 3) for r in (2.0, 0.5))
    assert cost_field(distances, lesion, sigma)[0] == pytest.approx(expected, rel=1e-3)


def test_fifty_anchors_that_all_disagree_stay_finite():
    cost = cost_field(np.zeros((50, 3), np.float32), np.full(50, 9.0), np.full(50, 0.001))
    assert np.isfinite(cost).all()


def test_areas_share_the_sheet(flat_sheet):
    areas = vertex_areas(flat_sheet.vertices, flat_sheet.triangles)
    assert areas.sum() == pytest.approx(0.6 * 0.8)
    assert areas[~flat_sheet.boundary].mean() == pytest.approx(1e-4)
