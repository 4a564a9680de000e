"""Shares, errors and their intervals; rows per stance class, body part and stance; claims."""

from __future__ import annotations

import csv
import json
import math

import pytest

from core.evaluation import (
    FLOOR,
    OTHER,
    SAME,
    CaseName,
    LesionScore,
    Record,
    Rung,
    SpotScore,
    ladder_rungs,
    make_report,
    markdown,
    summarise,
    write_residuals,
)
from core.evaluation.summaries import summarise_spots
from core.evaluation.tables import stance_rows


def lesion(error_mm=None, *, visible=True, status=None, radius_mm=20.0, part="trunk", healed=False, **more):
    answered = error_mm is not None
    return LesionScore(
        lesion="L1",
        part=part,
        limb="trunk",
        visible=visible,
        healed=healed,
        status=status or ("predicted" if answered else "not_visible"),
        error_m=error_mm / 1000 if answered else None,
        radius95_m=radius_mm / 1000 if answered else None,
        **more,
    )


def on(body, *lesions):
    return [(body, one) for one in lesions]


def record(rung, body, stances, *lesions, **more):
    name = CaseName(f"{body}-{stances[0]}-{stances[1]}", body, *stances)
    return Record(rung, name, "code", seconds=1.5, others=179, lesions=tuple(lesions), **more)


def test_errors_are_those_of_answers_to_visible_lesions():
    s = summarise(on("a", lesion(4), lesion(8), lesion(30), lesion(), lesion(500, visible=False)))
    assert (s.lesions, s.answered, s.mean_mm.value, s.median_mm) == (4, 0.75, pytest.approx(14), 8)
    assert s.within_10mm.value == pytest.approx(2 / 3)
    assert s.in_radius.value == pytest.approx(2 / 3)
    assert s.beyond_100mm == 0


def test_hidden_lesions_and_false_alarms_are_told_apart_from_refusals():
    s = summarise(
        on(
            "a",
            lesion(visible=False),
            lesion(visible=False, status="refused"),
            lesion(12, visible=False),
            lesion(5),
            lesion(),
            lesion(status="refused"),
            lesion(6),
        )
    )
    assert s.hidden == 3
    assert s.hidden_said == pytest.approx(1 / 3)
    assert s.hidden_answered == pytest.approx(1 / 3)
    assert (s.false_alarms, s.refused, s.answered) == (0.25, 0.25, 0.5)


def test_bodies_are_drawn_not_lesions():
    many = summarise(on("a", *[lesion(10)] * 300) + on("b", *[lesion(20)] * 300))
    assert (many.mean_mm.low, many.mean_mm.high) == (10.0, 20.0)
    alone = summarise(on("a", lesion(10), lesion(20)))
    assert (alone.mean_mm.low, alone.mean_mm.high) == (15.0, 15.0)


def test_the_interval_is_repeatable():
    scores = [(str(k % 4), lesion(k)) for k in range(1, 40)]
    assert summarise(scores, seed=5) == summarise(scores, seed=5)


def test_without_answers_there_are_no_errors():
    s = summarise(on("a", lesion()))
    assert s.answered == 0
    assert math.isnan(s.mean_mm.value)
    assert s.to_json()["mean_mm"] is None


def test_spots_are_pooled_before_shares_are_taken():
    rung, stances = Rung("m", appearance=True), ("A", "A")
    records = [
        record(rung, "a", stances, new_spots=SpotScore(2, 4, 2)),
        record(rung, "b", stances, new_spots=SpotScore(8, 1, 0)),
        record(rung, "c", stances),
    ]
    spots = summarise_spots(records, "new_spots")
    assert (spots.precision, spots.recall) == (0.2, 0.4)
    assert summarise_spots(records, "vanished_spots") is None


def test_every_set_of_conditions_has_its_sensor_floor_and_geometry_has_no_appearance():
    rungs = ladder_rungs(["nearest-bone", "newest"], joints=("tracked", "true"), frames=(1, 30))
    assert [r.method for r in rungs[:4]] == [FLOOR, "nearest-bone", "newest", "newest"]
    assert len(rungs) == 16
    assert not any(r.appearance for r in rungs if r.method in (FLOOR, "nearest-bone"))


@pytest.fixture
def measured():
    plain, seeing = Rung("m"), Rung("m", appearance=True)
    same, other = ("A", "A"), ("A", "psi")
    records = [
        record(rung, body, stances, *[lesion(error, part="thigh", wrong_limb=False, wrong_lesion=False)] * 12)
        for rung, errors in ((plain, (5, 9)), (seeing, (2, 3)))
        for body in ("a", "b")
        for stances, error in ((same, errors[0]), (other, errors[1]))
    ]
    healed = lesion(7, healed=True)
    records.append(
        record(seeing, "c", same, lesion(2), healed, lesion(visible=False), lesion(3, part="foot"))
    )
    return records, (plain, seeing)


def test_claims_are_judged_by_both_figures(measured):
    records, rungs = measured
    claims = {t.figure: t for t in make_report(records, rungs, method="m").targets}
    assert claims["same stance, geometry only: mean / P95"].reached
    assert claims["other stance, with appearance: mean / P95"].reached
    assert claims["within 10 mm, other stance"].measured.startswith("100.0 %")
    assert claims["wrong lesion chosen among 179 others"].reached
    assert claims["lesion not visible: said so / false alarm"].reached
    assert claims["wrong limb or side"].reached
    coverage = claims["stated 95 % radius holds, per stance class and body part"]
    assert coverage.reached is False
    assert "thigh" in coverage.measured
    assert "foot" not in coverage.measured


def test_healed_sites_are_not_mixed_with_lesions(measured):
    records, rungs = measured
    report = make_report(records, rungs, method="m")
    row = next(r for r in report.rows if r.rung.appearance and r.group == SAME)
    assert row.healed.lesions == 1
    assert row.healed.mean_mm.value == pytest.approx(7)
    assert row.summary.lesions == 26


def test_stances_are_ranked_by_error(measured):
    records, rungs = measured
    assert [r.stances for r in stance_rows(records, rungs[0])] == ["A to A", "A to psi"]
    assert {r.name.group for r in records} == {SAME, OTHER}


def test_a_stance_nobody_wrote_down_is_not_the_same():
    assert CaseName("x", "x", "", "").group == OTHER


def test_the_report_is_whole_and_plain(measured):
    records, rungs = measured
    records = [*records, record(rungs[0], "d", ("A", "A"), failure="No body was found.")]
    report = make_report(records, rungs, method="m")
    json.dumps(report.to_json(), allow_nan=False)
    text = markdown(report)
    for word in ("## Claims", "m + appearance", "thigh", "A to psi", "healed", "No body was found."):
        assert word in text


def test_residuals_have_a_row_per_lesion_and_method(measured, tmp_path):
    records, _ = measured
    path = tmp_path / "residuals.csv"
    assert write_residuals(records, path) == 8 * 12 + 4
    rows = list(csv.DictReader(path.open(encoding="utf-8")))
    assert rows[0]["error_m"] == "0.005"
    assert rows[0]["stance_class"] == SAME
    assert rows[0]["visible"] == "1"
    assert rows[-2]["error_m"] == ""
