"""The ladder on a simulated pair, with its cache, its journal and its report."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from app.cli.evaluate import simulated_pairs, write_all
from app.cli.main import main
from app.cli.simulated_cases import SimulatedCases
from core.errors import InputError
from core.evaluation import (
    BASELINES,
    FLOOR,
    Journal,
    check_methods,
    ladder_methods,
    ladder_rungs,
    run_ladder,
)
from core.relocation import RELOCATION_METHODS

METHODS = ("rigid-alignment", "nearest-bone", "trilateration")
RUNGS = ladder_rungs(METHODS, joints=("true",), frames=(3,), appearance=(False,))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ladder")


@pytest.fixture(scope="module")
def source(folder):
    pair = replace(
        simulated_pairs("tuning")[0],
        first="psi",
        followup="A",
        view="front",
        turn_deg=0.0,
        lesions=24,
        moles=40,
        new_moles=8,
        vanished=8,
    )
    return SimulatedCases([pair], frames=3, cache=folder / "captures", color_size=(1280, 960))


@pytest.fixture(scope="module")
def journal(folder):
    return Journal(folder / "journal.jsonl", "this program")


@pytest.fixture(scope="module")
def records(source, journal):
    return {r.rung.method: r for r in run_ladder(source, RUNGS, journal)}


def test_every_rung_and_the_floor_are_scored_on_the_same_lesions(records):
    assert set(records) == {FLOOR, *METHODS}
    asked = {tuple(s.lesion for s in records[name].lesions) for name in METHODS}
    assert len(asked) == 1
    visible = [s.lesion for s in records["trilateration"].lesions if s.visible]
    assert [s.lesion for s in records[FLOOR].lesions] == visible
    assert len(visible) >= 6


def test_no_method_beats_the_sensor_and_geodesics_beat_stiff_alignment(records):
    def mean(name):
        return np.mean([s.error_m for s in records[name].lesions if s.visible and s.error_m is not None])

    assert mean(FLOOR) < mean("trilateration") < mean("rigid-alignment")
    assert mean("trilateration") < 0.045


def test_a_lesion_carries_its_body_part_and_what_the_method_stated(records):
    for score in records["trilateration"].lesions:
        assert score.part
        if score.answered:
            assert 0.001 < score.radius95_m < 0.5
            assert score.in_region is not None
            assert score.wrong_limb is not None


def test_moles_that_vanish_are_healed_sites(records):
    healed = [s for s in records["trilateration"].lesions if s.healed]
    assert healed
    assert all(s.lesion.startswith("M") for s in healed)


def test_what_was_measured_is_not_measured_again(source, folder, records, monkeypatch):
    monkeypatch.setattr("app.cli.simulated_cases.SimulatedCase.load", None)
    again = run_ladder(source, RUNGS, Journal(folder / "journal.jsonl", "this program"))
    assert {r.rung.method: r for r in again} == records


@pytest.fixture(scope="module")
def case(source, records):
    """The same pair with one frame of each capture, which must be in the cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("app.cli.simulated_cases._render", None)
        return next(iter(source.cases())).load("true", 1)


def test_captures_are_rendered_once_and_a_frame_is_taken_of_them(case):
    assert len(case.first.capture.depth_frames) == 1
    assert len(case.spots.new_m) + len(case.spots.vanished_m) > 0


def test_the_report_has_pictures_for_people_and_json_for_programs(records, folder):
    out = folder / "report"
    out.mkdir()
    files = write_all(list(records.values()), RUNGS, {"captures": "one pair"}, out)
    assert {f.suffix for f in files} == {".md", ".json", ".png"}
    assert all(f.stat().st_size > 500 for f in files)
    rows = json.loads((out / "ladder.json").read_text())["rows"]
    assert {row["method"] for row in rows} == set(records)


@pytest.fixture
def study(folder, case, tmp_path):
    """A manifest of the same captures, with the true pixels as somebody would have clicked them."""
    captures = next((folder / "captures").iterdir())
    seen = [lesion for lesion in case.lesions if not lesion.healed][:8]
    write = {
        "lesions": [{"id": x.id, "pixel": x.pixel} for x in seen],
        "truth": [
            {"id": x.id, "pixel": x.followup_pixel} if x.visible else {"id": x.id, "visible": False}
            for x in seen
        ],
    }
    for name, entries in write.items():
        (tmp_path / f"{name}.json").write_text(json.dumps({"lesions": entries}))
    (tmp_path / "manifest.csv").write_text(
        "case,first,followup,lesions,truth,body\n"
        f"c1,{captures / 'first'},{captures / 'followup'},lesions.json,truth.json,anna\n"
    )
    return tmp_path


def test_own_captures_are_measured_by_the_command(study, capsys):
    arguments = ["evaluate", "captures", str(study / "manifest.csv"), "--methods", "nearest-bone"]
    assert main([*arguments, "--frames", "1", "--out", str(study / "out")]) == 0
    document = json.loads((study / "out" / "ladder.json").read_text())
    row = next(r for r in document["rows"] if r["method"] == "nearest-bone")
    assert row["group"] == "other stance"
    assert row["answered"] == 1
    assert 0 < row["mean_mm"] < 60
    # A clicked pixel stands for the sensor's own place: there is no floor below it.
    assert row["mean_mm"] == pytest.approx(row["beside_floor_mm"])


def test_a_truth_off_the_skin_is_named(study, capsys):
    truth = json.loads((study / "truth.json").read_text())
    truth["lesions"][0] = {"id": truth["lesions"][0]["id"], "pixel": [3, 3]}
    (study / "truth.json").write_text(json.dumps(truth))
    arguments = ["evaluate", "captures", str(study / "manifest.csv"), "--methods", "nearest-bone"]
    assert main([*arguments, "--frames", "1"]) == 2
    told = capsys.readouterr().err
    assert "truth.json" in told
    assert truth["lesions"][0]["id"] in told


def test_yardsticks_are_no_methods_of_the_application(records):
    assert not set(BASELINES) & set(RELOCATION_METHODS)
    assert ladder_methods()[0] == "rigid-alignment"
    assert set(RELOCATION_METHODS) <= set(ladder_methods())
    with pytest.raises(InputError, match="There is no method 'magic'"):
        check_methods(["magic"])


def test_no_body_or_seed_of_the_test_split_was_tuned_or_calibrated_on():
    test, others = simulated_pairs("test"), (*simulated_pairs("tuning"), *simulated_pairs("calibration"))
    assert not {p.shape for p in test} & {p.shape for p in others}
    assert not {p.seed for p in test} & {p.seed for p in others}
    with pytest.raises(InputError, match="no split"):
        simulated_pairs("secret")


def test_an_evaluation_needs_pairs():
    with pytest.raises(InputError):
        SimulatedCases([])
