"""The list of patients, with search."""

from __future__ import annotations

from PySide6.QtCore import QTimer, Signal, Slot
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QStackedWidget, QVBoxLayout, QWidget

from app.context import AppContext
from app.theme import ICON_SIZE, icon, palette, style_class
from app.widgets.forms import line_edit
from app.widgets.status import EmptyState
from app.widgets.tables import Column, Row, RowTable
from app.windows.patient_sheet import PatientSheet
from core.records import Patient, PatientSummary

_LIMIT = 200
_TYPING_PAUSE_MS = 120


class PatientsPage(QWidget):
    """Search, list, new patient.

    Signals
    -------
    patient_opened(int)
        Id of the patient to show.
    """

    patient_opened = Signal(int)

    def __init__(self, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("patients_page")
        style_class(self, "page")
        self._context = context
        self.search = line_edit("patient_search", "Search by name or clinic number")
        self.search.setMinimumWidth(420)
        self._pause = QTimer(self, singleShot=True, interval=_TYPING_PAUSE_MS)
        self._pause.timeout.connect(self.refresh)
        self.search.textChanged.connect(lambda: self._pause.start())
        self.search.returnPressed.connect(self._open_selected)
        self.new_button = QPushButton(icon("plus", palette.TEXT), " New patient")
        self.new_button.setObjectName("new_patient")
        self.new_button.setIconSize(ICON_SIZE)
        self.new_button.clicked.connect(self.new_patient)
        self.open_button = QPushButton("Open patient")
        self.open_button.setObjectName("open_patient")
        style_class(self.open_button, "primary")
        self.open_button.clicked.connect(self._open_selected)
        self.table = RowTable(
            [
                Column("Patient"),
                Column("Clinic number", 160),
                Column("Born", 140),
                Column("Visits", 90, number=True),
                Column("Lesions", 100, number=True),
                Column("Last visit", 150),
            ]
        )
        self.table.setObjectName("patient_table")
        self.table.activated_key.connect(lambda key: self.patient_opened.emit(int(key)))
        self.table.selected_changed.connect(lambda _: self._show_open())
        self.count = QLabel()
        self.count.setObjectName("patient_count")
        style_class(self.count, "caption")
        self.empty = EmptyState("patients", "No patients yet", "Enter the first one.", "New patient")
        self.empty.action_triggered.connect(self.new_patient)
        for button in self.empty.findChildren(QPushButton):
            style_class(button, "primary")
        self.nobody = EmptyState("search", "Nobody found", "Try a shorter part of the name or the number.")
        self._build()
        context.privacy_changed.connect(lambda _: self.refresh())
        context.records_changed.connect(self._on_records)

    def _build(self) -> None:
        title = QLabel("Patients")
        style_class(title, "title")
        top = QHBoxLayout()
        top.setSpacing(12)
        top.addWidget(title)
        top.addSpacing(24)
        top.addWidget(self.search)
        top.addStretch(1)
        top.addWidget(self.new_button)
        top.addWidget(self.open_button)
        card = QFrame()
        style_class(card, "card")
        inside = QVBoxLayout(card)
        inside.setContentsMargins(8, 8, 8, 8)
        self.stack = QStackedWidget()
        for page in (self.table, self.empty, self.nobody):
            self.stack.addWidget(page)
        inside.addWidget(self.stack)
        column = QVBoxLayout(self)
        column.setContentsMargins(32, 24, 32, 16)
        column.setSpacing(16)
        column.addLayout(top)
        column.addWidget(card, 1)
        column.addWidget(self.count)

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102
        super().showEvent(event)
        self.refresh()
        self.search.setFocus()

    @Slot(int)
    def _on_records(self, patient_id: int) -> None:
        if self.isVisible():
            self.refresh()

    @Slot()
    def refresh(self) -> None:
        """Read the list again."""
        text = self.search.text()
        found = self._context.store.patients.search(text, limit=_LIMIT)
        self.table.set_rows([self._row(s) for s in found])
        if len(found) == 1 and text.strip():
            self.table.set_selected(str(found[0].patient.id))
        page = self.table if found else self.nobody if text.strip() else self.empty
        self.stack.setCurrentWidget(page)
        shown = f"{len(found)} patient{'s' if len(found) != 1 else ''}"
        self.count.setText(
            f"The first {_LIMIT} patients; type to narrow down" if len(found) == _LIMIT else shown
        )
        self.new_button.setVisible(page is not self.empty)
        self.open_button.setVisible(page is not self.empty)
        self._show_open()

    def _row(self, summary: PatientSummary) -> Row:
        p = summary.patient
        hidden = self._context.privacy_mode
        return Row(
            key=str(p.id),
            cells=(
                self._context.patient_title(p),
                p.clinic_number,
                "" if hidden or p.birth_date is None else p.birth_date.strftime("%d %b %Y"),
                str(summary.visit_count),
                str(summary.lesion_count),
                ""
                if summary.last_visit_at is None
                else summary.last_visit_at.astimezone().strftime("%d %b %Y"),
            ),
            strong=frozenset({0}),
            colors=dict.fromkeys((1, 2, 5), palette.SECONDARY),
        )

    def _show_open(self) -> None:
        self.open_button.setEnabled(self.table.selected() is not None)

    @Slot()
    def _open_selected(self) -> None:
        self._pause.stop()
        self.refresh()
        key = self.table.selected()
        if key is not None:
            self.patient_opened.emit(int(key))

    @Slot()
    def new_patient(self) -> None:
        """Ask for a new patient and open it."""

        def opened(patient: Patient) -> None:
            self.patient_opened.emit(patient.id)

        sheet = PatientSheet(self, self._context, None, opened)
        sheet.open(sheet.family)
