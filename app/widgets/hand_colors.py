"""Colours of the five fingers, everywhere the same: picture, 3D view, chart, list."""

from __future__ import annotations

from typing import Final

from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap

from core.hand.names import FINGER_OF

FINGER_COLORS: Final = ("#E8743B", "#E5B80B", "#3FA34D", "#2B83C6", "#9B5DB8")
"""Thumb, index, middle, ring, little; told apart also by the common colour blindnesses, by brightness."""


def point_color(point: int) -> QColor:
    """Colour of a point."""
    return QColor(FINGER_COLORS[FINGER_OF[point]])


def dot_icon(point: int, state: str) -> QIcon:
    """A dot of the point's colour: "placed" full, "proposed" and "open" rings, "hidden" a crossed ring."""
    pixmap = QPixmap(32, 32)
    pixmap.fill(QColor(0, 0, 0, 0))
    pixmap.setDevicePixelRatio(2.0)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    color = point_color(point)
    painter.setPen(QPen(color, 2.2))
    if state == "placed":
        painter.setBrush(color)
    elif state == "proposed":
        soft = QColor(color)
        soft.setAlpha(90)
        painter.setBrush(soft)
    painter.drawEllipse(3, 3, 10, 10)
    if state == "hidden":
        painter.drawLine(4, 12, 12, 4)
    painter.end()
    return QIcon(pixmap)
