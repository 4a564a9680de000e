"""Where a hand has gone without its marker: motions of anchors, and of a made-up hand by its surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from core.capture import RigidTransform
from core.hand.following import LastSeen, follow, motion_between
from tests.core.hand.made_up_hands import (
    BALL_ANCHORS_M,
    BALLS_M,
    CAMERA,
    depth_of_balls,
    surface_of_balls,
)

FloatArray = NDArray[np.float64]

BEFORE = RigidTransform(Rotation.from_euler("xyz", (5.0, -8.0, 12.0), True).as_matrix(), [0.02, 0.01, 0.62])
FINGER = range(9, 13)

seeds = st.integers(0, 2**32 - 1)
angles = st.tuples(*[st.floats(-9.0, 9.0)] * 3)
steps = st.tuples(*[st.floats(-0.012, 0.012)] * 3)


@lru_cache(maxsize=1)
def last_seen() -> LastSeen:
    return LastSeen.of(surface_of_balls(BEFORE), BEFORE.apply(BALL_ANCHORS_M))


def moved_by(degrees: tuple[float, ...], step_m: tuple[float, ...]) -> RigidTransform:
    """A motion in the camera's frame that turns the hand about its own middle."""
    turn = Rotation.from_euler("xyz", degrees, True).as_matrix()
    middle = BEFORE.translation
    return RigidTransform(turn, middle - turn @ middle + np.array(step_m))


def off(found: RigidTransform, true: RigidTransform) -> FloatArray:
    """How far (n,) the hand's balls lie beside their true places."""
    before = BEFORE.apply(BALLS_M)
    return np.linalg.norm(found.apply(before) - true.apply(before), axis=1)


@given(seed=seeds, count=st.integers(3, 6))
@settings(max_examples=50, deadline=None)
def test_a_rigid_motion_of_anchors_is_recovered(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    before = rng.normal(0.0, 0.03, (count, 3)) + np.array((0.0, 0.0, 0.7))
    motion = RigidTransform(Rotation.random(random_state=seed % 2**31).as_matrix(), rng.normal(0.0, 0.3, 3))
    found = motion_between(before, motion.apply(before))
    np.testing.assert_allclose(found.apply(before), motion.apply(before), atol=1e-9)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)
    if np.linalg.svd(before - before.mean(axis=0))[1][1] > 1e-3:  # not all in a line
        np.testing.assert_allclose(found.rotation, motion.rotation, atol=1e-6)


def test_anchors_that_are_missing_before_or_after_do_not_count() -> None:
    rng = np.random.default_rng(3)
    before = rng.normal(0.0, 0.03, (5, 3))
    motion = moved_by((20.0, 0.0, -30.0), (0.1, 0.2, -0.1))
    after = motion.apply(before)
    before[0], after[4] = np.nan, np.nan
    np.testing.assert_allclose(motion_between(before, after).matrix, motion.matrix, atol=1e-9)
    before[1] = np.nan
    np.testing.assert_array_equal(motion_between(before, after).matrix, np.eye(4))


@given(seed=seeds)
@settings(max_examples=20, deadline=None)
def test_no_motion_mirrors_a_hand(seed: int) -> None:
    before = np.random.default_rng(seed).normal(0.0, 0.03, (5, 3))
    found = motion_between(before, before * (-1.0, 1.0, 1.0))
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-9)


def test_what_is_kept_of_a_hand_is_its_skin_near_the_anchors() -> None:
    surface = surface_of_balls(BEFORE)
    kept = LastSeen.of(surface, BEFORE.apply(BALL_ANCHORS_M), reach_m=0.06)
    centre = BEFORE.apply(BALL_ANCHORS_M).mean(axis=0)
    assert 100 < len(kept.inner_m) < 1800
    assert np.linalg.norm(kept.inner_m - centre, axis=1).max() < 0.06
    assert 20 < len(kept.rim_m) < 400
    assert not {tuple(p) for p in kept.rim_m} & {tuple(p) for p in kept.inner_m}
    of_four = BEFORE.apply(np.vstack([BALL_ANCHORS_M, [(0.0, 0.0, 0.0)]]))
    of_four[3] = np.nan
    np.testing.assert_array_equal(LastSeen.of(surface, of_four, reach_m=0.06).inner_m, kept.inner_m)


@given(degrees=angles, step_m=steps)
@settings(max_examples=12, deadline=None)
def test_a_small_motion_is_recovered(degrees: tuple[float, ...], step_m: tuple[float, ...]) -> None:
    true = moved_by(degrees, step_m)
    found = follow(last_seen(), depth_of_balls(true @ BEFORE), CAMERA, [RigidTransform()])
    assert found is not None
    assert off(found, true).max() < 0.003


def test_a_motion_that_is_expected_may_be_large() -> None:
    true = moved_by((25.0, -20.0, 50.0), (0.10, -0.05, 0.12))
    guess = moved_by((20.0, -15.0, 45.0), (0.092, -0.055, 0.115))
    found = follow(last_seen(), depth_of_balls(true @ BEFORE), CAMERA, [guess])
    assert found is not None
    assert off(guess, true).max() > 0.012
    assert off(found, true).max() < 0.003


def test_noise_hardly_moves_it() -> None:
    true = moved_by((4.0, -3.0, 6.0), (0.008, 0.004, -0.006))
    depth = depth_of_balls(true @ BEFORE)
    noisy = np.round(depth + np.random.default_rng(1).normal(0.0, 0.002, depth.shape), 3)
    found = follow(last_seen(), noisy, CAMERA, [RigidTransform()])
    assert found is not None
    assert off(found, true).max() < 0.004


def test_a_finger_that_has_bent_away_hardly_moves_it() -> None:
    true = moved_by((3.0, 2.0, -5.0), (0.006, -0.004, 0.005))
    depth = depth_of_balls(true @ BEFORE, without=FINGER)
    found = follow(last_seen(), depth, CAMERA, [RigidTransform()])
    assert found is not None
    assert off(found, true)[:9].max() < 0.0025


def test_something_before_a_third_of_the_hand_does_not_pull_it_away() -> None:
    true = moved_by((3.0, 2.0, -5.0), (0.006, -0.004, 0.005))
    depth = depth_of_balls(true @ BEFORE)
    u = int(CAMERA.project(np.array([BEFORE.translation]))[0, 0])
    depth[:, u + 8 : u + 22] = 0.45
    found = follow(last_seen(), depth, CAMERA, [RigidTransform()])
    assert found is not None
    assert off(found, true).max() < 0.004


@pytest.mark.parametrize("wall_m", [0.0, 0.75, 1.2])
def test_where_there_is_no_hand_none_is_followed(wall_m: float) -> None:
    depth = np.full((CAMERA.height, CAMERA.width), wall_m)
    assert follow(last_seen(), depth, CAMERA, [RigidTransform()]) is None


def test_a_hand_that_has_left_the_picture_is_not_followed() -> None:
    away = moved_by((0.0, 0.0, 0.0), (1.5, 0.0, 0.0))
    assert follow(last_seen(), depth_of_balls(away @ BEFORE), CAMERA, [away]) is None
    behind = moved_by((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    assert follow(last_seen(), depth_of_balls(BEFORE), CAMERA, [behind]) is None


def test_a_finger_that_is_left_of_a_hand_is_no_hand() -> None:
    rest = np.setdiff1d(np.arange(len(BALLS_M)), FINGER)
    depth = depth_of_balls(BEFORE, without=[int(k) for k in rest])
    assert follow(last_seen(), depth, CAMERA, [RigidTransform()]) is None
