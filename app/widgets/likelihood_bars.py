"""How likely each configuration is, as short bars in a row.

Public API: ``LikelihoodBars(name)``; ``show_likelihood(dict, chosen)``, ``shown() -> dict``.
"""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import palette

_MOST = 6
_GAP = 12


class LikelihoodBars(QWidget):
    """See the module's documentation."""

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setAccessibleName("Likelihood of each configuration")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._values: dict[str, float] = {}
        self._chosen: str | None = None

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(280, 40)

    def minimumSizeHint(self) -> QSize:  # noqa: D102
        return QSize(120, 40)

    def show_likelihood(self, values: Mapping[str, float], chosen: str | None) -> None:
        """Show other values; the most likely first if there are too many."""
        shown = dict(sorted(values.items()))
        if (shown, chosen) == (self._values, self._chosen):
            return
        self._values, self._chosen = shown, chosen
        told = ", ".join(f"{name} {value:.0%}" for name, value in shown.items())
        self.setToolTip(f"Likelihood: {told}" if told else "")
        self.setAccessibleDescription(told)
        self.update()

    def shown(self) -> dict[str, float]:
        """The values shown."""
        return dict(self._values)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        names = list(self._values)
        if not names:
            return
        if len(names) > _MOST:
            names = sorted(names, key=lambda n: -self._values[n])[:_MOST]
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        font = QFont(self.font())
        font.setPixelSize(13)
        painter.setFont(font)
        wide = min(120.0, (self.width() - _GAP * (len(names) - 1)) / len(names))
        for k, name in enumerate(names):
            x, value = k * (wide + _GAP), min(max(self._values[name], 0.0), 1.0)
            chosen = name == self._chosen
            painter.setPen(QColor(palette.TEXT if chosen else palette.SECONDARY))
            share = f"{value:.0%}"
            room = wide - painter.fontMetrics().horizontalAdvance(share) - 6
            title = painter.fontMetrics().elidedText(name, Qt.TextElideMode.ElideRight, round(room))
            row = QRectF(x, 2, wide, 20)
            painter.drawText(row, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, title)
            painter.drawText(row, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, share)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor("#E6EBED"))
            painter.drawRoundedRect(QRectF(x, 26, wide, 6), 3, 3)
            painter.setBrush(QColor(palette.ACCENT if chosen else palette.BORDER_STRONG))
            if value > 0:
                painter.drawRoundedRect(QRectF(x, 26, max(wide * value, 6.0), 6), 3, 3)
        painter.end()
