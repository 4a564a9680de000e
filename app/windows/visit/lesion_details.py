"""Everything about the selected lesion: status, decision, site, size, note, dermoscopic images."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Signal, SignalInstance, Slot
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, style_class
from app.windows.visit.dermoscopy_strip import DermoscopyStrip
from app.windows.visit.side_panel import wrapped
from app.windows.visit.site_choice import SiteChoice
from app.workflows.wording import StatusText
from core.records import Lesion, Observation

_BADGES = {
    "confirmed": "badge-green",
    "corrected": "badge-green",
    "marked": "badge",
    "proposed": "badge",
    "uncertain": "badge-amber",
    "removed": "badge-grey",
}


class LesionDetails(QFrame):
    """The form of one lesion. Text is sent when a field is left or Enter is pressed.

    Signals
    -------
    confirm(), not_in_view(), place(bool), undo(), explain(), delete()
        Buttons.
    site_changed(object), size_changed(float), note_changed(str), removed_changed(bool)
        Fields.
    """

    confirm = Signal()
    not_in_view = Signal()
    place = Signal(bool)
    undo = Signal()
    explain = Signal()
    delete = Signal()
    site_changed = Signal(object)
    size_changed = Signal(float)
    note_changed = Signal(str)
    removed_changed = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("lesion_details")
        style_class(self, "panel")
        self._note_shown = ""
        self._size_shown = 0.0
        self.name = QLabel()
        self.name.setObjectName("lesion_name")
        style_class(self.name, "strong")
        self.badge = QLabel()
        self.badge.setObjectName("lesion_status")
        self.reason = wrapped("", "caption", "lesion_reason")
        self.confirm_button = self._button("Confirm", "check", "confirm_lesion", self.confirm)
        self.unseen_button = self._button("Not in view", "eye-off", "lesion_not_in_view", self.not_in_view)
        self.place_button = self._button("Place by hand", "target", "place_lesion", None)
        self.place_button.setCheckable(True)
        self.place_button.toggled.connect(self.place)
        self.undo_button = self._button("Undo decision", "undo", "undo_lesion", self.undo)
        self.explain_button = self._button("Explain", "info", "explain_lesion", self.explain)
        self.delete_button = self._button("Delete mark", "trash", "delete_lesion", self.delete)
        style_class(self.explain_button, "quiet")
        style_class(self.delete_button, "quiet")
        self.site = SiteChoice()
        self.site.setObjectName("lesion_site")
        self.site.site_changed.connect(self.site_changed)
        self.size = QDoubleSpinBox()
        self.size.setObjectName("lesion_size")
        self.size.setRange(0.0, 300.0)
        self.size.setDecimals(1)
        self.size.setSingleStep(0.5)
        self.size.setSuffix(" mm")
        self.size.setSpecialValueText("Size")
        self.size.setKeyboardTracking(False)
        self.size.lineEdit().setTextMargins(10, 0, 0, 0)
        self.size.setToolTip("Largest diameter in this visit")
        self.size.editingFinished.connect(self._send_size)
        self.size.valueChanged.connect(lambda _: self._send_size())
        self.note = QLineEdit()
        self.note.setObjectName("lesion_note")
        self.note.setPlaceholderText("Note")
        self.note.setMaxLength(500)
        self.note.editingFinished.connect(self._send_note)
        self.removed = QCheckBox("Removed by physician")
        self.removed.setObjectName("lesion_removed")
        self.removed.clicked.connect(self.removed_changed)
        self.strip = DermoscopyStrip()
        self._build()

    def _button(self, text: str, symbol: str, name: str, signal: SignalInstance | None) -> QPushButton:
        button = QPushButton(icon(symbol, palette.SECONDARY), f" {text}")
        button.setObjectName(name)
        if signal is not None:
            button.clicked.connect(lambda _=False: signal.emit())
        return button

    def _build(self) -> None:
        head = QHBoxLayout()
        head.addWidget(self.name)
        head.addStretch(1)
        head.addWidget(self.badge)
        decide = QHBoxLayout()
        decide.setSpacing(8)
        for button in (self.confirm_button, self.unseen_button, self.place_button, self.undo_button):
            decide.addWidget(button, 1)
        decide.addWidget(self.explain_button)
        measures = QHBoxLayout()
        measures.setSpacing(8)
        self.size.setFixedWidth(120)
        measures.addWidget(self.size)
        measures.addWidget(self.note, 1)
        last = QHBoxLayout()
        last.addWidget(self.removed)
        last.addStretch(1)
        last.addWidget(self.delete_button)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 8, 16, 8)
        column.setSpacing(6)
        column.addLayout(head)
        column.addWidget(self.reason)
        column.addLayout(decide)
        column.addWidget(self.site)
        column.addLayout(measures)
        column.addWidget(self.strip)
        column.addLayout(last)
        column.addStretch(1)

    def show_lesion(
        self,
        lesion: Lesion,
        observation: Observation | None,
        status: StatusText,
        *,
        marked_now: bool,
        explainable: bool,
    ) -> None:
        """Show a lesion; ``marked_now`` means it was first marked in this visit."""
        self.name.setText(f"Lesion {lesion.number}")
        self.badge.setText(status.label)
        style_class(self.badge, _BADGES[status.tone])
        self.reason.setText(status.detail)
        decision = observation.decision if observation is not None else "proposed"
        waiting = observation is not None and decision == "proposed"
        has_place = observation is not None and observation.pixel is not None and decision != "rejected"
        self.confirm_button.setVisible(waiting)
        self.confirm_button.setText(" Confirm" if has_place else " Agree")
        self.unseen_button.setVisible(waiting and has_place)
        self.place_button.setVisible(observation is not None and not has_place)
        if not self.place_button.isVisibleTo(self):
            self.show_placing(False)
        self.undo_button.setVisible(decision in ("confirmed", "corrected", "rejected") and not marked_now)
        self.explain_button.setVisible(explainable)
        self.delete_button.setVisible(marked_now)
        self.removed.setVisible(not marked_now)
        self.site.set_site(lesion.site)
        with QSignalBlocker(self.size), QSignalBlocker(self.removed):
            self._size_shown = (observation.size_mm if observation is not None else None) or 0.0
            if not self.size.hasFocus() or self.size.value() == 0.0:
                self.size.setValue(self._size_shown)
            self.removed.setChecked(lesion.state == "removed")
        self.size.setEnabled(observation is not None)
        self._note_shown = lesion.note
        if not self.note.hasFocus():
            self.note.setText(lesion.note)

    def show_placing(self, on: bool) -> None:
        """Show whether the next click places the lesion."""
        with QSignalBlocker(self.place_button):
            self.place_button.setChecked(on)

    def send_pending(self) -> None:
        """Send what was typed and not sent yet, before another lesion is shown."""
        self._send_note()
        self._send_size()

    @Slot()
    def _send_note(self) -> None:
        text = self.note.text().strip()
        if text != self._note_shown:
            self._note_shown = text
            self.note_changed.emit(text)

    @Slot()
    def _send_size(self) -> None:
        value = self.size.value()
        if abs(value - self._size_shown) > 1e-6:
            self._size_shown = value
            self.size_changed.emit(value)
