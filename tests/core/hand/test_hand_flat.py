"""A hand laid flat: the plane that learned distances come from, and how they may change."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.hand.flat import (
    SIZE_SHARE,
    FlatHand,
    changes_between_frames,
    changes_between_people,
    lay_flat,
)
from core.hand.names import FINGER_OF, PAIRS
from tests.core.hand.made_up_hands import Glove

FloatArray = NDArray[np.float64]

I, J = np.array(PAIRS).T  # noqa: E741
seeds = st.integers(0, 2**32 - 1)


def hand(seed: int, anchors: int = 4) -> FlatHand:
    """Points in the plane as far apart as those of a hand."""
    rng = np.random.default_rng(seed)
    return FlatHand(
        rng.uniform((-0.09, -0.12), (0.09, 0.06), (15, 2)), rng.uniform(-0.025, 0.025, (anchors, 2))
    )


def glove() -> FlatHand:
    return FlatHand(*Glove().plane())


def parts(distances: FloatArray, anchors: int = 4) -> tuple[FloatArray, FloatArray]:
    return distances[: 15 * anchors].reshape(15, anchors), distances[15 * anchors :]


@given(seed=seeds, anchors=st.integers(3, 5))
@settings(max_examples=10, deadline=None)
def test_distances_of_a_plane_are_reproduced(seed: int, anchors: int) -> None:
    """But for those between anchors, which nobody measures: three of them hold the plane all the same."""
    wanted = hand(seed, anchors).distances()
    found = lay_flat(*parts(wanted, anchors)).distances()
    np.testing.assert_allclose(found, wanted, atol=0.0015)
    assert np.abs(found - wanted).mean() < 0.0002


@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_of_noisy_distances_no_plane_agrees_better_than_the_one_found(seed: int) -> None:
    """At least not the one they came from."""
    true = hand(seed)
    rng = np.random.default_rng(seed)
    noisy = np.maximum(true.distances() + rng.normal(0.0, 0.004, 165), 0.001)
    found = lay_flat(*parts(noisy))
    stress = [float(((flat.distances() - noisy) ** 2).sum()) for flat in (found, true)]
    assert stress[0] < stress[1]


def test_distances_that_were_not_measured_are_those_of_the_plane() -> None:
    wanted = glove().distances()
    gaps = np.random.default_rng(4).random(wanted.shape) < 0.3
    found = lay_flat(*parts(np.where(gaps, np.nan, wanted))).distances()
    assert gaps.sum() > 30
    np.testing.assert_allclose(found[gaps], wanted[gaps], atol=0.003)


def test_a_point_of_which_too_little_is_known_has_no_place() -> None:
    anchor_m, pair_m = parts(glove().distances())
    anchor_m[4, 2:] = np.nan
    pair_m[(I == 4) | (J == 4)] = np.nan
    found = lay_flat(anchor_m, pair_m)
    assert np.isnan(found.points_m[4]).all()
    assert np.isfinite(np.delete(found.points_m, 4, axis=0)).all()
    known = (I != 4) & (J != 4)
    np.testing.assert_allclose(parts(found.distances())[1][known], pair_m[known], atol=0.001)


def test_changes_of_what_has_no_place_are_nothing() -> None:
    flat = glove()
    points = flat.points_m.copy()
    points[7] = np.nan
    change = FlatHand(points, flat.anchors_m).change(0.1 * points, np.zeros((4, 2)))
    anchor, pair = parts(change)
    assert np.isfinite(change).all()
    assert not anchor[7].any()
    assert not pair[(I == 7) | (J == 7)].any()
    assert pair[(I != 7) & (J != 7)].all()


@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_a_change_is_the_difference_that_a_small_motion_makes(seed: int) -> None:
    flat, rng = hand(seed), np.random.default_rng(seed)
    points, anchors = rng.normal(0.0, 0.002, (15, 2)), rng.normal(0.0, 0.002, (4, 2))
    moved = FlatHand(flat.points_m + 0.01 * points, flat.anchors_m + 0.01 * anchors)
    difference = moved.distances() - flat.distances()
    # linear: what moves by a part of its own distance is left out
    apart = flat.distances() > 0.005
    assert apart.mean() > 0.8
    np.testing.assert_allclose((0.01 * flat.change(points, anchors))[apart], difference[apart], atol=2e-6)


def test_a_larger_hand_with_the_same_marker() -> None:
    flat = glove()
    size = changes_between_people(flat, rigid_anchors=True)[0]
    anchor, pair = parts(size)
    np.testing.assert_allclose(pair, SIZE_SHARE * parts(flat.distances())[1], rtol=1e-3)
    assert (anchor[[0, 3, 6, 9, 12]] > 0.004).all()
    # a marker that does not grow: nearly so for what is far from it
    np.testing.assert_allclose(anchor[6], SIZE_SHARE * parts(flat.distances())[0][6], rtol=0.2)


def test_a_larger_hand_has_its_palm_farther_apart_too() -> None:
    flat = glove()
    size = changes_between_people(flat, rigid_anchors=False)[0]
    np.testing.assert_allclose(size, SIZE_SHARE * flat.distances(), rtol=1e-3, atol=1e-6)


def test_a_marker_that_sits_elsewhere_changes_no_distance_between_points() -> None:
    rows = changes_between_people(glove(), rigid_anchors=True)[1:]
    assert len(rows) == 3
    for row in rows:
        anchor, pair = parts(row)
        assert not pair.any()
        assert 0.0005 < np.abs(anchor).max() < 0.006
    along = parts(rows[1])[0]
    # the middle fingertip lies straight up from the marker: as much farther, or nearer, from every corner
    np.testing.assert_allclose(along[6], along[6].mean(), rtol=0.06)


def test_anchors_of_a_palm_stray_one_by_one() -> None:
    rows = changes_between_frames(glove(), rigid_anchors=False)[:8]
    for k, row in enumerate(rows):
        anchor, pair = parts(row)
        assert not pair.any()
        assert anchor[:, k // 2].any()
        assert not np.delete(anchor, k // 2, axis=1).any()


@pytest.mark.parametrize(("rigid", "before"), [(True, 0), (False, 8)])
def test_a_finger_that_is_spread_or_longer_concerns_no_other_two(rigid: bool, before: int) -> None:
    rows = changes_between_frames(glove(), rigid_anchors=rigid)
    assert len(rows) == before + 10
    finger = np.array(FINGER_OF)
    for number in range(5):
        spread, stretch = rows[before + 2 * number : before + 2 * number + 2]
        own = (finger[I] == number) & (finger[J] == number)
        others = (finger[I] != number) & (finger[J] != number)
        for row in (spread, stretch):
            anchor, pair = parts(row)
            assert not pair[others].any()
            assert not anchor[finger != number].any()
            assert np.abs(anchor[3 * number]).max() > 0.0005
        np.testing.assert_allclose(parts(spread)[1][own], 0.0, atol=2e-6)
        assert (parts(stretch)[1][own] > 0.0005).all()
