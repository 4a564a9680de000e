"""The readings of the moment in one row: a name, a value, and a colour.

Public API: ``ReadingStrip(name)``; ``show_guidance(Guidance | None)``; ``text(reading) -> str``,
``state(reading) -> str`` of "distance", "frame", "light", "blur", "coverage", "stillness" as shown.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.theme import palette, set_state, style_class

if TYPE_CHECKING:
    from core.guidance import Guidance, Reading

SHOWN: Final = (
    ("distance", "Distance"),
    ("frame", "In the picture"),
    ("light", "Light"),
    ("blur", "Sharpness"),
    ("coverage", "Depth"),
    ("stillness", "Moved in 1 s"),
)
_COLORS: Final = {
    "good": palette.GREEN,
    "fair": palette.AMBER,
    "bad": palette.RED,
    "unknown": palette.BORDER_STRONG,
}
_NOTHING: Final = "–"


def value_text(reading: Reading) -> str:
    """The value in words and figures, as short as it can be read."""
    value, state = reading.value, reading.state
    if state == "unknown" or value is None:
        return _NOTHING
    if reading.name == "distance":
        return f"{value:.1f} m"
    if reading.name == "stillness":
        return f"{value:.0f} mm"
    if reading.name == "coverage":
        return f"{value:.0%}"
    words = {
        "frame": {"good": "Whole body", "fair": "Nearly", "bad": "Cut off"},
        "light": {"good": "Good", "fair": "Fair", "bad": "Poor"},
        "blur": {"good": "Sharp", "fair": "Soft", "bad": "Blurred"},
    }
    return words[reading.name][state]


class _Dot(QWidget):
    """A coloured dot."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedSize(12, 12)
        self._color = _COLORS["unknown"]

    def set_color(self, color: str) -> None:
        if color != self._color:
            self._color = color
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self._color))
        painter.drawEllipse(1, 1, 10, 10)
        painter.end()


class ReadingStrip(QFrame):
    """See the module's documentation.

    Parameters
    ----------
    name : str
        Prefix of the object names: ``<name>_reading_distance`` is the label of a value.
    """

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}_readings")
        style_class(self, "card")
        self._values: dict[str, QLabel] = {}
        self._dots: dict[str, _Dot] = {}
        self._states: dict[str, str] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 8, 8, 8)
        row.setSpacing(0)
        for key, title in SHOWN:
            caption = QLabel(title)
            style_class(caption, "caption")
            value = QLabel(_NOTHING)
            value.setObjectName(f"{name}_reading_{key}")
            style_class(value, "strong")
            # a changing figure must not make the window lay itself out again
            value.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            value.setFixedHeight(value.fontMetrics().height() + 2)
            dot = _Dot()
            top = QHBoxLayout()
            top.setSpacing(6)
            top.addWidget(dot)
            top.addWidget(value, 1)
            cell = QVBoxLayout()
            cell.setContentsMargins(8, 0, 8, 0)
            cell.setSpacing(2)
            cell.addWidget(caption)
            cell.addLayout(top)
            row.addLayout(cell, 1)
            self._values[key], self._dots[key], self._states[key] = value, dot, "unknown"

    def show_guidance(self, guidance: Guidance | None) -> None:
        """Show the readings; dashes without any."""
        for key, _ in SHOWN:
            reading = None if guidance is None else guidance.readings.get(key)
            text = _NOTHING if reading is None else value_text(reading)
            state = "unknown" if reading is None else reading.state
            if key == "light" and guidance is not None:
                behind = guidance.readings.get("backlight")
                if reading is not None and behind is not None and behind.badness > reading.badness:
                    state, text = behind.state, "From behind"
            label = self._values[key]
            if label.text() != text:
                label.setText(text)
            if state != self._states[key]:
                self._states[key] = state
                self._dots[key].set_color(_COLORS[state])
                set_state(label, "reading", state)
            tip = "" if reading is None else reading.sentence
            if label.toolTip() != tip:
                label.setToolTip(tip)

    def text(self, key: str) -> str:
        """The value shown."""
        return self._values[key].text()

    def state(self, key: str) -> str:
        """How it is marked."""
        return self._states[key]
