"""Step 4: everything of the visit on one page, the note, closing, and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numpy.typing import NDArray
from PySide6.QtCore import QSignalBlocker, QTimer, Signal, Slot
from PySide6.QtGui import QImage
from PySide6.QtWidgets import (
    QButtonGroup,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, style_class
from app.widgets.markers import Marker
from app.widgets.photo_view import PhotoView
from app.windows.visit.lesion_list import LesionLine, LesionList
from app.windows.visit.pieces import offer_captures
from app.windows.visit.side_panel import SidePanel, field_label
from app.windows.visit.site_panel import SitePanel
from app.workflows.table import StateInfo

_SAVE_DELAY_MS = 800


class ReviewScreen(QWidget):
    """Shows what it is told.

    Signals
    -------
    primary_clicked(), secondary_clicked()
        Close visit or export the report; go back.
    note_changed(str)
        A moment after typing.
    selected(str), capture_chosen(int)
    check_site(bool)
        The next click on the photo is a site to be checked.
    site_clicked(float, float)
    """

    primary_clicked = Signal()
    secondary_clicked = Signal()
    note_changed = Signal(str)
    selected = Signal(str)
    capture_chosen = Signal(int)
    check_site = Signal(bool)
    site_clicked = Signal(float, float)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("review_screen")
        self._saved = ""
        self.photo = PhotoView()
        self.photo.setObjectName("review_photo")
        self.photo.marker_clicked.connect(lambda name: name.isdigit() and self.selected.emit(name))
        self.photo.placed.connect(self.site_clicked)
        self.caption = QLabel()
        self.caption.setObjectName("review_photo_caption")
        style_class(self.caption, "caption")
        self.list = LesionList("review_list")
        self.list.lesion_clicked.connect(self.selected)
        self.note = QPlainTextEdit()
        self.note.setObjectName("visit_note")
        self.note.setPlaceholderText("For example: what was examined, what to look at next time")
        self.note.setTabChangesFocus(True)
        self.note.setFixedHeight(112)
        self._timer = QTimer(self, singleShot=True, interval=_SAVE_DELAY_MS)
        self._timer.timeout.connect(self.send_note)
        self.note.textChanged.connect(self._timer.start)
        self.site_button = QPushButton(icon("target", palette.SECONDARY), " Check a site")
        self.site_button.setObjectName("check_site")
        self.site_button.setCheckable(True)
        self.site_button.toggled.connect(self.check_site)
        self.site = SitePanel()
        self.summary = QLabel()
        self.summary.setObjectName("review_summary")
        self.summary.setWordWrap(True)
        self.panel = SidePanel("review")
        self.secondary = self.panel.add_secondary("Back to lesions", "review_secondary")
        self.secondary.clicked.connect(self.secondary_clicked)
        self.panel.primary.clicked.connect(self.primary_clicked)
        self._captures = QButtonGroup(self)
        self._captures.idClicked.connect(self.capture_chosen)
        self._capture_row = QHBoxLayout()
        self._capture_row.setSpacing(0)
        self._build()

    def _build(self) -> None:
        frame = QFrame()
        style_class(frame, "photo")
        inside = QVBoxLayout(frame)
        inside.setContentsMargins(1, 1, 1, 1)
        inside.addWidget(self.photo)
        below = QHBoxLayout()
        below.addWidget(self.caption, 1)
        below.addLayout(self._capture_row)
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addWidget(frame, 1)
        left.addLayout(below)
        body = self.panel.body
        body.addWidget(self.summary)
        body.addWidget(self.list, 1)
        body.addWidget(self.site_button)
        body.addWidget(self.site)
        body.addWidget(field_label("Note of this visit"))
        body.addWidget(self.note)
        row = QHBoxLayout(self)
        row.setContentsMargins(24, 16, 24, 24)
        row.setSpacing(16)
        row.addLayout(left, 1)
        row.addWidget(self.panel)

    def show_state(self, info: StateInfo, summary: str, *, closed: bool) -> None:
        """Say what to do; a closed visit can only be read."""
        self.panel.show_state(info)
        self.summary.setText(summary)
        self.note.setReadOnly(closed)
        self.secondary.setText("Done" if closed else "Back to lesions")

    def show_note(self, text: str) -> None:
        """Show the stored note, unless the user is typing."""
        self._saved = text
        if not self._timer.isActive() and self.note.toPlainText() != text:
            self.note.blockSignals(True)
            self.note.setPlainText(text)
            self.note.blockSignals(False)

    def show_lesions(
        self, lines: Sequence[LesionLine], markers: Sequence[Marker], selected: str | None
    ) -> None:
        """Show the lesions in the table and on the photo."""
        self.list.set_lines(lines)
        self.photo.set_markers(markers)
        self.list.set_selected(selected)
        self.photo.set_selected(selected)

    def show_capture(self, picture: NDArray | QImage | None, caption: str) -> None:
        """Show a capture of this visit."""
        self.photo.set_image(picture)
        self.caption.setText(caption)

    def set_captures(self, views: Mapping[str, int], shown: int | None) -> None:
        """Offer the captures of this visit."""
        offer_captures(self._captures, self._capture_row, "review", views, shown)

    def show_checking(self, on: bool) -> None:
        """Whether the next click on the photo is a site; markers do not catch it then."""
        self.photo.set_placing(on, over_markers=True)
        with QSignalBlocker(self.site_button):
            self.site_button.setChecked(on)

    @Slot()
    def send_note(self) -> None:
        """Send what was typed and not sent yet."""
        self._timer.stop()
        text = self.note.toPlainText().strip()
        if text != self._saved:
            self._saved = text
            self.note_changed.emit(text)
