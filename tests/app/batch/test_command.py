"""``geoderm relocate-batch`` as its users see it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.app.batch.conftest import METHOD, read_table, results_of, row, write_manifest
from tests.app.cli.cases import assert_told, geoderm


def test_it_answers_as_relocate_does(cohort: Path, tmp_path: Path) -> None:
    manifest = write_manifest(tmp_path / "m.csv", [row(cohort, "p")])
    out = tmp_path / "out"
    outcome = geoderm("relocate-batch", manifest, "--out", out, "--workers", 0)
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.out == "1 pairs: 1 done, 0 failed, 0 kept from earlier\n"
    alone = tmp_path / "alone.json"
    outcome = geoderm(
        "relocate", cohort / "first", cohort / "followup", "--lesions", cohort / "lesions.json",
        "--out", alone, "--method", METHOD,
    )  # fmt: skip
    assert outcome.code == 0
    batch, single = (json.loads(p.read_text()) for p in (out / "p.json", alone))
    assert set(batch.pop("seconds")) == set(single.pop("seconds"))
    assert batch == single


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("--workers", 1, "--scheduler", "tcp://127.0.0.1:9"), 2, "exclude each other"),
        (("--method", "best"), 2, "best"),
        (("--workers", -1), 2, "--workers"),
        (("--scheduler", "nonsense://x"), 2, "is no address"),
    ],
)
def test_wrong_use_is_told_in_one_line(
    cohort: Path, tmp_path: Path, arguments: tuple[object, ...], code: int, told: str
) -> None:
    manifest = write_manifest(tmp_path / "m.csv", [row(cohort, "p")])
    assert_told(geoderm("relocate-batch", manifest, "--out", tmp_path / "out", *arguments), code, told)


def test_a_results_folder_that_cannot_be_is_told(cohort: Path, tmp_path: Path) -> None:
    manifest = write_manifest(tmp_path / "cases.csv", [row(cohort, "p")])
    for out, told in (
        (manifest, "is a file"),
        (tmp_path / "a" / "b", "cannot be made"),
        (tmp_path, "would be overwritten"),
    ):
        assert_told(geoderm("relocate-batch", manifest, "--out", out, "--workers", 0), 2, told)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_killed_and_asked_to_stop_it_goes_on_where_it_was(cohort: Path, tmp_path: Path) -> None:
    """One process that is killed, one that gets Ctrl+C, and one that ends: as if it had run through."""
    manifest = write_manifest(tmp_path / "m.csv", [row(cohort, f"p{i}") for i in range(3)])
    out = tmp_path / "out"
    command = (sys.executable, "-m", "app", "relocate-batch", manifest, "--out", out, "--workers", "0")

    def started(until: int) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [os.fspath(word) for word in command], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        while process.poll() is None and len(list(out.glob("*.json"))) < until:
            time.sleep(0.02)
        return process

    process = started(1)
    process.kill()
    process.communicate()
    process = started(2)
    process.send_signal(signal.SIGINT)
    told, error = process.communicate(timeout=100)
    if process.returncode != 0:  # it may have been done before the signal came
        assert process.returncode == 130
        assert error == "geoderm: stopped; the same command goes on where it stopped\n"
        # the signal may come when the last pair is just done
        assert "left" in told or "2 done" in told
    outcome = geoderm("relocate-batch", manifest, "--out", out, "--workers", 0)
    assert outcome.code == 0
    assert "0 done" not in told
    assert [c["status"] for c in read_table(out / "cases.csv")] == ["done"] * 3
    through = tmp_path / "through"
    geoderm("relocate-batch", manifest, "--out", through, "--workers", 0)
    assert results_of(out) == results_of(through)
    assert {p.name for p in out.iterdir()} == {p.name for p in through.iterdir()}


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_on_worker_processes_a_killed_worker_costs_nothing_but_time(cohort: Path, tmp_path: Path) -> None:
    psutil = pytest.importorskip("psutil")
    rows = [row(cohort, f"p{i}") for i in range(2)]
    rows.append({**rows[0], "case": "bad", "first": "nowhere"})
    manifest = write_manifest(tmp_path / "m.csv", rows)
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "app", "relocate-batch", manifest, "--out", out, "--workers", "1"],
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": os.fspath(tmp_path)},
    )
    while process.poll() is None and not (out / "p0.json").exists():
        time.sleep(0.05)
    with contextlib.suppress(psutil.NoSuchProcess):
        for child in psutil.Process(process.pid).children():
            if "spawn_main" in " ".join(child.cmdline()):
                child.kill()
    told, error = process.communicate(timeout=200)
    assert (process.returncode, error) == (0, "")
    assert told == "3 pairs: 2 done, 1 failed, 0 kept from earlier\n"
    assert not [p for p in tmp_path.iterdir() if "dask" in p.name or "geoderm-workers" in p.name]
    through = tmp_path / "through"
    geoderm("relocate-batch", manifest, "--out", through, "--workers", 0)
    assert results_of(out) == results_of(through)


def test_the_command_line_does_not_load_dask() -> None:
    code = "import sys, app.cli.main as m; m.build_app(); print({'dask', 'distributed'} & set(sys.modules))"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert printed.stdout.strip() == "set()"
