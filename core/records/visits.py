"""Visits: opened, written to, closed; or discarded while open."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import delete, func, select

from core.errors import InputError
from core.records.database import Database
from core.records.failures import missing
from core.records.models import LesionRow, ObservationRow, PatientRow, VisitRow
from core.records.records import Visit
from core.records.text import clean_note


def _visit(row: VisitRow) -> Visit:
    return Visit(
        id=row.id,
        patient_id=row.patient_id,
        number=row.number,
        started_at=row.started_at,
        started_by=row.started_by,
        closed_at=row.closed_at,
        closed_by=row.closed_by,
        note=row.note,
    )


class Visits:
    """Visits of all patients."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def create(self, patient_id: int, by: int) -> Visit:
        """Open the next visit of a patient."""
        with self._db.write() as session:
            if session.get(PatientRow, patient_id) is None:
                raise missing("patient")
            last = session.scalar(select(func.max(VisitRow.number)).where(VisitRow.patient_id == patient_id))
            row = VisitRow(
                patient_id=patient_id,
                number=(last or 0) + 1,
                started_at=datetime.now(UTC),
                started_by=by,
                note="",
            )
            session.add(row)
            session.flush()
            return _visit(row)

    def get(self, visit_id: int) -> Visit:
        """One visit."""
        with self._db.read() as session:
            row = session.get(VisitRow, visit_id)
        if row is None:
            raise missing("visit")
        return _visit(row)

    def list(self, patient_id: int) -> list[Visit]:
        """Visits of a patient, first visit first."""
        with self._db.read() as session:
            rows = session.scalars(
                select(VisitRow).where(VisitRow.patient_id == patient_id).order_by(VisitRow.number)
            )
            return [_visit(row) for row in rows]

    def open_visit(self, patient_id: int) -> Visit | None:
        """The latest visit of a patient that is still open, if there is one."""
        return next((visit for visit in reversed(self.list(patient_id)) if visit.is_open), None)

    def previous(self, visit_id: int) -> Visit | None:
        """The visit of the same patient before this one, if there is one."""
        visit = self.get(visit_id)
        earlier = [other for other in self.list(visit.patient_id) if other.number < visit.number]
        return earlier[-1] if earlier else None

    def close(self, visit_id: int, by: int, note: str = "") -> Visit:
        """Finish a visit. A note, if given, replaces the visit's note."""
        with self._db.write() as session:
            row = session.get(VisitRow, visit_id)
            if row is None:
                raise missing("visit")
            if row.closed_at is not None:
                raise InputError("This visit is already closed.")
            row.closed_at, row.closed_by = datetime.now(UTC), by
            row.note = clean_note(note) or row.note
            session.flush()
            return _visit(row)

    def set_note(self, visit_id: int, note: str) -> Visit:
        """Replace the note of a visit."""
        with self._db.write() as session:
            row = session.get(VisitRow, visit_id)
            if row is None:
                raise missing("visit")
            row.note = clean_note(note)
            session.flush()
            return _visit(row)

    def discard(self, visit_id: int, by: int) -> None:
        """Remove an open visit with everything that was recorded in it.

        Raises
        ------
        InputError
            If the visit is closed, or a lesion first marked in it was already seen in another visit.
        """
        with self._db.write() as session:
            row = session.get(VisitRow, visit_id)
            if row is None:
                raise missing("visit")
            if row.closed_at is not None:
                raise InputError("A closed visit cannot be discarded.", "Correct its lesions one by one.")
            seen_elsewhere = session.scalar(
                select(func.count())
                .select_from(ObservationRow)
                .join(LesionRow, ObservationRow.lesion_id == LesionRow.id)
                .where(LesionRow.visit_id == visit_id, ObservationRow.visit_id != visit_id)
            )
            if seen_elsewhere:
                raise InputError(
                    "A lesion first marked in this visit was seen in another visit.",
                    "Close the visit instead, and mark the lesion as removed.",
                )
            session.execute(delete(LesionRow).where(LesionRow.visit_id == visit_id))
            session.execute(delete(VisitRow).where(VisitRow.id == visit_id))
