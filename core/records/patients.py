"""Patients: entering, changing, finding."""

from __future__ import annotations

from datetime import UTC, date, datetime

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from core.errors import InputError
from core.records.database import Database
from core.records.failures import missing
from core.records.models import LesionRow, PatientRow, VisitRow
from core.records.records import SEXES, Patient, PatientDraft, PatientSummary
from core.records.text import clean_line, clean_note, patient_search_key, search_form


def _patient(row: PatientRow) -> Patient:
    return Patient(
        id=row.id,
        family_name=row.family_name,
        given_name=row.given_name,
        birth_date=row.birth_date,
        sex=row.sex,  # type: ignore[arg-type]
        clinic_number=row.clinic_number,
        note=row.note,
        created_at=row.created_at,
        created_by=row.created_by,
        updated_at=row.updated_at,
        updated_by=row.updated_by,
    )


class Patients:
    """Patients of one clinic."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def create(self, draft: PatientDraft, by: int) -> Patient:
        """Enter a patient.

        Raises
        ------
        InputError
            If the family name is empty, the birth date impossible or the clinic number taken.
        """
        now = datetime.now(UTC)
        with self._db.write() as session:
            row = PatientRow(created_at=now, created_by=by)
            self._fill(session, row, draft, by, now)
            session.add(row)
            session.flush()
            return _patient(row)

    def update(self, patient_id: int, draft: PatientDraft, by: int) -> Patient:
        """Change what is known about a patient; the draft replaces every field."""
        with self._db.write() as session:
            row = session.get(PatientRow, patient_id)
            if row is None:
                raise missing("patient")
            self._fill(session, row, draft, by, datetime.now(UTC))
            session.flush()
            return _patient(row)

    def get(self, patient_id: int) -> Patient:
        """One patient."""
        with self._db.read() as session:
            row = session.get(PatientRow, patient_id)
        if row is None:
            raise missing("patient")
        return _patient(row)

    def count(self) -> int:
        """How many patients there are."""
        with self._db.read() as session:
            return session.scalar(select(func.count()).select_from(PatientRow)) or 0

    def search(self, text: str = "", limit: int = 200) -> list[PatientSummary]:
        """Patients whose names or clinic number have words that begin with each word of ``text``.

        Accents, case and punctuation do not matter; an empty text lists everyone. Sorted by name.
        """
        words = search_form(text).split()
        with self._db.read() as session:
            query = select(PatientRow).order_by(PatientRow.search_key, PatientRow.id).limit(limit)
            for word in words:
                query = query.where(PatientRow.search_key.contains(f" {word}", autoescape=True))
            rows = list(session.scalars(query))
            return self._summaries(session, rows)

    def summary(self, patient_id: int) -> PatientSummary:
        """One row of the patient list."""
        with self._db.read() as session:
            row = session.get(PatientRow, patient_id)
            if row is None:
                raise missing("patient")
            return self._summaries(session, [row])[0]

    @staticmethod
    def _summaries(session: Session, rows: list[PatientRow]) -> list[PatientSummary]:
        ids = [row.id for row in rows]
        visits = {
            patient_id: (count, last)
            for patient_id, count, last in session.execute(
                select(VisitRow.patient_id, func.count(), func.max(VisitRow.started_at))
                .where(VisitRow.patient_id.in_(ids))
                .group_by(VisitRow.patient_id)
            )
        }
        lesions: dict[int, int] = {}
        for patient_id, count in session.execute(
            select(LesionRow.patient_id, func.count())
            .where(LesionRow.patient_id.in_(ids))
            .group_by(LesionRow.patient_id)
        ):
            lesions[patient_id] = count
        summaries = []
        for row in rows:
            count, last = visits.get(row.id, (0, None))
            summaries.append(PatientSummary(_patient(row), count, lesions.get(row.id, 0), last))
        return summaries

    @staticmethod
    def _fill(session: Session, row: PatientRow, draft: PatientDraft, by: int, now: datetime) -> None:
        row.family_name = clean_line(draft.family_name, "family name", longest=200, required=True)
        row.given_name = clean_line(draft.given_name, "given name", longest=200)
        row.clinic_number = clean_line(draft.clinic_number, "clinic number", longest=64)
        if draft.sex not in SEXES:
            raise InputError("The sex must be one of F, M, O, U.")
        row.sex = draft.sex
        if draft.birth_date is not None and not date(1880, 1, 1) <= draft.birth_date <= date.today():
            raise InputError("The birth date is not possible.", "Correct the birth date.")
        row.birth_date = draft.birth_date
        row.note = clean_note(draft.note)
        row.search_key = patient_search_key(row.family_name, row.given_name, row.clinic_number)
        row.clinic_number_key = search_form(row.clinic_number).replace(" ", "")[:64] or None
        row.updated_at, row.updated_by = now, by
        if row.clinic_number_key is not None:
            with session.no_autoflush:
                other = session.scalar(
                    select(PatientRow.id).where(PatientRow.clinic_number_key == row.clinic_number_key)
                )
            if other is not None and other != row.id:
                raise InputError(
                    "Another patient has this clinic number.",
                    "Search for the number: the patient may already be entered.",
                )
