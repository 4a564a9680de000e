"""Anchors are shifted until their mutual geodesics agree between the visits."""

from __future__ import annotations

import numpy as np
import pytest

from core.relocation.bones import minimal_rotation, rigid_fit
from core.relocation.isometry import residual_sigma, solve_shifts
from core.relocation.tangent import tangent_slopes


def mutual(places):
    return np.linalg.norm(places[:, None] - places[None], axis=2)


def unit_slopes(places):
    away = places[:, None] - places[None]
    length = np.linalg.norm(away, axis=2, keepdims=True)
    return np.where(length > 0, away / np.maximum(length, 1e-12), np.nan)


@pytest.fixture
def true_places():
    rng = np.random.default_rng(3)
    return rng.uniform(0, 1, (12, 2))


def test_a_single_misplaced_anchor_is_moved_back(true_places):
    seen = true_places.copy()
    seen[4] += [0.03, -0.02]
    first, second = mutual(true_places), mutual(seen)
    shifts, sigma = solve_shifts(
        first, second, unit_slopes(seen), np.full(12, 0.03), residual_sigma(first, 0.01, 0.002)
    )
    assert shifts[4] == pytest.approx([-0.03, 0.02], abs=0.005)
    assert np.abs(np.delete(shifts, 4, axis=0)).max() < 0.006
    assert (sigma < 0.03).all()


def test_anchors_that_agree_stay(true_places):
    first = mutual(true_places)
    shifts, _ = solve_shifts(
        first, first, unit_slopes(true_places), np.full(12, 0.03), residual_sigma(first, 0.01, 0.002)
    )
    assert np.abs(shifts).max() < 1e-9


def test_a_pair_whose_skin_folded_is_outvoted(true_places):
    first, second = mutual(true_places), mutual(true_places)
    second[2, 7] = second[7, 2] = second[2, 7] + 0.2
    shifts, _ = solve_shifts(
        first, second, unit_slopes(true_places), np.full(12, 0.03), residual_sigma(first, 0.01, 0.002)
    )
    assert np.abs(shifts).max() < 0.005


def test_pairs_that_are_not_connected_say_nothing(true_places):
    first, second = mutual(true_places), mutual(true_places)
    first[0, 1:] = first[1:, 0] = np.inf
    shifts, sigma = solve_shifts(
        first, second, unit_slopes(true_places), np.full(12, 0.03), residual_sigma(first, 0.01, 0.002)
    )
    assert np.isfinite(shifts).all()
    assert sigma[0] == pytest.approx(0.03, rel=1e-3)


def test_the_slope_of_a_distance_field_points_away_from_its_anchor(flat_sheet):
    anchor = np.array([[0.1, 0.2]])
    vertex = int(np.linalg.norm(flat_sheet.flat - [0.4, 0.6], axis=1).argmin())
    normals = np.tile([0.0, 0.0, -1.0], (len(flat_sheet.vertices), 1))
    model = tangent_slopes(flat_sheet.distances(anchor), flat_sheet.vertices, normals, vertex)
    assert model.slopes[0] @ model.basis == pytest.approx([0.6, 0.8, 0.0], abs=0.01)


def test_rotations_of_bones():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 3))
    turned = minimal_rotation(a, b) @ a
    assert turned / np.linalg.norm(turned) == pytest.approx(b / np.linalg.norm(b))
    back = minimal_rotation(a, -a)
    assert back @ a == pytest.approx(-a)
    assert np.linalg.det(back) == pytest.approx(1.0)
    points = rng.normal(size=(6, 3))
    rotation = minimal_rotation(a, b)
    fitted, shift = rigid_fit(points, points @ rotation.T + [1, 2, 3])
    assert fitted == pytest.approx(rotation)
    assert shift == pytest.approx([1, 2, 3])
