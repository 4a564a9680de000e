"""A finished pair counts as long as nothing of it has changed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.batch.fingerprint import fingerprint
from tests.app.batch.conftest import a_case


@pytest.fixture
def own(cohort: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(cohort, tmp_path / "own"))


def test_it_stays_the_same_where_the_cohort_is_moved(own: Path) -> None:
    before = fingerprint(a_case(own, "p"))
    moved = own.rename(own.with_name("moved"))
    assert fingerprint(a_case(moved, "p")) == before


def _touch(folder: Path) -> None:
    os.utime(folder / "followup" / "depth_000.png", (1, 1))


@pytest.mark.parametrize(
    "change",
    [
        _touch,
        lambda own: (own / "first" / "color.png").unlink(),
        lambda own: (own / "first" / "capture.json").open("a").write(" "),
        lambda own: (own / "lesions.json").open("a").write(" "),
        lambda own: shutil.rmtree(own / "followup"),
    ],
    ids=["time of a depth frame", "no picture", "description", "lesions", "no folder"],
)
def test_it_changes_with_every_file_of_the_pair(own: Path, change: Callable[[Path], object]) -> None:
    before = fingerprint(a_case(own, "p"))
    change(own)
    assert fingerprint(a_case(own, "p")) != before


@pytest.mark.parametrize("change", [{"method": "trilateration"}, {"appearance": False}, {"seed": 1}])
def test_it_changes_with_every_option(cohort: Path, change: dict[str, object]) -> None:
    case = a_case(cohort, "p")
    assert fingerprint(replace(case, **change)) != fingerprint(case)  # type: ignore[arg-type]


def test_a_capture_more_in_a_visit_changes_it(own: Path) -> None:
    visit = own / "visit"
    shutil.copytree(own / "first", visit / "front")
    before = fingerprint(a_case(own, "p", first=str(visit)))
    shutil.copytree(own / "first", visit / "back")
    assert fingerprint(a_case(own, "p", first=str(visit))) != before


def test_files_beside_the_capture_do_not_matter(own: Path) -> None:
    before = fingerprint(a_case(own, "p"))
    (own / "first" / "notes.txt").write_text("x")
    assert fingerprint(a_case(own, "p")) == before
