"""The form of a patient: new, or changed."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QWidget

from app.context import AppContext
from app.theme import style_class
from app.widgets.forms import Field, line_edit
from app.widgets.sheet import Sheet
from core.errors import GeodermError
from core.records import Patient, PatientDraft

_SEXES = (("Female", "F"), ("Male", "M"), ("Other", "O"), ("Not stated", "U"))
_EARLIEST = date(1900, 1, 1)


def parse_birth_date(text: str) -> date | None:
    """Date of ``YYYY-MM-DD`` or ``DD.MM.YYYY``; None for an empty text.

    Raises
    ------
    ValueError
        With a sentence for the user.
    """
    text = text.strip()
    if not text:
        return None
    try:
        if "." in text:
            day, month, year = (int(part) for part in text.split("."))
            born = date(year, month, day)
        else:
            born = date.fromisoformat(text)
    except ValueError as error:
        raise ValueError("Write the date as 1986-05-14 or 14.05.1986.") from error
    if not _EARLIEST <= born <= date.today():
        raise ValueError("This date of birth is not possible.")
    return born


class PatientSheet(Sheet):
    """Asks for what the report needs.

    Parameters
    ----------
    parent : QWidget
    context : AppContext
    patient : Patient or None
        The patient to change; None for a new one.
    saved : callable
        Called with the stored patient.
    """

    def __init__(
        self,
        parent: QWidget,
        context: AppContext,
        patient: Patient | None,
        saved: Callable[[Patient], object],
    ) -> None:
        super().__init__(parent, "New patient" if patient is None else "Patient", "patient_sheet", width=560)
        self._context, self._patient, self._saved = context, patient, saved
        self.family = line_edit("patient_family_name")
        self.given = line_edit("patient_given_name")
        self.born = line_edit("patient_birth_date", "YYYY-MM-DD")
        self.number = line_edit("patient_clinic_number")
        self.note = line_edit("patient_note")
        self.sex = QComboBox()
        self.sex.setObjectName("patient_sex")
        for label, code in _SEXES:
            self.sex.addItem(label, code)
        self.sex.setCurrentIndex(len(_SEXES) - 1)
        self._family_field = Field("Family name", self.family)
        self._born_field = Field("Date of birth", self.born)
        self._number_field = Field("Clinic number", self.number)
        for pair in (
            (self._family_field, Field("Given name", self.given)),
            (self._born_field, Field("Sex", self.sex)),
        ):
            row = QHBoxLayout()
            row.setSpacing(16)
            for field in pair:
                row.addWidget(field, 1)
            self.body.addLayout(row)
        self.body.addWidget(self._number_field)
        self.body.addWidget(Field("Note", self.note))
        self._problem = QLabel()
        self._problem.setObjectName("patient_error")
        self._problem.setWordWrap(True)
        style_class(self._problem, "field-error")
        self._problem.hide()
        self.body.addWidget(self._problem)
        self.add_button("Cancel", "secondary", self.close_sheet, "patient_cancel")
        self.add_button("Save patient", "primary", self._save, "patient_save")
        if patient is not None:
            self._fill(patient)

    def _fill(self, patient: Patient) -> None:
        self.family.setText(patient.family_name)
        self.given.setText(patient.given_name)
        self.born.setText(patient.birth_date.isoformat() if patient.birth_date else "")
        self.number.setText(patient.clinic_number)
        self.note.setText(patient.note)
        self.sex.setCurrentIndex(self.sex.findData(patient.sex))

    def _save(self) -> None:
        if not self.family.text().strip():
            self._family_field.set_error("The family name is needed.")
            self.family.setFocus()
            return
        try:
            born = parse_birth_date(self.born.text())
        except ValueError as error:
            self._born_field.set_error(str(error))
            self.born.setFocus()
            return
        draft = PatientDraft(
            self.family.text(),
            self.given.text(),
            born,
            str(self.sex.currentData()),
            self.number.text(),
            self.note.text(),
        )
        patients = self._context.store.patients
        try:
            stored = (
                patients.create(draft, by=self._context.user_id)
                if self._patient is None
                else patients.update(self._patient.id, draft, by=self._context.user_id)
            )
        except GeodermError as error:
            self._problem.setText(str(error))
            self._problem.show()
            return
        self.close_sheet()
        self._context.touch(stored.id)
        self._saved(stored)
