"""Captures of one simulated patient, made once; every test damages its own copy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from core.capture import write_capture
from devices.simulator import STILL, Bystander, CaptureTruth, Room, SimulatedPatient
from tests.app.cli.cases import copy_of, small_rig, write_lesions


@dataclass(frozen=True, eq=False)
class Shot:
    """A capture folder and the truth about it. Read only: damage a `copy`."""

    folder: Path
    truth: CaptureTruth

    def copy(self, target: Path) -> Path:
        return copy_of(self.folder, target)

    def pixel(self, lesion: str) -> NDArray[np.float64]:
        return np.asarray(self.truth.mole_pixels[self.truth.mole_ids.index(lesion)])

    def point(self, lesion: str) -> NDArray[np.float64]:
        return np.asarray(self.truth.mole_points_m[self.truth.mole_ids.index(lesion)])

    def visible(self) -> list[str]:
        """Lesions of interest in view."""
        seen = zip(self.truth.mole_ids, self.truth.mole_visible, strict=True)
        return [name for name, visible in seen if visible and name.startswith("L")]

    def lesions(self, path: Path, count: int | None = None) -> Path:
        """lesions.json with the lesions in view."""
        return write_lesions(
            path, [{"id": i, "pixel": self.pixel(i).tolist()} for i in self.visible()[:count]]
        )


@pytest.fixture(autouse=True)
def _own_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODERM_LOG_DIR", str(tmp_path / "log"))


@pytest.fixture(scope="session")
def patient() -> SimulatedPatient:
    return SimulatedPatient(
        "m_young_avg", seed=3, moles=30, lesions=20, freckles=0, variation=STILL, rig=small_rig()
    )


def _shot(patient: SimulatedPatient, folder: Path, stance: str, view: str, visit: int) -> Shot:
    taken = patient.capture(stance, view, visit, frames=2, joints=True)
    write_capture(taken.capture, folder)
    return Shot(folder, taken.truth)


@pytest.fixture(scope="session")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("shots")


@pytest.fixture(scope="session")
def first(patient: SimulatedPatient, shots: Path) -> Shot:
    """First visit, psi stance, from the front."""
    return _shot(patient, shots / "first", "psi", "front", 1)


@pytest.fixture(scope="session")
def followup(patient: SimulatedPatient, shots: Path) -> Shot:
    """Second visit, arms down, from the front."""
    return _shot(patient, shots / "followup", "A", "front", 2)


@pytest.fixture(scope="session")
def back(patient: SimulatedPatient, shots: Path) -> Shot:
    """Second visit, from behind."""
    return _shot(patient, shots / "back", "A", "back", 2)


@pytest.fixture(scope="session")
def other_person(shots: Path) -> Shot:
    """A child in the place of the patient."""
    child = SimulatedPatient(
        "child10", seed=8, moles=4, lesions=2, freckles=0, variation=STILL, rig=small_rig()
    )
    return _shot(child, shots / "child", "A", "front", 2)


@pytest.fixture(scope="session")
def two_people(shots: Path) -> Shot:
    """The patient with somebody beside."""
    patient = SimulatedPatient(
        "m_young_avg",
        seed=3,
        moles=30,
        lesions=20,
        freckles=0,
        variation=STILL,
        room=Room(bystander=Bystander()),
        rig=small_rig(),
    )
    return _shot(patient, shots / "two", "A", "front", 2)
