"""What the patient page shows, read from the records in one go. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

from app.workflows.snapshot import has_place
from app.workflows.wording import describe
from core.records import CaptureRecord, ClinicStore, Lesion, Observation, Patient, Visit


@dataclass(frozen=True)
class LesionSummary:
    """A lesion as the patient page lists it."""

    lesion: Lesion
    last: Observation | None
    status: str
    tone: str
    last_seen: str
    size_mm: float | None
    images: int


@dataclass(frozen=True)
class PatientModel:
    """A patient with visits, lesions and the newest captures with lesions on them.

    Attributes
    ----------
    patient : Patient
    visits : tuple of Visit
        Oldest first.
    lesions : tuple of LesionSummary
    views : tuple of CaptureRecord
        The newest working captures, one per view, of the last visit that has any.
    """

    patient: Patient
    visits: tuple[Visit, ...]
    lesions: tuple[LesionSummary, ...]
    views: tuple[CaptureRecord, ...]

    @classmethod
    def load(cls, store: ClinicStore, patient_id: int) -> PatientModel:
        """Read it."""
        visits = tuple(store.visits.list(patient_id))
        views: dict[str, CaptureRecord] = {}
        for visit in reversed(visits):
            for record in store.captures.list(visit.id):
                if record.role == "working":
                    views[record.view] = record
            if views:
                break
        names = {user.id: user.display_name for user in store.users.list()}
        lesions = tuple(
            _summary(store, lesion, names, {v.id: v for v in visits})
            for lesion in store.lesions.list(patient_id)
        )
        return cls(store.patients.get(patient_id), visits, lesions, tuple(views.values()))

    @property
    def open_visit(self) -> Visit | None:
        """The visit that is not closed, if any."""
        return next((v for v in reversed(self.visits) if v.is_open), None)

    @property
    def next_step(self) -> str:
        """What the primary button says."""
        if self.open_visit is not None:
            return "Continue visit"
        return "Start follow-up" if self.visits else "Start first visit"

    def on_capture(self, store: ClinicStore, capture_id: int) -> list[tuple[LesionSummary, Observation]]:
        """Lesions that have a place on a capture."""
        found = []
        for summary in self.lesions:
            for o in store.observations.for_lesion(summary.lesion.id):
                if o.capture_id == capture_id and has_place(o):
                    found.append((summary, o))
        return found


def _summary(
    store: ClinicStore, lesion: Lesion, names: dict[int, str], visits: dict[int, Visit]
) -> LesionSummary:
    seen = store.observations.for_lesion(lesion.id)
    newest = [o for o in seen if o.visit_id == seen[-1].visit_id]
    last = max(newest, key=lambda o: (has_place(o), o.id), default=None)
    text = describe(last, lambda user_id: names.get(user_id, "unknown user"))
    removed = lesion.state == "removed"
    placed = [o for o in seen if has_place(o) and o.visit_id in visits]
    sizes = [o.size_mm for o in seen if o.size_mm is not None]
    return LesionSummary(
        lesion,
        last,
        "Removed by physician" if removed else text.label,
        "removed" if removed else text.tone,
        f"{visits[placed[-1].visit_id].started_at.astimezone():%d %b %Y}" if placed else "",
        sizes[-1] if sizes else None,
        len(store.dermoscopy.for_lesion(lesion.id)),
    )
