"""The panel at the right of every visit screen: what to do, the controls, and the one filled button below."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.theme import style_class
from app.workflows.table import StateInfo

PANEL_WIDTH = 488


class SidePanel(QFrame):
    """Title and instruction on top, contents in the middle, buttons at the bottom.

    Parameters
    ----------
    name : str
        Prefix of the object names: ``<name>_title``, ``<name>_instruction``, ``<name>_primary``.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "card")
        self.setObjectName(f"{name}_panel")
        self.setFixedWidth(PANEL_WIDTH)
        self.title = wrapped("", "heading", f"{name}_title")
        self.instruction = wrapped("", "secondary", f"{name}_instruction")
        self.body = QVBoxLayout()
        self.body.setSpacing(12)
        self.buttons = QHBoxLayout()
        self.buttons.setSpacing(8)
        self.primary = QPushButton()
        self.primary.setObjectName(f"{name}_primary")
        style_class(self.primary, "primary")
        column = QVBoxLayout(self)
        column.setContentsMargins(24, 16, 24, 16)
        column.setSpacing(6)
        column.addWidget(self.title)
        column.addWidget(self.instruction)
        column.addSpacing(6)
        column.addLayout(self.body, 1)
        column.addSpacing(6)
        column.addLayout(self.buttons)
        self.buttons.addStretch(1)
        self.buttons.addWidget(self.primary)

    def add_secondary(self, text: str, name: str) -> QPushButton:
        """A plain button to the left of the filled one."""
        button = QPushButton(text)
        button.setObjectName(name)
        self.buttons.insertWidget(self.buttons.count() - 2, button)
        return button

    def show_state(self, info: StateInfo, primary: str | None = None) -> None:
        """Say what to do in a state."""
        self.title.setText(info.title)
        self.instruction.setText(info.instruction)
        self.primary.setText(info.primary if primary is None else primary)
        self.primary.setVisible(bool(self.primary.text()))


class BulletList(QFrame):
    """A short list of sentences in a soft box, for example corrections; hidden while empty."""

    def __init__(self, name: str, kind: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        style_class(self, f"banner-{kind}")
        self._title = wrapped("", "strong", f"{name}_title")
        self._text = wrapped("", "", f"{name}_text")
        column = QVBoxLayout(self)
        column.setContentsMargins(16, 12, 16, 12)
        column.setSpacing(4)
        column.addWidget(self._title)
        column.addWidget(self._text)
        self.hide()

    def show_list(self, title: str, sentences: Sequence[str]) -> None:
        """Show the sentences, or nothing if there are none."""
        self._title.setText(title)
        self._text.setText("\n".join(f"•  {sentence}" for sentence in sentences))
        self.setVisible(bool(sentences))

    def text(self) -> str:
        """The sentences as shown."""
        return self._text.text() if self.isVisibleTo(self.parentWidget()) else ""


def wrapped(text: str, style: str, name: str) -> QLabel:
    """A label that breaks its lines and can be selected by a test."""
    label = QLabel(text)
    label.setObjectName(name)
    label.setWordWrap(True)
    label.setTextFormat(Qt.TextFormat.PlainText)
    if style:
        style_class(label, style)
    return label


def field_label(text: str) -> QLabel:
    """The small label above a field."""
    label = QLabel(text)
    style_class(label, "field")
    return label
