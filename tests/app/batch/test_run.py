"""A run of a cohort in this process: what is computed, what is kept, what is written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from threading import Event

import pytest

from app.batch.case import Case, CaseOutcome
from app.batch.journal import JOURNAL, Journal, alone_in
from app.batch.run import Progress, run_batch
from app.batch.runners import InProcess
from core.errors import InputError, WorkError
from tests.app.batch.conftest import a_case, read_table, results_of


class Counted(InProcess):
    """Computes in this process, and remembers what it was asked to compute."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []

    def submit(self, case: Case) -> None:
        self.asked.append(case.name)
        super().submit(case)


class Breaks(Counted):
    """Loses its workers after some pairs, as a cluster may."""

    def __init__(self, after: int) -> None:
        super().__init__()
        self.after = after

    def collect(self, timeout_s: float) -> CaseOutcome | None:
        if len(self.asked) > self.after:
            raise WorkError("The connection to the workers broke off.")
        return super().collect(timeout_s)


def run(cases: Sequence[Case], out: Path, runner: Counted | None = None, **options: object) -> list[str]:
    """Run a cohort; return the names of the pairs that were computed."""
    out.mkdir(exist_ok=True)
    runner = runner or Counted()
    run_batch(cases, out, lambda: runner, **options)  # type: ignore[arg-type]
    return runner.asked


def three(cohort: Path) -> list[Case]:
    """Two good pairs with a bad one between them."""
    return [a_case(cohort, "a"), a_case(cohort, "bad", first="/nowhere"), a_case(cohort, "b", seed=1)]


