"""Spots seen in one of two visits only: neutral to read, one click makes one a lesion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QScrollArea, QVBoxLayout, QWidget

from app.theme import icon, palette, style_class
from app.windows.visit.side_panel import wrapped

_TEXT = (
    "The camera saw these spots in one of the two visits only. Light, hair, clothing or stance can be the "
    "reason. Look at the skin yourself."
)
_MOST = 40


@dataclass(frozen=True)
class SpotLine:
    """A row: marker name, what it says, and whether it may be marked (a spot of this visit)."""

    key: str
    text: str
    markable: bool


class SpotsPanel(QFrame):
    """The list of spots.

    Signals
    -------
    shown(str)
        A spot is to be shown on its photo.
    marked(str)
        A spot is to become a new lesion.
    """

    shown = Signal(str)
    marked = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("spots_panel")
        style_class(self, "panel")
        self._rows = QWidget()
        self._column = QVBoxLayout(self._rows)
        self._column.setContentsMargins(0, 0, 8, 0)
        self._column.setSpacing(4)
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setWidget(self._rows)
        title = QLabel("Spots only in one visit")
        style_class(title, "strong")
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 8, 8, 8)
        column.setSpacing(6)
        column.addWidget(title)
        column.addWidget(wrapped(_TEXT, "caption", "spots_text"))
        column.addWidget(area, 1)
        self._lines: tuple[SpotLine, ...] = ()

    def set_spots(self, new: Sequence[SpotLine], vanished: Sequence[SpotLine]) -> None:
        """Show the spots of this visit, then those of an earlier one."""
        lines = (*new, *vanished)
        if lines == self._lines and self._column.count():
            return
        self._lines = lines
        while (item := self._column.takeAt(0)) is not None:
            row = item.widget()
            if row is not None:
                row.setParent(None)
                row.deleteLater()
        for heading, rows in (("Only in this visit", new), ("Only in an earlier visit", vanished)):
            if rows:
                self._column.addWidget(_heading(f"{heading} ({len(rows)})"))
            for line in rows[:_MOST]:
                self._column.addWidget(self._row(line))
            if len(rows) > _MOST:
                self._column.addWidget(_heading(f"and {len(rows) - _MOST} more, less sure"))
        self._column.addStretch(1)

    def _row(self, line: SpotLine) -> QWidget:
        row = QWidget()
        inside = QHBoxLayout(row)
        inside.setContentsMargins(0, 0, 0, 0)
        inside.setSpacing(8)
        show = QPushButton(icon("eye", palette.ACCENT), f" {line.text}")
        show.setObjectName(f"show_{line.key}")
        show.setToolTip("Show it on the photo")
        style_class(show, "quiet")
        show.clicked.connect(lambda _=False: self.shown.emit(line.key))
        inside.addWidget(show)
        inside.addStretch(1)
        if line.markable:
            mark = QPushButton(icon("plus", palette.SECONDARY), " New lesion")
            mark.setToolTip("Mark this spot as a new lesion")
            mark.setObjectName(f"mark_{line.key}")
            mark.clicked.connect(lambda _=False: self.marked.emit(line.key))
            inside.addWidget(mark)
        return row


def _heading(text: str) -> QLabel:
    label = QLabel(text)
    style_class(label, "field")
    return label
