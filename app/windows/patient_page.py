"""One patient: visits, lesions, the body with its lesions; and always the next step."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, Signal, Slot
from PySide6.QtWidgets import (
    QFileDialog,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.context import AppContext
from app.theme import ICON_SIZE, icon, palette, style_class
from app.widgets.status import EmptyState, MessageBanner, ProgressOverlay
from app.widgets.tables import Column, LesionRow, LesionTable, Row, RowTable
from app.windows.compare_sheet import CompareSheet
from app.windows.patient_body import PatientBody
from app.windows.patient_model import LesionSummary, PatientModel
from app.windows.patient_sheet import PatientSheet
from app.workflows.wording import when
from core.errors import GeodermError
from core.progress import Progress

if TYPE_CHECKING:
    from core.records import Visit

_SEX = {"F": "female", "M": "male", "O": "other", "U": ""}


class PatientPage(QWidget):
    """See the module's documentation.

    Signals
    -------
    back()
        To the list.
    visit_requested(object)
        Visit id, or None for a new visit.
    """

    back = Signal()
    visit_requested = Signal(object)

    def __init__(self, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("patient_page")
        style_class(self, "page")
        self._context = context
        self._model: PatientModel | None = None
        self._selected: str | None = None
        self.title = QLabel()
        self.title.setObjectName("patient_title")
        style_class(self.title, "title")
        self.details = QLabel()
        self.details.setObjectName("patient_details")
        style_class(self.details, "secondary")
        self.banner = MessageBanner()
        self.visits = RowTable([Column("Visit", 72), Column("Date"), Column("State", 90)])
        self.visits.setObjectName("visit_table")
        self.visits.activated_key.connect(lambda key: self.visit_requested.emit(int(key)))
        self.visits.selected_changed.connect(lambda _: self._show_buttons())
        self.lesions = LesionTable()
        self.lesions.selected_changed.connect(self.select)
        self.lesions.activated_key.connect(self._compare)
        self.body_card = PatientBody(context)
        self.body_card.lesion_clicked.connect(self.select)
        self.body_card.lesion_activated.connect(self._compare)
        self.body_card.failed.connect(self.banner.show_failure)
        self._build()
        self.overlay = ProgressOverlay(self)
        context.privacy_changed.connect(lambda _: self._show_header())
        context.records_changed.connect(self._on_records)

    # -- layout ------------------------------------------------------------------------------------

    def _build(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(32, 20, 32, 24)
        column.setSpacing(16)
        column.addLayout(self._header())
        column.addWidget(self.banner)
        left = QVBoxLayout()
        left.setSpacing(16)
        left.addWidget(self._card("Visits", self._visit_stack(), self._visit_tools()), 2)
        left.addWidget(self._card("Lesions", self._lesion_stack(), self._lesion_tools()), 3)
        row = QHBoxLayout()
        row.setSpacing(16)
        row.addLayout(left, 5)
        row.addWidget(self._card("Body", self.body_card, [self.body_card.switch]), 4)
        column.addLayout(row, 1)

    def _header(self) -> QHBoxLayout:
        back = QToolButton()
        back.setObjectName("patient_back")
        back.setIcon(icon("back", palette.TEXT))
        back.setIconSize(QSize(22, 22))
        back.setToolTip("Back to the patients")
        style_class(back, "icon")
        back.clicked.connect(self.back)
        self.edit = QPushButton(icon("edit", palette.TEXT), " Edit")
        self.edit.setObjectName("edit_patient")
        self.edit.setIconSize(ICON_SIZE)
        self.edit.clicked.connect(self._edit)
        self.start = QPushButton()
        self.start.setObjectName("start_visit")
        style_class(self.start, "primary")
        self.start.clicked.connect(self._start)
        names = QVBoxLayout()
        names.setSpacing(0)
        names.addWidget(self.title)
        names.addWidget(self.details)
        row = QHBoxLayout()
        row.setSpacing(12)
        row.addWidget(back, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(names, 1)
        row.addWidget(self.edit)
        row.addWidget(self.start)
        return row

    @staticmethod
    def _card(title: str, content: QWidget, tools: list[QWidget]) -> QFrame:
        card = QFrame()
        style_class(card, "card")
        heading = QLabel(title)
        style_class(heading, "heading")
        head = QHBoxLayout()
        head.setSpacing(8)
        head.addWidget(heading)
        head.addStretch(1)
        for tool in tools:
            head.addWidget(tool)
        column = QVBoxLayout(card)
        column.setContentsMargins(20, 12, 20, 12)
        column.setSpacing(8)
        column.addLayout(head)
        column.addWidget(content, 1)
        return card

    def _tool(self, name: str, text: str, symbol: str) -> QPushButton:
        button = QPushButton(icon(symbol, palette.ACCENT), f" {text}")
        button.setObjectName(name)
        button.setIconSize(QSize(18, 18))
        style_class(button, "quiet")
        return button

    def _visit_tools(self) -> list[QWidget]:
        self.open_visit = self._tool("open_visit", "Open", "eye")
        self.open_visit.clicked.connect(self._open_selected_visit)
        self.report = self._tool("visit_report", "Report", "report")
        self.report.clicked.connect(self._ask_report)
        return [self.open_visit, self.report]

    def _lesion_tools(self) -> list[QWidget]:
        self.compare = self._tool("compare_dermoscopy", "Compare dermoscopy", "compare")
        self.compare.clicked.connect(lambda: self._compare(self._selected or ""))
        return [self.compare]

    def _visit_stack(self) -> QStackedWidget:
        self.no_visits = EmptyState("calendar", "No visits yet", "The first one marks the lesions.")
        self.visit_stack = QStackedWidget()
        self.visit_stack.addWidget(self.visits)
        self.visit_stack.addWidget(self.no_visits)
        return self.visit_stack

    def _lesion_stack(self) -> QStackedWidget:
        self.no_lesions = EmptyState("target", "No lesions yet", "They are marked in a visit, on the photo.")
        self.lesion_stack = QStackedWidget()
        self.lesion_stack.addWidget(self.lesions)
        self.lesion_stack.addWidget(self.no_lesions)
        return self.lesion_stack

    # -- what is shown -----------------------------------------------------------------------------

    @property
    def patient_id(self) -> int | None:
        """Whose page it is."""
        return None if self._model is None else self._model.patient.id

    def show_patient(self, patient_id: int) -> None:
        """Show a patient."""
        if patient_id != self.patient_id:
            self._selected = None
            self.body_card.forget()
            self.banner.clear()
        self._model = PatientModel.load(self._context.store, patient_id)
        self._show_header()
        self._show_visits()
        self._show_lesions()
        self.body_card.show_model(self._model, self._selected)
        self._show_buttons()

    @Slot(int)
    def _on_records(self, patient_id: int) -> None:
        if patient_id == self.patient_id and self.isVisible():
            self.show_patient(patient_id)

    def _show_header(self) -> None:
        if self._model is None:
            return
        p = self._model.patient
        self.title.setText(self._context.patient_title(p))
        parts = []
        if not self._context.privacy_mode and p.birth_date is not None:
            parts.append(f"born {p.birth_date:%d %b %Y}, {p.age_on(date.today())} years")
        hidden = self._context.privacy_mode  # a note may name the patient, too
        parts += [_SEX[p.sex], "" if hidden else p.clinic_number, "" if hidden else p.note]
        self.details.setText("   ·   ".join(x for x in parts if x))
        self.start.setText(self._model.next_step)

    def _show_visits(self) -> None:
        assert self._model is not None
        rows = [
            Row(
                str(v.id),
                (str(v.number), when(v.started_at), "open" if v.is_open else "closed"),
                colors={2: palette.AMBER if v.is_open else palette.SECONDARY},
                strong=frozenset({0}),
            )
            for v in reversed(self._model.visits)
        ]
        came = len(rows) != len(self.visits.rows())
        self.visits.set_rows(rows)
        self.visit_stack.setCurrentWidget(self.visits if rows else self.no_visits)
        if rows and (came or self.visits.selected() is None):
            self.visits.set_selected(rows[0].key)

    def _show_lesions(self) -> None:
        assert self._model is not None
        self.lesions.set_lesions(
            [
                LesionRow(
                    str(s.lesion.id),
                    s.lesion.number,
                    s.lesion.site.name if s.lesion.site else "no site yet",
                    f"{s.size_mm:g} mm" if s.size_mm else "",
                    s.status,
                    s.tone,
                    s.last_seen,
                    s.images,
                )
                for s in self._model.lesions
            ]
        )
        self.lesion_stack.setCurrentWidget(self.lesions if self._model.lesions else self.no_lesions)
        self.lesions.set_selected(self._selected)

    def _show_buttons(self) -> None:
        visit = self._selected_visit()
        self.open_visit.setEnabled(visit is not None)
        self.report.setEnabled(visit is not None)
        chosen = self._chosen_lesion()
        self.compare.setEnabled(chosen is not None and chosen.images > 0)

    def _chosen_lesion(self) -> LesionSummary | None:
        if self._model is None:
            return None
        return next((s for s in self._model.lesions if str(s.lesion.id) == self._selected), None)

    def _selected_visit(self) -> Visit | None:
        key = self.visits.selected()
        if self._model is None or key is None:
            return None
        return next((v for v in self._model.visits if v.id == int(key)), None)

    @Slot(str)
    def select(self, lesion_id: str) -> None:
        """Select a lesion in every view."""
        self._selected = lesion_id
        self.lesions.set_selected(lesion_id)
        self.body_card.set_selected(lesion_id)
        self._show_buttons()

    # -- what is done ------------------------------------------------------------------------------

    @Slot()
    def _start(self) -> None:
        if self._model is not None:
            open_visit = self._model.open_visit
            self.visit_requested.emit(None if open_visit is None else open_visit.id)

    @Slot()
    def _open_selected_visit(self) -> None:
        visit = self._selected_visit()
        if visit is not None:
            self.visit_requested.emit(visit.id)

    @Slot(str)
    def _compare(self, lesion_id: str) -> None:
        self.select(lesion_id)
        chosen = self._chosen_lesion()
        if chosen is None:
            return
        if chosen.images == 0:
            self.banner.show_info(
                f"Lesion {chosen.lesion.number} has no dermoscopic image.", "Attach one during a visit."
            )
            return
        CompareSheet(self, self._context.store, chosen.lesion).open()

    @Slot()
    def _edit(self) -> None:
        if self._model is not None:
            sheet = PatientSheet(self, self._context, self._model.patient, lambda p: self.show_patient(p.id))
            sheet.open(sheet.family)

    @Slot()
    def _ask_report(self) -> None:
        visit = self._selected_visit()
        if visit is None or self._model is None:
            return
        patient = self._model.patient
        number = patient.clinic_number or f"patient-{patient.id}"
        name = f"{number}-visit-{visit.number}.pdf".replace("/", "-")
        start = str(Path(self._context.settings.export_folder or Path.home()) / name)
        path, _ = QFileDialog.getSaveFileName(self, "Export report", start, "PDF (*.pdf)")
        if path:
            self.export_report(visit.id, Path(path))

    def export_report(self, visit_id: int, path: Path) -> None:
        """Write the report of a visit."""
        user = self._context.user
        store = self._context.store
        if user is None:
            return

        def work(progress: Progress) -> None:
            from core.exchange.report import write_visit_report

            progress(0.1, "Writing the report")
            write_visit_report(store, visit_id, path, created_by=user)

        task = self._context.tasks.start("Writing the report", work, cancellable=False)
        task.finished.connect(lambda _: self.banner.show_success("The report is written.", str(path)))
        task.failed.connect(self.banner.show_failure)
        self.overlay.attach(task)

    def report_error(self, error: GeodermError) -> None:
        """Show an error of the world above the page."""
        self.banner.show_error(error.message, error.advice)
