"""How a lesion's marker looks on the photo and on the 3D body: a ring and a numbered badge."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QImage, QPainter, QPen

from app.theme import palette

RING_RADIUS = 11.0
BADGE_OFFSET = QPointF(17.0, -17.0)
BADGE_RADIUS = 11.0
MARKER_REACH = 42.0
"""Half the side of the square, in screen pixels, that holds a marker and its badge."""


@dataclass(frozen=True)
class Marker:
    """A lesion on a photo.

    Attributes
    ----------
    id : str
        Identity of the lesion in every view (the lesion id as text, or a temporary name of a new one).
    label : str
        What the badge says, usually the lesion's number.
    x, y : float
        Place in image pixels.
    state : str
        confirmed, corrected, marked, proposed, uncertain, removed: its colour (`palette.STATE_COLORS`).
    outline : tuple of (float, float)
        Border of the 95 % region in image pixels; drawn dashed around the proposed place.
    ghost : (float, float) or None
        The place that was proposed, if the marker was moved away from it.
    tooltip : str
    movable : bool
        Whether this marker may be dragged when the view allows dragging.
    """

    id: str
    label: str
    x: float
    y: float
    state: str = "marked"
    outline: tuple[tuple[float, float], ...] = ()
    ghost: tuple[float, float] | None = None
    tooltip: str = ""
    movable: bool = True


def marker_color(state: str) -> QColor:
    """Colour of a marker in ``state``."""
    return QColor(palette.STATE_COLORS.get(state, palette.ACCENT))


def badge_width(label: str) -> float:
    """Width of the badge in screen pixels."""
    return max(2 * BADGE_RADIUS, 12.0 + QFontMetricsF(_badge_font()).horizontalAdvance(label))


def _badge_font() -> QFont:
    font = QFont()
    font.setPixelSize(13)
    font.setWeight(QFont.Weight.DemiBold)
    return font


def draw_marker(
    painter: QPainter, label: str, color: QColor, *, selected: bool, hovered: bool = False
) -> None:
    """Draw a marker with its lesion at the origin, in screen pixels."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    radius = RING_RADIUS + (3.0 if selected else 0.0)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(QColor(255, 255, 255, 235), 5.0 if selected else 4.0))
    painter.drawEllipse(QPointF(0, 0), radius, radius)
    painter.setPen(QPen(color, 3.0 if selected or hovered else 2.2))
    painter.drawEllipse(QPointF(0, 0), radius, radius)
    width = badge_width(label)
    box = QRectF(0, 0, width, 2 * BADGE_RADIUS)
    box.moveCenter(BADGE_OFFSET + QPointF(width / 2 - BADGE_RADIUS, 0))
    painter.setPen(QPen(QColor("#FFFFFF"), 2.0))
    painter.setBrush(color)
    if selected:
        box.adjust(-1.5, -1.5, 1.5, 1.5)
    painter.drawRoundedRect(box, box.height() / 2, box.height() / 2)
    painter.setPen(QColor("#FFFFFF"))
    painter.setFont(_badge_font())
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, label)


def draw_ghost(painter: QPainter, color: QColor) -> None:
    """Draw the place a marker was moved away from, at the origin."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(QColor(255, 255, 255, 200), 3.0))
    painter.drawEllipse(QPointF(0, 0), 8.0, 8.0)
    painter.setPen(QPen(color, 1.6, Qt.PenStyle.DashLine))
    painter.drawEllipse(QPointF(0, 0), 8.0, 8.0)


def marker_image(label: str, state: str, *, selected: bool, ratio: float = 1.0) -> QImage:
    """A square transparent picture of a marker with the lesion at its centre, ``2 * MARKER_REACH`` wide."""
    size = round(2 * MARKER_REACH * ratio)
    image = QImage(size, size, QImage.Format.Format_RGBA8888)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    painter.translate(size / 2, size / 2)
    painter.scale(ratio, ratio)
    draw_marker(painter, label, marker_color(state), selected=selected)
    painter.end()
    return image
