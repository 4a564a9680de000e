"""The things drawn on a `PhotoView`: markers with their ghost and region, and the scale bar."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QGraphicsItem, QStyleOptionGraphicsItem, QWidget

from app.theme import palette
from app.widgets.markers import (
    BADGE_OFFSET,
    BADGE_RADIUS,
    MARKER_REACH,
    RING_RADIUS,
    Marker,
    badge_width,
    draw_ghost,
    draw_marker,
    marker_color,
)


class _Pin(QGraphicsItem):
    """The ring and badge: always the same size on the screen."""

    def __init__(self, owner: MarkerItem) -> None:
        super().__init__(owner)
        self._owner = owner
        self.setFlag(QGraphicsItem.GraphicsItemFlag.ItemIgnoresTransformations)
        self.setZValue(2)

    def boundingRect(self) -> QRectF:
        return QRectF(-MARKER_REACH, -MARKER_REACH, 2.5 * MARKER_REACH, 2 * MARKER_REACH)

    def paint(
        self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None = None
    ) -> None:
        o = self._owner
        draw_marker(
            painter,
            o.marker.label,
            marker_color(o.marker.state),
            selected=o.is_selected,
            hovered=o.is_hovered,
        )


class _Ghost(QGraphicsItem):
    """The place the marker was proposed at."""

    def __init__(self, owner: MarkerItem) -> None:
        super().__init__(owner)
        self._owner = owner
        self.setFlag(QGraphicsItem.GraphicsItemFlag.ItemIgnoresTransformations)

    def boundingRect(self) -> QRectF:
        return QRectF(-12, -12, 24, 24)

    def paint(
        self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None = None
    ) -> None:
        draw_ghost(painter, QColor(palette.AMBER))


class MarkerItem(QGraphicsItem):
    """A marker in image coordinates; the pixel centre (x, y) lies at scene (x + 0.5, y + 0.5)."""

    def __init__(self, marker: Marker) -> None:
        super().__init__()
        self.marker = marker
        self.is_selected = False
        self.is_hovered = False
        self._at: tuple[float, float] | None = None
        self._pin = _Pin(self)
        self._ghost = _Ghost(self)
        self._place()

    def set_marker(self, marker: Marker) -> None:
        """Show another state of the same lesion."""
        self.marker = marker
        self._place()

    def set_selected(self, on: bool) -> None:
        """Highlight it and lift it above its neighbours."""
        self.is_selected = on
        self.setZValue(20 if on else 10)
        self._pin.update()

    def set_hovered(self, on: bool) -> None:
        """Show that a click would select it."""
        self.is_hovered = on
        self._pin.update()

    def drag_to(self, x: float, y: float) -> None:
        """Follow the mouse, leaving a ghost behind."""
        self._at = (x, y)
        self._place()

    def end_drag(self) -> None:
        """Go back to the marker's own place."""
        self._at = None
        self._place()

    def distance(self, offset: QPointF) -> float | None:
        """How far a screen offset from the lesion is from its ring or badge; None if it does not hit."""
        ring = math.hypot(offset.x(), offset.y())
        width = badge_width(self.marker.label)
        badge = QRectF(0, 0, width, 2 * BADGE_RADIUS)
        badge.moveCenter(BADGE_OFFSET + QPointF(width / 2 - BADGE_RADIUS, 0))
        if ring <= RING_RADIUS + 5:
            return ring
        return RING_RADIUS if badge.adjusted(-3, -3, 3, 3).contains(offset) else None

    @property
    def _origin(self) -> tuple[float, float]:
        """The proposed place: the ghost, or where a drag began."""
        return self.marker.ghost or (self.marker.x, self.marker.y)

    def _place(self) -> None:
        self.prepareGeometryChange()
        self._region = QPolygonF([QPointF(u + 0.5, v + 0.5) for u, v in self.marker.outline])
        x, y = self._at or (self.marker.x, self.marker.y)
        self._pin.setPos(x + 0.5, y + 0.5)
        gx, gy = self._origin
        self._ghost.setPos(gx + 0.5, gy + 0.5)
        self._ghost.setVisible(self.marker.ghost is not None or self._at is not None)
        self.update()
        self._pin.update()

    def boundingRect(self) -> QRectF:  # noqa: D102
        gx, gy = self._origin
        x, y = self._pin.pos().x(), self._pin.pos().y()
        region = self._region.boundingRect() if self.marker.outline else QRectF(gx + 0.5, gy + 0.5, 0, 0)
        return region.united(QRectF(QPointF(gx + 0.5, gy + 0.5), QPointF(x, y)).normalized()).adjusted(
            -4, -4, 4, 4
        )

    def paint(  # noqa: D102
        self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None = None
    ) -> None:
        gx, gy = self._origin
        center = QPointF(gx + 0.5, gy + 0.5)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        if self.marker.outline:
            color = QColor(palette.AMBER)
            fill = QColor(color)
            fill.setAlpha(28)
            painter.setBrush(fill)
            pen = QPen(color, 1.8, Qt.PenStyle.DashLine)
            pen.setCosmetic(True)
            painter.setPen(pen)
            painter.drawPolygon(self._region)
        if self._ghost.isVisible():
            pen = QPen(QColor(palette.AMBER), 1.8, Qt.PenStyle.DotLine)
            pen.setCosmetic(True)
            painter.setPen(pen)
            painter.drawLine(center, self._pin.pos())


def draw_scale_bar(painter: QPainter, view: QRect, pixels_per_mm: float) -> None:
    """A bar of a round number of millimetres at the bottom left of a view."""
    target_mm = 0.18 * view.width() / pixels_per_mm
    if target_mm <= 0:
        return
    base = 10 ** math.floor(math.log10(target_mm))
    length_mm = max(k * base for k in (1, 2, 5) if k * base <= target_mm)
    length = length_mm * pixels_per_mm
    text = f"{length_mm:g} mm" if length_mm < 100 else f"{length_mm / 10:g} cm"
    font = QFont()
    font.setPixelSize(13)
    font.setWeight(QFont.Weight.DemiBold)
    painter.setFont(font)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    box = QRectF(16, view.height() - 54, length + 24, 40)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(23, 36, 43, 190))
    painter.drawRoundedRect(box, 6, 6)
    painter.setPen(QPen(QColor("#FFFFFF"), 2))
    y = box.bottom() - 10
    painter.drawLine(QPointF(box.left() + 12, y), QPointF(box.right() - 12, y))
    for x in (box.left() + 12, box.right() - 12):
        painter.drawLine(QPointF(x, y - 4), QPointF(x, y + 4))
    painter.drawText(box.adjusted(0, 2, 0, -12), Qt.AlignmentFlag.AlignCenter, text)
