"""Pairs of capture folders that are small and carry their joints: relocated in a second."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from app.batch.case import Case
from core.capture import write_capture
from devices.simulator import STILL, SimulatedPatient
from tests.app.cli.cases import small_rig, write_lesions

METHOD = "voting-dijkstra"


@pytest.fixture(autouse=True)
def _own_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODERM_LOG_DIR", str(tmp_path / "log"))


@pytest.fixture(scope="session")
def cohort(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the captures ``first`` and ``followup`` and a ``lesions.json``. Read only."""
    folder = tmp_path_factory.mktemp("cohort")
    patient = SimulatedPatient(
        "m_young_avg", seed=3, moles=30, lesions=20, freckles=0, variation=STILL, rig=small_rig()
    )
    for name, visit in (("first", 1), ("followup", 2)):
        taken = patient.capture("psi", "front", visit, frames=1, joints=True)
        write_capture(taken.capture, folder / name)
        if name == "first":
            truth = taken.truth
            seen = np.flatnonzero(truth.mole_visible)[:3]
            write_lesions(
                folder / "lesions.json",
                [{"id": truth.mole_ids[i], "pixel": truth.mole_pixels[i].tolist()} for i in seen],
            )
    return folder


def a_case(cohort: Path, name: str, **changes: object) -> Case:
    """A pair that can be relocated, unless told otherwise."""
    values = {
        "first": str(cohort / "first"),
        "followup": str(cohort / "followup"),
        "lesions": str(cohort / "lesions.json"),
        "method": METHOD,
        "appearance": True,
        "seed": 0,
        **changes,
    }
    return Case(name, **values)  # type: ignore[arg-type]


def write_manifest(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    """A manifest with the columns of its first row."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return path


def row(cohort: Path, name: str, **changes: object) -> dict[str, object]:
    """A row of a manifest, paths as they are seen from the manifest beside the cohort's folder."""
    near = {key: os.fspath(cohort / value) for key, value in _PLACES.items()}
    return {"case": name, **near, "method": METHOD, **changes}


_PLACES = {"first": "first", "followup": "followup", "lesions": "lesions.json"}


def read_table(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file by column."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def results_of(folder: Path) -> dict[str, bytes]:
    """Everything that must be the same however a run came about."""
    lasting = [
        [value for key, value in case.items() if key not in ("seconds", "peak_memory_mb")]
        for case in read_table(folder / "cases.csv")
    ]
    return {"results": (folder / "results.csv").read_bytes(), "cases": repr(lasting).encode()}
