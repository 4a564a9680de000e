"""The frames of the hand experiments: drawn once, the same again; learned and tested hands kept apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.evaluate_hand import without_nan
from app.cli.hand_experiment_sets import FULL, QUICK, TESTING, TRAINING, hand_sets
from app.cli.simulated_hands import Motion, Stills, cache_folder
from core.evaluation.hand.frames import TrueFrame
from devices.simulator.hands.shots import Holder
from devices.simulator.shapes import TEST_SHAPES, TUNING_SHAPES
from tests.app.cli.cases import assert_told, geoderm


def same(one: TrueFrame, other: TrueFrame) -> bool:
    return (
        one.name == other.name
        and one.labels.configuration == other.labels.configuration
        and one.remark == other.remark
        and np.array_equal(one.capture.depth_frames, other.capture.depth_frames)
        and np.array_equal(one.capture.color, other.capture.color)
        and np.array_equal(one.points_m, other.points_m)
        and np.array_equal(one.visible, other.visible)
        and one.capture.rig == other.capture.rig
    )


def test_a_kept_frame_is_the_frame_that_was_drawn(tmp_path: Path) -> None:
    folder = cache_folder(tmp_path)
    stills = Stills("test", Holder("child10", seed=3), ("open",), 1, 11, TESTING, folder)
    (drawn,) = stills
    (kept,) = stills
    (again,) = replace(stills, cache=None)
    assert len(list(folder.rglob("*.npz"))) == 1
    assert same(drawn, kept)
    assert same(drawn, again)


def test_a_sequence_that_was_stopped_goes_on_with_the_frames_that_are_kept(tmp_path: Path) -> None:
    motion = Motion(
        "large-displacements", Holder("f_22_thin", seed=4), 3, 7, rate_hz=15.0, cache=cache_folder(tmp_path)
    )
    frames = iter(motion)
    begun = [next(frames), next(frames)]
    frames.close()
    whole = list(motion)
    assert [frame.name for frame in whole] == [f"large-displacements_f_22_thin_{k:04d}" for k in range(3)]
    assert all(same(one, other) for one, other in zip(begun, whole, strict=False))
    assert same(whole[2], list(replace(motion, cache=None))[2])


@pytest.mark.parametrize("plan", [FULL, QUICK])
def test_hands_that_are_learned_from_are_never_tested_on(plan: object) -> None:
    for tuning in (False, True):
        sets = hand_sets(None, plan, tuning=tuning)
        learned = {one.body for one in (*sets.training, *sets.bare_training)}
        stills = (*sets.test, *sets.bare_test)
        moving = (*sets.large, *sets.changing, *sets.occluded, *sets.bottle, *sets.lost)
        tested = {one.body for one in (*stills, *moving)}
        assert not learned & tested
        assert learned <= set(TUNING_SHAPES)
        assert tested <= set(TUNING_SHAPES if tuning else TEST_SHAPES)


def test_test_views_are_other_views_than_those_learned_from() -> None:
    assert TESTING.tilt_deg > TRAINING.tilt_deg
    assert TESTING.roll_deg > TRAINING.roll_deg
    assert TESTING.distance_m[0] < TRAINING.distance_m[0]
    assert TESTING.distance_m[1] > TRAINING.distance_m[1]
    sets = hand_sets(None)
    seeds = [{one.holder.seed for one in some} for some in (sets.training, sets.test)]
    assert not seeds[0] & seeds[1]


def test_bare_hands_are_the_same_hands_in_the_same_views_without_the_marker() -> None:
    sets = hand_sets(None)
    for bare, marked in zip(sets.bare_test, sets.test, strict=True):
        assert bare.holder == replace(marked.holder, marker_m=0.0)
        assert (bare.seed, bare.variation) == (marked.seed, marked.variation)
        assert bare.each <= marked.each
        assert bare.configurations == marked.configurations[: len(bare.configurations)]


def test_the_thesis_number_of_frames_is_there() -> None:
    sets = hand_sets(None)
    of_three = sum(one.each for one in sets.training if one.configurations == sets.three)
    assert of_three == 300
    assert sum(one.each for one in sets.test) * len(sets.three) >= 118
    assert all(len(one) == 162 for one in sets.large)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--only", "waving"), ("waving", "classifier", "bottle")),
        (("--split", "all"), ("all", "test", "tuning")),
        (("--real", "/nowhere"), ("nowhere",)),
    ],
)
def test_what_does_not_exist_is_said_at_once(options: tuple[str, ...], words: tuple[str, ...]) -> None:
    assert_told(geoderm("evaluate", "hand", "--quick", *options), 2, *words)


def test_json_has_null_for_what_was_not_measured() -> None:
    figures = {"a": float("nan"), "b": [1.0, float("inf")], "c": {"d": 2}}
    assert without_nan(figures) == {"a": None, "b": [1.0, None], "c": {"d": 2}}
