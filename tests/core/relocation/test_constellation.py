"""Moles matched as a constellation: smooth drifts are followed, chance neighbours are not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from core.relocation.constellation import (
    GATE,
    Side,
    drift_process,
    match_spots,
    mutual_best,
    vote_locally,
)

SEEDS = st.integers(0, 2**32 - 1)
TOWARD = np.array([0.0, 0.0, -1.0])


def scattered(rng: np.random.Generator, count: int, size_m: float, apart_m: float) -> np.ndarray:
    """Places (count, 3) of a flat piece of skin, none nearer to another than `apart_m`."""
    out: list[np.ndarray] = []
    while len(out) < count:
        place = np.append(rng.uniform(-size_m / 2, size_m / 2, 2), 2.0)
        if all(np.linalg.norm(place - other) > apart_m for other in out):
            out.append(place)
    return np.array(out)


def side_of(places: np.ndarray, drift_m: float = 0.006) -> Side:
    return Side(places, places, np.tile(TOWARD, (len(places), 1)), np.full(len(places), drift_m))


def smooth_drift(places: np.ndarray, rng: np.random.Generator, size_m: float) -> np.ndarray:
    """A shift, a turn and a stretch: skin that slid."""
    shift = np.append(rng.uniform(-0.7, 0.7, 2) * size_m, 0.0)
    slope = np.zeros((3, 3))
    slope[:2, :2] = rng.uniform(-1, 1, (2, 2)) * size_m / 0.25
    return shift + (places - [0.0, 0.0, 2.0]) @ slope.T


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_a_smooth_drift_is_followed_with_missed_and_extra_spots(seed):
    rng = np.random.default_rng(seed)
    places = scattered(rng, 60, 0.5, 0.022)
    moved = places + smooth_drift(places, rng, 0.010) + rng.normal(0, 0.0008, places.shape)
    kept = rng.permutation(60)[:50]
    extra = scattered(rng, 10, 0.5, 0.02)
    far = np.linalg.norm(extra[:, None] - moved[None], axis=2).min(axis=1) > 0.012
    spots = np.concatenate([moved[kept], extra[far]])
    found = match_spots(side_of(places), spots, np.zeros((60, len(spots))))
    truth = np.full(60, -1)
    truth[kept] = np.arange(50)
    matched = found.partner >= 0
    assert (found.partner[found.sure] == truth[found.sure]).mean() > 0.97
    assert (found.partner[kept] == np.arange(50)).mean() > 0.9
    assert (found.partner[matched] == truth[matched]).mean() > 0.9
    off = np.linalg.norm(found.expected - moved, axis=1)
    assert np.median(off) < 0.002
    assert np.median(found.sigma_m) < 0.005


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_matches_do_not_depend_on_where_the_patient_stands(seed):
    rng = np.random.default_rng(seed)
    places = scattered(rng, 30, 0.35, 0.025)
    spots = places[:25] + smooth_drift(places[:25], rng, 0.006) + rng.normal(0, 0.001, (25, 3))
    looks = rng.normal(0, 1, (30, 25))
    turn, shift = Rotation.from_rotvec(rng.normal(size=3)).as_matrix(), rng.normal(size=3)
    here = match_spots(side_of(places), spots, looks)
    there = match_spots(side_of(places @ turn.T + shift), spots @ turn.T + shift, looks)
    assert (here.partner == there.partner).all()
    assert (here.sure == there.sure).all()
    assert there.expected == pytest.approx(here.expected @ turn.T + shift, abs=1e-8)
    order = rng.permutation(25)
    mixed = match_spots(side_of(places), spots[order], looks[:, order])
    assert [order[p] if p >= 0 else -1 for p in mixed.partner] == here.partner.tolist()


def test_looks_decide_between_two_spots_that_lie_alike():
    places = scattered(np.random.default_rng(1), 12, 0.3, 0.05)
    twin = places[0] + np.array([[0.003, 0.0, 0.0], [-0.003, 0.0, 0.0]])
    spots = np.concatenate([twin, places[1:]])
    for wanted in (0, 1):
        looks = np.zeros((12, 13))
        looks[0, 1 - wanted] = 8.0
        assert match_spots(side_of(places), spots, looks).partner[0] == wanted
    doubt = match_spots(side_of(places), spots, np.zeros((12, 13)))
    assert not doubt.sure[0]


def test_certain_matches_are_kept_and_free_their_spots():
    places = scattered(np.random.default_rng(3), 10, 0.3, 0.05)
    spots = places + np.array([0.001, 0.0, 0.0])
    found = match_spots(side_of(places), spots, np.zeros((10, 10)), known={0: 5})
    assert found.partner[0] == 5
    assert found.sure[0]
    assert found.partner[5] != 5


def test_nothing_to_match_is_no_error():
    none = np.zeros((0, 3))
    assert len(match_spots(side_of(none), none, np.zeros((0, 0))).partner) == 0
    places = scattered(np.random.default_rng(0), 4, 0.2, 0.02)
    alone = match_spots(side_of(places), none, np.zeros((4, 0)))
    assert (alone.partner == -1).all()
    assert alone.expected == pytest.approx(places)
    one = match_spots(side_of(places[:1]), places[:1] + 0.001, np.zeros((1, 1)))
    assert one.partner.tolist() == [0]
    assert vote_locally(side_of(places[:2]), places, np.tile(TOWARD, (4, 1)), np.zeros((2, 4))) == {}


def test_a_spot_beyond_the_gate_is_another_one():
    places = scattered(np.random.default_rng(5), 8, 0.3, 0.06)
    side = side_of(places)
    spots = places.copy()
    spots[0] += [1.2 * GATE * 0.0067, 0.0, 0.0]
    assert match_spots(side, spots, np.zeros((8, 8))).partner[0] == -1


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_a_match_that_all_others_contradict_is_rejected(seed):
    """All skin slid to the right; one spot vanished, and a chance one lies to the left of where it was."""
    rng = np.random.default_rng(seed)
    places = scattered(rng, 40, 0.3, 0.03)
    middle = int(np.linalg.norm(places[:, :2], axis=1).argmin())
    slid = np.array([0.008, 0.0, 0.0])
    spots = places + slid + rng.normal(0, 0.0005, places.shape)
    spots[middle] = places[middle] - slid
    found = match_spots(side_of(places), spots, np.zeros((40, 40)))
    assert not found.sure[middle]
    assert found.partner[middle] == -1
    assert np.linalg.norm(found.expected[middle] - places[middle] - slid) < 0.002
    others = np.arange(40) != middle
    assert (found.partner[others] == np.flatnonzero(others)).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_wrong_match_among_few_does_not_drag_the_others(seed):
    """Seven spots a hand apart: the process alone would believe the wrong one; leaving it out tells."""
    rng = np.random.default_rng(seed)
    places = scattered(rng, 7, 0.24, 0.056)
    middle = int(np.linalg.norm(places[:, :2], axis=1).argmin())
    slid = np.array([0.008, 0.0, 0.0])
    spots = places + slid + rng.normal(0, 0.0005, places.shape)
    spots[middle] = places[middle] - slid
    found = match_spots(side_of(places), spots, np.zeros((7, 7)))
    assert not found.sure[middle]
    others = np.arange(7) != middle
    assert found.sure[others].all()
    assert np.linalg.norm(found.expected[middle] - places[middle] - slid) < 0.004


COSTS = st.tuples(st.integers(1, 7), st.integers(1, 7), SEEDS)


@given(COSTS)
@settings(max_examples=60, deadline=None)
def test_mutual_best_is_best_both_ways_and_inside_the_gate(case):
    rows, columns, seed = case
    cost = np.random.default_rng(seed).uniform(-2.0, 2.0 * GATE**2, (rows, columns))
    margin = 1.0
    partner, clear = mutual_best(cost, margin)
    for i in range(rows):
        j = int(cost[i].argmin())
        mutual = cost[:, j].argmin() == i and cost[i, j] < GATE**2
        assert partner[i] == (j if mutual else -1)
        rivals = np.concatenate([np.delete(cost[i], j), np.delete(cost[:, j], i)])
        assert clear[i] == (mutual and bool((rivals - cost[i, j] > margin).all()))
    taken = partner[partner >= 0]
    assert len(set(taken.tolist())) == len(taken)


def test_the_drift_is_known_near_matches_and_unknown_far_away():
    line = np.column_stack([np.linspace(0, 2, 41), np.zeros((41, 2))])
    rows = np.array([0, 2, 4])
    drift = np.tile([0.010, 0.0, 0.0], (3, 1))
    mean, sigma = drift_process(line, rows, drift, 0.02)
    assert mean[rows] == pytest.approx(drift, abs=0.001)
    assert sigma[rows].max() < 0.004
    assert (np.diff(sigma[4:]) > -1e-9).all(), "ever less is known farther away"
    assert sigma[-1] == pytest.approx(0.02, rel=0.01)
    assert np.linalg.norm(mean[-1]) < 1e-4


@given(SEEDS)
@settings(max_examples=8, deadline=None)
def test_neighbours_vote_for_a_patch_that_moved_far_among_distractors(seed):
    """A limb turned: its spots lie 60 mm away and turned by a quarter of a radian, among many others."""
    rng = np.random.default_rng(seed)
    places = scattered(rng, 26, 0.16, 0.014)
    turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-0.3, 0.3)]).as_matrix()
    way = rng.uniform(0, 2 * np.pi)
    shift = 0.06 * np.array([np.cos(way), np.sin(way), 0.0])
    centre = places.mean(axis=0)
    moved = (places - centre) @ turn.T + centre + shift + rng.normal(0, 0.0008, places.shape)
    seen = rng.permutation(26)[:23]
    others = scattered(rng, 25, 0.35, 0.012)
    free = np.linalg.norm(others[:, None] - moved[None], axis=2).min(axis=1) > 0.008
    spots = np.concatenate([moved[seen], others[free]])
    side = side_of(places, 0.007)
    looks = np.zeros((26, len(spots)))
    truth = np.full(26, -1)
    truth[seen] = np.arange(len(seen))
    alone = match_spots(side, spots, looks)
    assert (alone.partner[seen] == np.arange(len(seen))).mean() < 0.3, "beyond the reach of the drift process"
    voted = vote_locally(side, spots, np.tile(TOWARD, (len(spots), 1)), looks)
    right = sum(truth[i] == j for i, j in voted.items())
    assert right >= 0.7 * len(seen)
    assert right >= 0.9 * len(voted)
    assert len(set(voted.values())) == len(voted)


@given(SEEDS)
@settings(max_examples=8, deadline=None)
def test_chance_constellations_get_no_votes(seed):
    rng = np.random.default_rng(seed)
    places, spots = scattered(rng, 25, 0.3, 0.02), scattered(rng, 25, 0.3, 0.02)
    assert pdist(spots).min() > 0.02
    voted = vote_locally(side_of(places), spots, np.tile(TOWARD, (25, 1)), np.zeros((25, 25)))
    assert len(voted) <= 3
