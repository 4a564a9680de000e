"""Small pieces that the panels of the hand window share."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QPushButton, QToolButton, QWidget

from app.theme import icon, palette, set_state, style_class


def tool(name: str, symbol: str, tip: str, slot: Callable[[], object]) -> QToolButton:
    """A button that is an icon."""
    button = QToolButton()
    button.setObjectName(name)
    button.setIcon(icon(symbol, palette.SECONDARY))
    button.setIconSize(QSize(20, 20))
    button.setToolTip(tip)
    button.setAccessibleName(tip)
    style_class(button, "icon")
    button.clicked.connect(lambda _=False: slot())
    return button


def push(name: str, text: str, kind: str, slot: Callable[[], object], tip: str = "") -> QPushButton:
    """A button with words."""
    button = QPushButton(text)
    button.setObjectName(name)
    button.setToolTip(tip)
    style_class(button, kind)
    button.clicked.connect(lambda _=False: slot())
    return button


class Segments(QWidget):
    """A row of buttons of which one is down: ``<name>_<key>``."""

    def __init__(
        self, name: str, choices: Sequence[tuple[str, str]], chosen: Callable[[str], object]
    ) -> None:
        super().__init__()
        self.buttons: dict[str, QPushButton] = {}
        group = QButtonGroup(self)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        for number, (key, text) in enumerate(choices):
            button = QPushButton(text)
            button.setObjectName(f"{name}_{key}")
            button.setCheckable(True)
            button.setChecked(number == 0)
            style_class(button, "segment")
            set_state(button, "first", "true" if number == 0 else "false")
            set_state(button, "last", "true" if number == len(choices) - 1 else "false")
            button.clicked.connect(lambda _=False, k=key: chosen(k))
            group.addButton(button)
            row.addWidget(button)
            self.buttons[key] = button

    def set_chosen(self, key: str) -> None:
        """Press one without telling."""
        self.buttons[key].setChecked(True)
