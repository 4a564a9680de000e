"""Regions of 95 %: ellipses in the tangent plane, wider where less is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.relocation.bones import Bone
from core.relocation.spread import Spread, body_part, carried_spread, region_of, skin_basis
from core.relocation.tangent import tangent_basis

SIGMAS = st.floats(0.001, 0.05)
SEEDS = st.integers(0, 2**32 - 1)


def bone(name: str, rotation: np.ndarray | None = None) -> Bone:
    turn = np.eye(3) if rotation is None else rotation
    return Bone(name, np.zeros(3), np.array([0.0, 0.3, 0.0]), 0.09, turn, np.zeros(3))


@given(SIGMAS, SIGMAS, st.floats(0.0, np.pi), st.floats(0.5, 3.0), SEEDS)
@settings(max_examples=40, deadline=None)
def test_the_ellipse_is_that_of_the_covariance(one, two, angle, factor, seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    basis = tangent_basis(normal / np.linalg.norm(normal))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    covariance = turn @ np.diag([one**2, two**2]) @ turn.T
    region, radius = region_of(basis, covariance, factor)
    long, short = region.axes_m
    assert long >= short > 0
    assert radius == long
    assert sorted([long, short]) == pytest.approx(sorted([2.448 * factor * s for s in (one, two)]), rel=1e-3)
    assert np.linalg.norm(region.direction) == pytest.approx(1.0)
    assert region.direction @ normal == pytest.approx(0.0, abs=1e-9)
    if max(one, two) > 1.1 * min(one, two):
        axis = turn[:, 0 if one > two else 1] @ basis
        assert abs(region.direction @ axis) == pytest.approx(1.0, abs=1e-6)


def test_the_region_holds_95_percent_of_a_normal_law():
    rng = np.random.default_rng(0)
    basis = tangent_basis(np.array([0.0, 0.0, -1.0]))
    covariance = np.array([[0.010**2, 0.00004], [0.00004, 0.006**2]])
    region, _ = region_of(basis, covariance, 1.0)
    drawn = rng.multivariate_normal(np.zeros(2), covariance, 40_000) @ basis
    across = np.cross(region.direction, [0.0, 0.0, -1.0])
    inside = (drawn @ region.direction / region.axes_m[0]) ** 2 + (drawn @ across / region.axes_m[1]) ** 2 < 1
    assert inside.mean() == pytest.approx(0.95, abs=0.006)


def test_less_knowledge_means_a_wider_spread():
    basis = np.eye(3)[:2]
    base = carried_spread("trunk", False, 0.003, 0.0, 1.0, basis).mean_m
    assert carried_spread("trunk", True, 0.003, 0.0, 1.0, basis).mean_m > base, "another stance"
    assert carried_spread("trunk", False, 0.010, 0.0, 1.0, basis).mean_m > base, "no matched spot near"
    assert carried_spread("trunk", False, 0.003, 0.01, 1.0, basis).mean_m > base, "off the seen skin"
    assert carried_spread("trunk", False, 0.003, 0.0, 0.4, basis).mean_m > base, "steep to the camera"
    assert carried_spread("forearm", True, 0.003, 0.0, 1.0, basis).mean_m > base, "a limb that moved"
    assert np.isfinite(carried_spread("trunk", False, 0.003, 0.0, -1.0, basis).mean_m)


def test_a_limb_is_known_better_along_than_around():
    basis = skin_basis(np.array([0.0, 0.0, -1.0]), "forearm", bone("left_elbow to left_hand"))
    around, along = carried_spread("forearm", True, 0.003, 0.0, 1.0, basis).sigma_m
    assert around > along
    same = carried_spread("trunk", True, 0.003, 0.0, 1.0, basis).sigma_m
    assert same[0] == same[1]


@given(SEEDS, st.sampled_from(["trunk", "head", "forearm", "thigh"]))
@settings(max_examples=40, deadline=None)
def test_skin_directions_are_tangent_and_follow_the_moved_limb(seed, part):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    limb = bone("left_elbow to left_hand", Rotation.from_rotvec(rng.normal(size=3)).as_matrix())
    basis = skin_basis(normal, part, limb)
    assert basis @ basis.T == pytest.approx(np.eye(2), abs=1e-9)
    assert basis @ normal == pytest.approx(np.zeros(2), abs=1e-9)
    axis = limb.rotation @ np.array([0.0, 1.0, 0.0])
    if part in ("forearm", "thigh") and np.linalg.norm(np.cross(axis, normal)) > 0.3:
        assert basis[0] @ axis == pytest.approx(0.0, abs=1e-9)
        assert basis[1] @ axis > 0


def test_covariance_and_mean_of_a_spread():
    spread = Spread(np.eye(3)[:2], (0.03, 0.04))
    assert spread.covariance() == pytest.approx(np.diag([0.0009, 0.0016]))
    assert spread.mean_m == pytest.approx(np.sqrt(0.00125))


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("trunk", "trunk"),
        ("neck to head", "head"),
        ("left_shoulder to left_elbow", "upper arm"),
        ("right_elbow to right_hand", "forearm"),
        ("left_hip to left_knee", "thigh"),
        ("right_knee to right_foot", "lower leg"),
    ],
)
def test_every_bone_is_of_a_body_part(name, part):
    assert body_part(bone(name)) == part
