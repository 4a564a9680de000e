"""Lesions of patients."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from core.errors import InputError
from core.records.database import Database
from core.records.failures import missing
from core.records.models import DermoscopicImageRow, LesionRow, ObservationRow, VisitRow
from core.records.records import LATERALITIES, LESION_STATES, AnatomicSite, Lesion
from core.records.text import clean_note


class Unchanged:
    """Marks an argument that was not given, where None has a meaning of its own."""


UNCHANGED = Unchanged()


def _lesion(row: LesionRow) -> Lesion:
    site = None
    if row.site_code is not None:
        site = AnatomicSite(row.site_code, row.site_scheme or "", row.site_meaning or "", row.laterality)  # type: ignore[arg-type]
    return Lesion(
        id=row.id,
        patient_id=row.patient_id,
        visit_id=row.visit_id,
        number=row.number,
        site=site,
        state=row.state,  # type: ignore[arg-type]
        note=row.note,
        created_at=row.created_at,
        created_by=row.created_by,
        updated_at=row.updated_at,
        updated_by=row.updated_by,
    )


def _set_site(row: LesionRow, site: AnatomicSite | None) -> None:
    if site is not None and site.laterality not in LATERALITIES:
        raise InputError("The side of a site is left, right or not given.")
    row.site_code = None if site is None else site.code
    row.site_scheme = None if site is None else site.scheme
    row.site_meaning = None if site is None else site.meaning
    row.laterality = "" if site is None else site.laterality


class Lesions:
    """Lesions of all patients."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def create(
        self,
        patient_id: int,
        visit_id: int,
        site: AnatomicSite | None = None,
        note: str = "",
        *,
        by: int,
    ) -> Lesion:
        """Record a new lesion, first marked in this visit; it gets the patient's next number."""
        now = datetime.now(UTC)
        with self._db.write() as session:
            visit = session.get(VisitRow, visit_id)
            if visit is None or visit.patient_id != patient_id:
                raise missing("visit")
            last = session.scalar(
                select(func.max(LesionRow.number)).where(LesionRow.patient_id == patient_id)
            )
            row = LesionRow(
                patient_id=patient_id,
                visit_id=visit_id,
                number=(last or 0) + 1,
                state="active",
                note=clean_note(note),
                created_at=now,
                created_by=by,
                updated_at=now,
                updated_by=by,
            )
            _set_site(row, site)
            session.add(row)
            session.flush()
            return _lesion(row)

    def get(self, lesion_id: int) -> Lesion:
        """One lesion."""
        with self._db.read() as session:
            return _lesion(self._row(session, lesion_id))

    def list(self, patient_id: int) -> list[Lesion]:
        """Lesions of a patient, by number."""
        with self._db.read() as session:
            rows = session.scalars(
                select(LesionRow).where(LesionRow.patient_id == patient_id).order_by(LesionRow.number)
            )
            return [_lesion(row) for row in rows]

    def update(
        self,
        lesion_id: int,
        *,
        by: int,
        site: AnatomicSite | Unchanged | None = UNCHANGED,
        note: str | None = None,
        state: str | None = None,
    ) -> Lesion:
        """Change what is given: the site (None clears it), the note, the state."""
        if state is not None and state not in LESION_STATES:
            raise InputError("A lesion is either active or removed.")
        with self._db.write() as session:
            row = self._row(session, lesion_id)
            if not isinstance(site, Unchanged):
                _set_site(row, site)
            if note is not None:
                row.note = clean_note(note)
            if state is not None:
                row.state = state
            row.updated_at, row.updated_by = datetime.now(UTC), by
            session.flush()
            return _lesion(row)

    def discard(self, lesion_id: int, by: int) -> None:
        """Remove a lesion marked by mistake, while the visit it was first marked in is open.

        Raises
        ------
        InputError
            If that visit is closed, or the lesion was recorded in another visit.
        """
        with self._db.write() as session:
            row = self._row(session, lesion_id)
            visit = session.get_one(VisitRow, row.visit_id)
            elsewhere = sum(
                session.scalar(
                    select(func.count())
                    .select_from(table)
                    .where(table.lesion_id == lesion_id, table.visit_id != row.visit_id)
                )
                or 0
                for table in (ObservationRow, DermoscopicImageRow)
            )
            if visit.closed_at is not None or elsewhere:
                raise InputError(
                    "This lesion belongs to a closed visit.",
                    "Set its state to removed, or reject the finding.",
                )
            session.execute(delete(LesionRow).where(LesionRow.id == lesion_id))

    @staticmethod
    def _row(session: Session, lesion_id: int) -> LesionRow:
        row = session.get(LesionRow, lesion_id)
        if row is None:
            raise missing("lesion")
        return row
