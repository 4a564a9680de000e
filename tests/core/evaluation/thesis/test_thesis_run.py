"""The whole protocol on three simulated captures, stopped and resumed."""

from __future__ import annotations

import json
import math

import pytest
from PIL import Image

from app.cli.evaluate_thesis import simulate_stances
from core.errors import Cancelled, InputError
from core.evaluation.thesis import Protocol, Wall, find_sequences, report_text, run_thesis, write_results
from core.progress import no_progress
from devices.trackers import default_tracker

FIGURES = ("8", "9", "10", "11", "table2", "stances", "time")
PROTOCOL = Protocol(beside=())


class StopAt:
    """A person who cancels when a capture begins."""

    def __init__(self, words):
        self.words = words

    def __call__(self, fraction, message=""):
        assert 0.0 <= fraction <= 1.0
        if self.words in message:
            raise Cancelled


@pytest.fixture(scope="module")
def finished(psi_captures, tmp_path_factory):
    """A run that was cancelled at the third capture and then started again."""
    from app.cli.evaluate_thesis import simulated_wall

    _, sequences = psi_captures
    out = tmp_path_factory.mktemp("thesis-out")
    with pytest.raises(Cancelled):
        run_thesis(
            sequences,
            default_tracker(),
            None,
            out,
            figures=("table2",),
            protocol=PROTOCOL,
            progress=StopAt("capture 002"),
        )
    kept = {p.name: p.stat().st_mtime_ns for p in (out / "records" / "psi").iterdir()}
    results = run_thesis(
        sequences,
        default_tracker(),
        Wall(simulated_wall(0), "rendered"),
        out,
        figures=FIGURES,
        protocol=PROTOCOL,
    )
    return out, results, kept


def test_what_was_measured_before_a_cancel_is_not_measured_again(finished):
    out, _, kept = finished
    assert sorted(kept) == ["000.json", "001.json"]
    now = {p.name: p.stat().st_mtime_ns for p in (out / "records" / "psi").iterdir()}
    assert sorted(now) == ["000.json", "001.json", "002.json"]
    assert {name: now[name] for name in kept} == kept


def test_every_figure_becomes_a_picture_small_enough_for_a_document(finished):
    out, results, _ = finished
    names = {p.name for p in results.pictures.values()}
    assert names == {
        "figure-08-body.png",
        "figure-08-planes.png",
        "figure-09-psi.png",
        "figure-10-psi.png",
        "figure-11.png",
        "stances.png",
        "error-against-time.png",
    }
    for name in names:
        assert (out / name).stat().st_size < 300_000
        with Image.open(out / name) as picture:
            assert picture.width > 700
    assert not [p for p in out.iterdir() if p.name.endswith(".part")]


def test_table_2_judges_later_captures_against_re_clicked_truth(finished):
    _, results, _ = finished
    rows = {row["method"]: row for row in results.numbers["table_2"]}
    assert list(rows) == ["DM", "FMM"]
    for label, thesis in (("DM", 0.023), ("FMM", 0.019)):
        row = rows[label]
        assert row["images"] == 2
        assert row["answered"] == row["judged"] >= 6
        assert 0.002 < row["mean_m"] < 0.12
        assert row["thesis_m"] == thesis
    assert results.numbers["source"] == "simulated"


def test_the_report_says_that_captures_were_simulated_and_json_is_plain(finished):
    out, results, _ = finished
    assert "simulated" in report_text(results, out)
    numbers, page = write_results(results, out)
    text = numbers.read_text(encoding="utf-8")
    assert "NaN" not in text
    document = json.loads(text)
    assert document["format"] == "geoderm-thesis/1"
    assert len(document["figure_9"]["psi"]["FMM"]) == 15
    for name in ("Table 2", "Figure 8", "Figure 9", "Figure 10", "Stances", "figure-11.png"):
        assert name in page.read_text(encoding="utf-8")


def test_the_captures_that_were_written_enter_by_the_door_for_recorded_ones(psi_captures):
    folder, sequences = psi_captures
    assert find_sequences(folder) == tuple(sequences)


def test_rendering_goes_on_where_it_was_and_refuses_another_patient(psi_captures):
    folder, sequences = psi_captures
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*.png")}
    again = simulate_stances(folder, ("psi",), 3, "m_tall_thin", 3, progress=no_progress)
    assert again == sequences
    assert {p: p.stat().st_mtime_ns for p in folder.rglob("*.png")} == before
    with pytest.raises(InputError, match="another simulation"):
        simulate_stances(folder, ("psi",), 3, "m_tall_thin", 4, progress=no_progress)


def test_figures_that_need_clicks_are_left_out_or_refused(tmp_path, put_capture):
    for name in ("0", "1"):
        put_capture(tmp_path / "psi" / name)
    sequences = find_sequences(tmp_path / "psi")
    with pytest.raises(InputError, match=r"Figure 9 cannot be made.*clicks\.json"):
        run_thesis(sequences, default_tracker(), None, tmp_path / "out", figures=("9",))
    with pytest.raises(InputError, match="needs captures"):
        run_thesis((), default_tracker(), None, tmp_path / "out", figures=("10",))


def test_cpu_time_needs_no_captures(tmp_path):
    results = run_thesis((), default_tracker(), None, tmp_path, figures=("cpu",), cpu_rounds=1)
    assert results.numbers["cpu"]["points"] == 60_000
    assert all(math.isfinite(m["one_source_s"]) for m in results.numbers["cpu"]["methods"])
