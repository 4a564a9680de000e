"""Figures over many frames: medians, outliers, intervals over hands, confusion matrices."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from core.evaluation.hand.classifier import judged, left_out
from core.evaluation.hand.rivals import LandmarkScore, beside
from core.evaluation.hand.speed import speed_of
from core.evaluation.hand.summaries import accuracy, frames_since_lost, spread
from core.evaluation.hand.tables import accuracy_table, confusion_table, judged_words
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS
from tests.core.evaluation.hand.made_scores import answer, moved_points, score, true_frame, true_points


def median(values: np.ndarray) -> float:
    return float(np.median(values))


def test_an_interval_draws_hands_and_not_frames() -> None:
    alike = spread({body: np.full(200, 3.0) for body in "abcde"}, median)
    assert (alike.low, alike.value, alike.high) == (3.0, 3.0, 3.0)
    apart = spread({body: np.full(200, float(k)) for k, body in enumerate("abcde")}, median)
    assert apart.low < 1.0
    assert apart.high > 3.0
    assert apart.by_body == {"a": 0.0, "b": 1.0, "c": 2.0, "d": 3.0, "e": 4.0}


def test_three_hands_give_no_interval_but_each_its_own_figure() -> None:
    few = spread({"a": np.array([1.0]), "b": np.array([2.0, np.nan]), "c": np.array([6.0])}, median)
    assert np.isnan([few.low, few.high]).all()
    assert (few.value, dict(few.by_body)) == (2.0, {"a": 1.0, "b": 2.0, "c": 6.0})


def test_what_is_missing_is_counted_and_not_averaged() -> None:
    moved = score(said=answer(moved_points(0.004)))
    nothing = score(said=HandAnswer())
    figures = accuracy([moved, moved, nothing])
    assert figures.unanswered == 1
    assert figures.point_mm.value == pytest.approx(4.0)
    assert (figures.visible_told, figures.visible) == (30, 45)


def test_outliers_are_counted_by_frame() -> None:
    points = true_points()
    figures = accuracy([score(), score(said=answer(3.0 * points)), score()])
    assert figures.outliers == 1
    assert figures.joint_mm.value == 0.0


def test_hidden_points_have_figures_of_their_own() -> None:
    points = true_points()
    points[1] += (0.03, 0.0, 0.0)
    points[2] = np.nan
    figures = accuracy([score(true_frame(hidden=("thumb_ip", "thumb_mcp")), answer(points))])
    assert (figures.hidden, figures.hidden_told) == (2, 1)
    assert figures.hidden_mm.value == pytest.approx(30.0)
    assert figures.point_mm.value == 0.0


def test_errors_that_stay_the_same_over_time_have_no_deviation() -> None:
    wrong = score(said=answer(1.1 * true_points()))
    assert accuracy([wrong] * 12).joint_sd_mm.value == pytest.approx(0.0, abs=1e-9)
    swaying = [score(said=answer((1.0 + 0.1 * (-1) ** k) * true_points())) for k in range(12)]
    assert accuracy(swaying).joint_sd_mm.value > 2.0


def test_a_confusion_matrix_has_columns_for_unknown_and_for_no_answer() -> None:
    said = [
        score(),
        score(said=answer(configuration="fist")),
        score(said=answer(configuration=None, likelihood={"open": 0.5, "fist": 0.5})),
        score(said=HandAnswer(reason="No marker is in view.")),
        score(true_frame(configuration=None), answer()),
    ]
    result = judged(said, ("fist", "open"))
    assert result.counts.tolist() == [[0, 0, 0, 0], [1, 1, 1, 1]]
    assert (result.frames, result.right, result.wrong) == (4, 1, 1)
    assert [fault[1] for fault in result.faults] == ["fist", "unknown", "no answer"]


def test_a_configuration_that_was_not_learned_is_right_to_be_unknown() -> None:
    shown = [
        score(true_frame(configuration="grip"), answer(configuration=None, likelihood={"fist": 1.0})),
        score(true_frame(configuration="grip"), answer(configuration="fist")),
        score(true_frame(configuration="grip"), HandAnswer()),
        score(true_frame(configuration="open"), answer()),
    ]
    missing = left_out("grip", shown)
    assert (missing.frames, missing.unknown, missing.taken_for) == (2, 1, {"fist": 1})


def test_frames_are_counted_since_the_marker_was_last_seen() -> None:
    seen, lost = score(), score(said=answer(seen=False))
    assert frames_since_lost([seen, lost, lost, seen, lost]) == [0, 1, 2, 0, 1]


def test_two_ways_are_compared_on_the_same_frames_and_on_points_that_both_tell() -> None:
    ours = moved_points(0.002)
    ours[3] = np.nan
    error = np.full(15, 0.005)
    error[4] = np.nan
    one = score(true_frame(hidden=("thumb_tip",)), answer(ours))
    rival = landmark_score("f1", error, one.visible)
    result = beside([one, replace(one, name="elsewhere")], [rival], "aligned")
    assert (result.frames, result.visible, result.ours_told, result.theirs_told) == (1, 14, 13, 13)
    assert result.both == 12
    assert (result.both_ours_mm.value, result.both_theirs_mm.value) == pytest.approx((2.0, 5.0))
    assert result.nearer.value == 100.0


def landmark_score(name: str, error_m: np.ndarray, visible: np.ndarray) -> LandmarkScore:
    ways = {"aligned": error_m, "as detected": error_m}
    return LandmarkScore(name, "somebody", visible, visible, ways, dict.fromkeys(ways, 0.0))


def test_speed_leaves_out_the_first_frame_in_which_libraries_load() -> None:
    scores = [
        replace(score(), wall_s=wall, cpu_s=0.02, times_s={"surface": 0.01}) for wall in (9.0, 0.05, 0.05)
    ]
    speed = speed_of(scores)
    assert speed["frames_per_s"] == pytest.approx(20.0)
    assert speed["frames_per_cpu_s"] == pytest.approx(50.0)
    assert speed["by_step_ms"] == {"surface": pytest.approx(10.0)}


def test_figures_can_be_written_as_json_and_as_tables() -> None:
    figures = json.loads(json.dumps(accuracy([score()]).to_json()))
    assert "| all | 1 | 0 | 0 | 0.0 |" in accuracy_table("frames", {"all": figures})
    matrix = json.loads(json.dumps(judged([score()], ("fist", "open")).to_json()))
    assert "| **open** | 0 | 1 | 0 | 0 |" in confusion_table(matrix)
    assert judged_words(matrix).startswith("1 of 1 right")
    assert len(PAIRS) == 105
