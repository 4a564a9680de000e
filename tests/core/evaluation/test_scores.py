"""Answers and spots against the truth."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from core.evaluation import LesionScore, SpotScore, TrueLesion, score_lesions, score_spots
from core.evaluation.scores import SPOT_MATCH_M, is_in_region
from core.relocation import Region, RelocatedLesion, RelocationResult, Spot


class FlatSkin:
    """A wall at z = 2 that faces the camera."""

    def nearest(self, points):
        return [SimpleNamespace(position_m=np.asarray(points, float))]

    def normal_at(self, point):
        return np.array([0.0, 0.0, -1.0])


def place(x_mm=0.0, y_mm=0.0):
    return np.array([x_mm / 1000, y_mm / 1000, 2.0])


def case_of(*lesions, moles=()):
    ids = tuple(name for name, _ in moles)
    return SimpleNamespace(
        lesions=lesions,
        mole_ids=ids,
        moles_m=np.array([p for _, p in moles]).reshape(-1, 3),
        first_joints_m={},
        followup_joints_m={},
        followup=SimpleNamespace(scan=SimpleNamespace(surface=FlatSkin())),
    )


def hidden(name="L1", at=None):
    """Hidden lesions never ask the sensor, so that a score needs no camera."""
    return TrueLesion(name, (5.0, 5.0), place(), place() if at is None else at, (5.0, 5.0), visible=False)


def answer(point, name="L1", radius=0.02, region=None, status="predicted"):
    return RelocatedLesion(name, status, "", point_m=point, radius95_m=radius, region=region, confidence=0.7)


def score(point, *, moles=(), region=None):
    result = RelocationResult("m", (answer(point, region=region),))
    return score_lesions(case_of(hidden(), moles=moles), result)[0]


def test_the_error_is_the_distance_in_space():
    assert score(place(3, 4)).error_m == pytest.approx(0.005)


def test_a_lesion_is_mistaken_when_another_mole_is_nearer_and_its_own_is_not_met():
    moles = (("L1", place()), ("M1", place(12, 0)))
    assert score(place(10, 0), moles=moles).wrong_lesion is True
    assert score(place(5.5, 0), moles=moles).wrong_lesion is False
    assert score(place(-10, 0), moles=moles).wrong_lesion is False


def test_within_five_millimetres_the_right_lesion_is_chosen_whatever_lies_beside_it():
    moles = (("L1", place()), ("M1", place(4.5, 0)))
    assert score(place(4.4, 0), moles=moles).wrong_lesion is False


def test_nobody_can_be_mistaken_without_other_moles():
    assert score(place(50, 0), moles=(("L1", place()),)).wrong_lesion is None


def test_no_place_has_no_error_and_is_no_answer():
    result = RelocationResult("m", (RelocatedLesion("L1", "not_visible", "turned away"),))
    only = score_lesions(case_of(hidden()), result)[0]
    assert (only.error_m, only.radius95_m, only.answered) == (None, None, False)


def test_a_place_for_a_lesion_whose_truth_is_unknown_is_an_answer_without_an_error():
    result = RelocationResult("m", (answer(place()),))
    only = score_lesions(case_of(hidden(at=np.full(3, np.nan))), result)[0]
    assert only.answered
    assert only.error_m is None


def test_the_ellipse_is_measured_in_the_tangent_plane():
    region = Region((0.020, 0.005), np.array([1.0, 0.0, 0.0]))
    assert score(place(18, 0), region=region).in_region is True
    assert score(place(0, 18), region=region).in_region is False
    deep = place(18, 0) + np.array([0.0, 0.0, 0.03])
    assert is_in_region(place(), deep, region, FlatSkin())


def test_scores_survive_json():
    region = Region((0.020, 0.005), np.array([0.0, 1.0, 0.0]))
    one = score(place(18, 0), region=region)
    assert LesionScore.from_json(json.loads(json.dumps(one.to_json()))) == one


def test_every_true_spot_counts_once():
    true = np.array([place(0), place(100), place(200)])
    listed = [place(1), place(-2), place(103), place(150)]
    spots = [Spot((0.0, 0.0), p, 0.9) for p in listed]
    assert score_spots(spots, true) == SpotScore(listed=4, true=3, right=2)


def test_two_spots_beside_each_other_are_both_found():
    true = np.array([place(0), place(6)])
    spots = [Spot((0.0, 0.0), place(5), 0.9), Spot((0.0, 0.0), place(-1), 0.9)]
    assert SPOT_MATCH_M > 0.006
    assert score_spots(spots, true).right == 2


def test_nothing_listed_and_nothing_there():
    assert score_spots([], np.zeros((0, 3))) == SpotScore(0, 0, 0)
    assert score_spots([], np.zeros((2, 3))) == SpotScore(0, 2, 0)
