"""The numbers of figures 9, 10, 11 and table 2, from records made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from core.anchors import JOINT_NAMES
from core.evaluation.thesis import CaptureRecord
from core.evaluation.thesis.experiments import rank_stances
from core.evaluation.thesis.records import read_record, write_record
from core.evaluation.thesis.statistics import error_series, grade_joint, joint_spreads, variance_matrix

N = len(JOINT_NAMES)
HEAD, NECK = JOINT_NAMES.index("head"), JOINT_NAMES.index("neck")


def record(name, *, to_lesion=None, between=None, lesions=None, answers=None, cpu=None):
    return CaptureRecord(
        name,
        lesions_m=lesions or {},
        to_lesion_m={"FMM": to_lesion or {}},
        between_m={"FMM": between} if between is not None else {},
        answers_m={"voting-fmm": answers or {}},
        cpu_seconds={} if cpu is None else {"voting-fmm": cpu},
    )


def distances(head):
    row = [math.nan] * N
    row[HEAD] = head
    return row


def test_each_lesion_is_compared_with_its_own_mean():
    place = [0.0, 0.0, 1.0]
    records = [
        record(
            str(k),
            lesions={"near": place, "far": place},
            to_lesion={"near": distances(0.30 + e), "far": distances(1.10 - e)},
        )
        for k, e in enumerate((-0.01, 0.0, 0.01))
    ]
    head = joint_spreads(records, "FMM", 0.03)[HEAD]
    assert sorted(np.round(head.errors_m, 6)) == [-0.01, -0.01, 0.0, 0.0, 0.01, 0.01]
    assert (head.joint, head.seen, head.grade) == ("head", 1.0, "good")


@pytest.mark.parametrize(
    ("delta_m", "right", "grade"),
    [(0.03, 1.0, "good"), (0.015, 0.75, "reasonable"), (0.005, 0.5, "bad")],
)
def test_the_grade_is_the_share_of_votes_that_the_band_lets_be_right(delta_m, right, grade):
    place = {"L1": [0.0, 0.0, 1.0]}
    offsets = (0.0, 0.0, 0.01, -0.01, 0.001, -0.001, 0.02, -0.02)
    records = [
        record(str(k), lesions=place, to_lesion={"L1": distances(0.5 + e)}) for k, e in enumerate(offsets)
    ]
    head = joint_spreads(records, "FMM", delta_m)[HEAD]
    assert (head.right, head.grade) == (right, grade)


def test_the_limits_of_the_grades():
    assert [grade_joint(x) for x in (0.95, 0.949, 0.667, 0.666)] == [
        "good",
        "reasonable",
        "reasonable",
        "bad",
    ]


def test_a_distance_that_was_not_measured_is_a_wrong_vote():
    place = {"L1": [0.0, 0.0, 1.0]}
    records = [
        record(str(k), lesions=place, to_lesion={"L1": distances(0.5 if k < 6 else math.nan)})
        for k in range(10)
    ]
    spreads = joint_spreads(records, "FMM", 0.03)
    assert (spreads[HEAD].right, spreads[HEAD].seen, spreads[HEAD].grade) == (0.6, 0.6, "bad")
    assert (spreads[NECK].right, spreads[NECK].grade, len(spreads[NECK].errors_m)) == (0.0, "bad", 0)


def test_without_clicks_there_are_no_histograms():
    assert joint_spreads([record("0"), record("1")], "FMM", 0.03) == []


def test_variances_are_those_of_every_pair_and_unknown_where_pairs_are_rare():
    rng = np.random.default_rng(0)
    stack = rng.normal(1.0, 0.02, (10, N, N))
    stack = 0.5 * (stack + stack.transpose(0, 2, 1))
    stack[2:, NECK, HEAD] = stack[2:, HEAD, NECK] = np.nan
    matrix = variance_matrix([record(str(k), between=s.tolist()) for k, s in enumerate(stack)], "FMM")
    assert np.isnan(np.diag(matrix)).all()
    assert math.isnan(matrix[HEAD, NECK])
    assert matrix[3, 5] == pytest.approx(stack[:, 3, 5].var(ddof=1))
    assert np.array_equal(matrix, matrix.T, equal_nan=True)


def errors(offsets, *, method_answers=True, lesions=("L1",)):
    """Reference and later captures whose answers miss the re-clicked place by offsets along x."""
    first = record("0", lesions={name: [0.0, 0.0, 1.0] for name in lesions})
    later = [
        record(
            str(k + 1),
            lesions={name: [0.1, 0.0, 1.0] for name in lesions},
            answers={name: [0.1 + x, 0.0, 1.0] if method_answers else None for name in lesions},
            cpu=0.5 + k,
        )
        for k, x in enumerate(offsets)
    ]
    return error_series([first, *later], "voting-fmm")


def test_errors_are_against_the_re_clicked_place_not_the_first():
    series = errors([0.01, 0.02, 0.06], lesions=("L1", "L2"))
    assert series.per_capture_m == pytest.approx([0.01, 0.02, 0.06])
    assert series.mean_m == pytest.approx(0.03)
    assert series.median_m == pytest.approx(0.02)
    assert series.low_m < 0.03 < series.high_m
    assert (series.judged, series.answered, series.captures) == (6, 6, ("1", "2", "3"))
    assert series.cpu_s == pytest.approx(1.5)


def test_lesions_without_answer_or_click_are_counted_not_scored():
    series = errors([0.01, 0.02], method_answers=False)
    assert (series.judged, series.answered) == (2, 0)
    assert math.isnan(series.mean_m)
    unclicked = error_series([record("0", lesions={"L1": [0, 0, 1]}), record("1")], "voting-fmm")
    assert (unclicked.judged, unclicked.answered) == (0, 0)


def test_stances_are_ranked_by_the_better_of_the_two_methods():
    order = rank_stances({"psi": [errors([0.03])], "A": [errors([0.02])], "T": [errors([], lesions=())]})
    assert order == ["A", "psi", "T"]


def test_records_are_kept_with_what_they_were_made_of(tmp_path):
    kept = record("0", lesions={"L1": [1.0, 2.0, 3.0]}, to_lesion={"L1": distances(0.25)}, cpu=0.1)
    path = tmp_path / "psi" / "0.json"
    write_record(path, kept, "these inputs")
    again = read_record(path, "these inputs")
    assert again is not None
    assert again.lesions_m == kept.lesions_m
    assert again.to_lesion("FMM", "L1")[HEAD] == 0.25
    assert np.isnan(again.to_lesion("FMM", "L1")[NECK])
    assert read_record(path, "other inputs") is None
    path.write_text("{")
    assert read_record(path, "these inputs") is None
    assert read_record(tmp_path / "absent.json", "these inputs") is None