@pytest.fixture(scope="module")
def whole(cohort: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of an uninterrupted run of `three`. Read only."""
    out = tmp_path_factory.mktemp("whole")
    run(three(cohort), out)
    return out


@pytest.fixture
def copied(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "copied"))


def test_a_bad_pair_is_a_row_with_a_reason_and_the_others_are_relocated(cohort: Path, whole: Path) -> None:
    cases = read_table(whole / "cases.csv")
    assert [(c["case"], c["status"]) for c in cases] == [("a", "done"), ("bad", "failed"), ("b", "done")]
    assert "/nowhere" in cases[1]["reason"]
    assert float(cases[0]["seconds"]) > 0
    assert float(cases[0]["peak_memory_mb"]) > 50
    wanted = [lesion["id"] for lesion in json.loads((cohort / "lesions.json").read_text())["lesions"]]
    rows = read_table(whole / "results.csv")
    assert [(r["case"], r["lesion"]) for r in rows] == [(case, i) for case in "ab" for i in wanted]
    assert not (whole / "bad.json").exists()


def test_the_tables_say_what_the_results_say(whole: Path) -> None:
    result = json.loads((whole / "a.json").read_text())
    assert result["format"] == "geoderm-relocation/1"
    rows = [r for r in read_table(whole / "results.csv") if r["case"] == "a"]
    for lesion, row in zip(result["lesions"], rows, strict=True):
        assert row["status"] == lesion["status"]
        if "point_m" in lesion:
            assert [float(row[k]) for k in ("x_m", "y_m", "z_m")] == lesion["point_m"]
            assert [float(row[k]) for k in ("u", "v")] == lesion["pixel"]
            assert float(row["radius95_m"]) == lesion["radius95_m"]
    case = read_table(whole / "cases.csv")[0]
    assert int(case["lesions"]) == len(rows)
    for status in ("found", "predicted", "ambiguous", "not_visible", "refused"):
        assert int(case[status]) == sum(r["status"] == status for r in rows)


def test_finished_pairs_are_not_computed_again(cohort: Path, copied: Path) -> None:
    before = results_of(copied)
    assert run(three(cohort), copied) == []
    assert results_of(copied) == before


def test_fresh_computes_all_again(cohort: Path, copied: Path) -> None:
    assert run([a_case(cohort, "bad", first="/nowhere")], copied, fresh=True) == ["bad"]


@pytest.mark.parametrize("after", [0, 1, 2])
def test_a_run_that_was_broken_off_and_continued_gives_the_same(
    cohort: Path, whole: Path, tmp_path: Path, after: int
) -> None:
    out = tmp_path / "out"
    with pytest.raises(WorkError, match="broke off"):
        run(three(cohort), out, Breaks(after))
    assert len(read_table(out / "cases.csv")) == after
    assert run(three(cohort), out) == ["a", "bad", "b"][after:]
    assert results_of(out) == results_of(whole)


def test_a_torn_line_and_a_damaged_result_are_computed_again(cohort: Path, whole: Path, copied: Path) -> None:
    journal = copied / JOURNAL
    journal.write_bytes(journal.read_bytes()[:-20])  # the line of "b"
    (copied / "a.json").write_text("{}")
    (copied / ".b.json.abcd1234").write_text("half a res")
    (copied / "a.json").write_text((copied / "a.json").read_text().replace("{}", '{"format": "geoderm-rel'))
    assert run([a_case(cohort, "b", seed=1)], copied) == ["b"]
    assert not (copied / ".b.json.abcd1234").exists()
    (copied / "a.json").unlink()
    assert run(three(cohort), copied) == ["a"]
    assert results_of(copied) == results_of(whole)


def test_a_changed_option_is_computed_again_and_takes_an_outdated_result_away(
    cohort: Path, copied: Path
) -> None:
    changed = [a_case(cohort, "a", followup="/nowhere"), a_case(cohort, "b", seed=1)]
    assert run(changed, copied) == ["a"]
    assert not (copied / "a.json").exists()
    assert [c["status"] for c in read_table(copied / "cases.csv")] == ["failed", "done"]
    assert {r["case"] for r in read_table(copied / "results.csv")} == {"b"}


def test_a_failure_of_the_worker_is_tried_again_by_the_next_run(cohort: Path, tmp_path: Path) -> None:
    class Dies(Counted):
        def collect(self, timeout_s: float) -> CaseOutcome | None:
            return CaseOutcome(self._waiting.pop(0).name, reason="Its worker process died twice.")

    cases = [a_case(cohort, "p", first="/nowhere")]
    assert run(cases, tmp_path / "out", Dies()) == ["p"]
    assert read_table(tmp_path / "out" / "cases.csv")[0]["reason"] == "Its worker process died twice."
    assert run(cases, tmp_path / "out") == ["p"]
    assert run(cases, tmp_path / "out") == []


def test_a_file_that_is_no_result_is_never_overwritten(cohort: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    shutil.copy(cohort / "lesions.json", out / "p.json")
    case = a_case(cohort, "p", lesions=str(out / "p.json"))
    assert run([case], out) == []
    assert (out / "p.json").read_bytes() == (cohort / "lesions.json").read_bytes()
    assert "in the way" in read_table(out / "cases.csv")[0]["reason"]


def test_tables_of_somebody_else_are_never_overwritten(cohort: Path, tmp_path: Path) -> None:
    (tmp_path / "results.csv").write_text("mine")
    with pytest.raises(InputError, match=r"results\.csv"):
        run(three(cohort), tmp_path)
    assert (tmp_path / "results.csv").read_text() == "mine"


def test_a_second_run_stays_out_of_a_folder_at_work(cohort: Path, tmp_path: Path) -> None:
    with alone_in(tmp_path), pytest.raises(InputError, match="another relocate-batch"):
        run(three(cohort), tmp_path)


def test_a_request_to_stop_keeps_what_is_finished(cohort: Path, tmp_path: Path) -> None:
    stop, seen = Event(), list[Progress]()

    def report(progress: Progress) -> None:
        seen.append(progress)
        if progress.failed == 2:
            stop.set()

    cases = [a_case(cohort, f"p{i}", first="/nowhere") for i in range(5)]
    assert len(run(cases, tmp_path, stop=stop, report=report)) < 5
    assert [c["case"] for c in read_table(tmp_path / "cases.csv")] == ["p0", "p1"]
    assert (seen[-1].total, seen[-1].finished) == (5, 2)


def test_a_bug_costs_one_row_and_its_place_is_told_without_names(
    cohort: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    names = ("Jane", "Doe")

    def bug(*_: object, **__: object) -> None:
        raise KeyError(" ".join(names))

    monkeypatch.setattr("app.batch.one_pair.relocate_folders", bug)
    run([a_case(cohort, "p")], tmp_path)
    (case,) = read_table(tmp_path / "cases.csv")
    assert (case["status"], "KeyError" in case["reason"]) == ("failed", True)
    assert "bug in case p" in caplog.text
    assert "test_run.py" in caplog.text
    assert "Jane" not in caplog.text + case["reason"]


def test_the_journal_grows_by_one_line_for_each_pair_only(cohort: Path, copied: Path) -> None:
    for _ in range(3):
        run(three(cohort), copied)
    assert len((copied / JOURNAL).read_bytes().splitlines()) == 3
    with Journal(copied) as journal:
        assert journal.get("a") is not None
        assert journal.get("c") is None
