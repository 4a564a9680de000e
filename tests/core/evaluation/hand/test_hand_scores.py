"""How an answer of the hand tracker is held against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from core.capture.camera import PinholeCamera
from core.evaluation.hand.scores import OUTLIER_M, pair_errors, paths_between
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS, POINT_INDEX
from core.hand.surface import HandSurface
from core.surface.body_surface import BodySurface
from tests.core.evaluation.hand.made_scores import answer, moved_points, score, true_frame, true_points


def test_a_right_answer_has_no_error() -> None:
    right = score()
    assert right.joint_error_m == 0.0
    assert right.error_m.max() == 0.0
    assert right.anchored == "seen"
    assert not right.outlier


def test_joint_joint_errors_do_not_change_when_the_whole_hand_is_moved_and_point_errors_do() -> None:
    moved = score(said=answer(moved_points(0.010)))
    assert moved.joint_error_m == pytest.approx(0.0, abs=1e-12)
    assert moved.visible_error_m == pytest.approx(np.full(15, 0.010))


def test_the_joint_joint_error_is_the_median_over_pairs_of_the_difference_of_their_distances() -> None:
    points = true_points()
    points[0] += (0.0, -0.030, 0.0)
    wrong = score(said=answer(points))
    by_hand = [
        np.linalg.norm(points[i] - points[j]) - np.linalg.norm(true_points()[i] - true_points()[j])
        for i, j in PAIRS
    ]
    assert wrong.pair_error_m == pytest.approx(np.array(by_hand))
    assert wrong.joint_error_m == pytest.approx(np.median(np.abs(by_hand)))
    assert np.abs(wrong.pair_error_m).max() == pytest.approx(0.030)


def test_pairs_with_a_hidden_or_an_untold_point_do_not_count() -> None:
    points = true_points()
    points[POINT_INDEX["index_tip"]] = np.nan
    one = score(true_frame(hidden=("thumb_tip",)), answer(points))
    counted = {PAIRS[k] for k in np.flatnonzero(np.isfinite(one.pair_error_m))}
    assert not any({POINT_INDEX["thumb_tip"], POINT_INDEX["index_tip"]} & set(pair) for pair in counted)
    assert len(counted) == 13 * 12 // 2


def test_a_hidden_point_that_is_told_counts_as_told_and_its_error_apart() -> None:
    points = true_points()
    points[0] += (0.025, 0.0, 0.0)
    one = score(true_frame(hidden=("thumb_tip",)), answer(points))
    assert one.hidden_error_m == pytest.approx([0.025])
    assert one.visible_error_m == pytest.approx(np.zeros(14))


def test_a_frame_is_an_outlier_beyond_15_mm_and_not_at_it() -> None:
    scale = 1.0 + 1.02 * OUTLIER_M / np.median(np.linalg.norm(_between(true_points()), axis=1))
    assert score(said=answer(true_points() * scale)).outlier
    scale = 1.0 + 0.98 * OUTLIER_M / np.median(np.linalg.norm(_between(true_points()), axis=1))
    assert not score(said=answer(true_points() * scale)).outlier


def _between(points: np.ndarray) -> np.ndarray:
    return np.array([points[i] - points[j] for i, j in PAIRS])


def test_a_frame_without_an_answer_is_neither_right_nor_an_outlier() -> None:
    nothing = score(said=HandAnswer(reason="No marker is in view."))
    assert np.isnan(nothing.joint_error_m)
    assert nothing.anchored == "none"
    assert not nothing.outlier
    assert len(nothing.visible_error_m) == 0


def test_points_told_without_the_marker_in_this_frame_were_followed() -> None:
    assert score(said=answer(seen=False)).anchored == "followed"


def test_the_likeliest_configuration_is_kept_where_none_is_told() -> None:
    one = score(said=answer(configuration=None, likelihood={"open": 0.4, "fist": 0.6}))
    assert (one.told_configuration, one.likeliest) == (None, "fist")


def test_pair_errors_have_a_sign() -> None:
    shrunk = pair_errors(0.5 * true_points(), true_points(), np.ones(15, bool))
    assert (shrunk <= 0).all()
    assert shrunk.min() < -0.02


def test_paths_run_along_the_skin_and_not_through_it() -> None:
    hand = folded_sheet()
    ends = np.full((15, 3), np.nan)
    ends[0], ends[1] = hand.surface.vertices[0], hand.surface.vertices[-1]
    paths = paths_between(hand, ends)
    assert np.isfinite(paths).sum() == 1
    straight = np.linalg.norm(ends[0] - ends[1])
    assert paths[PAIRS.index((0, 1))] > 1.05 * straight


def folded_sheet() -> HandSurface:
    """Two halves of a sheet that meet in a ridge toward the camera."""
    height, width = 40, 60
    camera = PinholeCamera(width, height, 250.0, 250.0, (width - 1) / 2, (height - 1) / 2)
    beside = np.abs(np.arange(width) - 0.5 * (width - 1))
    depth = np.tile(0.5 + 0.002 * beside, (height, 1))
    return HandSurface(BodySurface.from_depth(depth, camera), (0, 0), 1)
