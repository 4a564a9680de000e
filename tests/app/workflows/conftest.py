"""One simulated patient at two visits, captured small, for every test of the visit session."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.workflows.session import VisitSession
from app.workflows.table import Event
from core.anchors import SkeletonTracker
from core.records import ClinicStore, Patient, PatientDraft, User
from devices.simulator import SimulatedCapture, SimulatedPatient
from devices.simulator.room import make_rig
from devices.trackers import default_tracker

Take = Callable[..., SimulatedCapture]


@pytest.fixture(scope="session")
def tracker() -> SkeletonTracker:
    return default_tracker()


@pytest.fixture(scope="session")
def take() -> Take:
    """Captures of one patient, each made once: stance, view, visit."""
    patient = SimulatedPatient("m_young_avg", seed=4, moles=60, freckles=40, rig=make_rig((640, 480)))
    made: dict[tuple[object, ...], SimulatedCapture] = {}

    def capture(stance: str, visit: int, view: str = "front") -> SimulatedCapture:
        key = (stance, visit, view)
        if key not in made:
            made[key] = patient.capture(stance, view, visit, frames=2)
        return made[key]

    return capture


@dataclass
class Clinic:
    """An empty clinic with a doctor and a patient."""

    store: ClinicStore
    user: User
    patient: Patient
    tracker: SkeletonTracker

    def session(self, visit_id: int | None = None) -> VisitSession:
        if visit_id is not None:
            return VisitSession(self.store, self.user.id, visit_id, lambda: self.tracker)
        return VisitSession.begin(self.store, self.user.id, self.patient.id, lambda: self.tracker)


@pytest.fixture
def clinic(tmp_path: Path, tracker: SkeletonTracker) -> Iterator[Clinic]:
    store = ClinicStore.open(tmp_path / "clinic")
    user = store.users.create("weber", "Dr Anna Weber", "a long password 1")
    patient = store.patients.create(PatientDraft("Müller", "Jörg"), by=user.id)
    yield Clinic(store, user, patient, tracker)
    store.close()


def seen_lesions(capture: SimulatedCapture, count: int) -> dict[str, tuple[float, float]]:
    """Pixels of the first lesions of interest that this capture shows."""
    truth = capture.truth
    shown = {
        name: (float(u), float(v))
        for name, (u, v), visible in zip(truth.mole_ids, truth.mole_pixels, truth.mole_visible, strict=True)
        if visible and name.startswith("L")
    }
    return dict(list(shown.items())[:count])


def capture_stance(session: VisitSession, psi: SimulatedCapture) -> None:
    session.adopt_stance(session.take_stance(psi.capture))


def capture_body(session: VisitSession, body: SimulatedCapture) -> None:
    session.fire(Event.GO_CAPTURE)
    session.adopt_working(session.take_working(body.capture))


def close_first_visit(session: VisitSession, take: Take, lesions: int = 3) -> dict[str, int]:
    """A whole first visit; returns the lesion ids by the simulator's names."""
    capture_stance(session, take("psi", 1))
    body = take("A", 1)
    capture_body(session, body)
    session.fire(Event.GO_LESIONS)
    capture_id = session.snapshot.views["front"]
    marked = {
        name: session.mark(capture_id, pixel)[0].id for name, pixel in seen_lesions(body, lesions).items()
    }
    session.fire(Event.GO_REVIEW)
    session.close()
    return marked
