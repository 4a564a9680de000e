"""Small pieces that the pages of the wizard share."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.theme import style_class


def label(text: str = "", kind: str = "", name: str = "", *, wrap: bool = False) -> QLabel:
    """A label with a style class and an object name."""
    made = QLabel(text)
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setWordWrap(wrap)
    if kind:
        style_class(made, kind)
    if name:
        made.setObjectName(name)
    return made


def button(text: str, kind: str, name: str, slot: Callable[[], object]) -> QPushButton:
    """A button with a style class and an object name."""
    made = QPushButton(text)
    made.setObjectName(name)
    style_class(made, kind)
    made.clicked.connect(lambda _=False: slot())
    return made


def card(*, margin: int = 16) -> tuple[QFrame, QVBoxLayout]:
    """A white card and its column."""
    frame = QFrame()
    style_class(frame, "card")
    column = QVBoxLayout(frame)
    column.setContentsMargins(margin, margin, margin, margin)
    column.setSpacing(8)
    return frame, column


class Page(QWidget):
    """A page of the wizard: content above, a row of buttons below. `primary` answers Enter."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setObjectName(name)
        self.primary: QPushButton | None = None
        self.body = QVBoxLayout()
        self.body.setSpacing(16)
        self._row = QHBoxLayout()
        self._row.setSpacing(8)
        self._spread = False
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(16)
        column.addLayout(self.body, 1)
        column.addLayout(self._row)

    def add_left(self, made: QPushButton) -> QPushButton:
        """Add a button at the lower left."""
        self._row.addWidget(made)
        return made

    def add_right(self, made: QPushButton) -> QPushButton:
        """Add a button at the lower right; the last one that is primary answers Enter."""
        if not self._spread:
            self._row.addStretch(1)
            self._spread = True
        self._row.addWidget(made)
        if made.property("class") == "primary":
            self.primary = made
        return made
