"""The picture of a hand with its points, bones and marker: to look at, and to click points on.

Public API of `HandPicture` (a `PhotoView`: wheel zooms, drag pans, + - 0 and arrows)
-------------------------------------------------------------------------------------
``show_frame(QImage | None)``                the picture; what is drawn on it is kept until told otherwise
``show_answer(HandAnswer | None, anchors_px, kind)``   what the tracker says
``show_labels(dict name -> (u, v), proposed, current)``  what a person placed; points may be dragged
``set_layers(points=, bones=, marker=, names=)``   what is drawn
``set_labelling(bool)``                      a click emits ``placed``, a drag on a point ``point_moved``
``drawn_points() -> dict name -> QPoint``    where points are in the viewport, for tests

Signals: ``point_moved(str name, float u, float v)``, ``point_chosen(str name)`` and those of `PhotoView`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QFont, QImage, QMouseEvent, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QApplication, QWidget

from app.theme import palette
from app.widgets.hand_colors import point_color
from app.widgets.photo_view import PhotoView
from app.workflows.hand_log import short_name
from core.hand.answer import HandAnswer
from core.hand.names import BONES, POINT_NAMES

_REACH_PX = 11
SURE = 0.5
"""Confidence from which a point is drawn full; a less sure one is a ring."""


class HandPicture(PhotoView):
    """See the module's documentation."""

    point_moved = Signal(str, float, float)
    point_chosen = Signal(str)

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setAccessibleName("Picture of the hand")
        self._answer: HandAnswer | None = None
        self._anchors: NDArray[np.float64] = np.zeros((0, 2))
        self._anchor_kind, self._anchors_seen = "marker", False
        self._labels: dict[str, tuple[float, float]] = {}
        self._proposed: frozenset[str] = frozenset()
        self._current: str | None = None
        self._layers = {"points": True, "bones": True, "marker": True, "names": False}
        self._labelling = False
        self._held: str | None = None
        self._held_from = QPoint()
        self._held_moves = False
        self.frames_painted = 0
        self.setViewportUpdateMode(PhotoView.ViewportUpdateMode.FullViewportUpdate)

    # --- contents ----------------------------------------------------------------------------------------

    def show_frame(self, image: QImage | None) -> None:
        """The picture from now on."""
        self.set_image(image)

    def show_answer(
        self,
        answer: HandAnswer | None,
        anchors_px: NDArray[np.float64] | None = None,
        *,
        kind: str = "marker",
        seen: bool = False,
    ) -> None:
        """What the tracker says, and where the anchors are in the picture."""
        self._answer = answer
        self._anchors = np.zeros((0, 2)) if anchors_px is None else anchors_px
        self._anchor_kind, self._anchors_seen = kind, seen
        self.viewport().update()

    def show_labels(
        self,
        labels: Mapping[str, tuple[float, float]],
        proposed: frozenset[str] = frozenset(),
        current: str | None = None,
    ) -> None:
        """What a person placed."""
        self._labels, self._proposed, self._current = dict(labels), proposed, current
        self.viewport().update()

    def set_layers(self, **layers: bool) -> None:
        """Which of points, bones, marker, names are drawn."""
        self._layers |= layers
        self.viewport().update()

    def set_labelling(self, on: bool) -> None:
        """Whether points are placed and dragged here."""
        self._labelling, self._held = on, None
        self.set_placing(on)
        self.viewport().update()

    def drawn_points(self) -> dict[str, QPoint]:
        """Where the points are in the viewport."""
        return {name: self._at(*place).toPoint() for name, place in self._places().items()}

    # --- painting ----------------------------------------------------------------------------------------

    def _at(self, u: float, v: float) -> QPointF:
        return self.viewportTransform().map(QPointF(u + 0.5, v + 0.5))

    def _places(self) -> dict[str, tuple[float, float]]:
        if self._labelling:
            return self._labels
        if self._answer is None:
            return {}
        found = self._answer.found & np.isfinite(self._answer.pixels).all(axis=1)
        return {
            name: (float(self._answer.pixels[k, 0]), float(self._answer.pixels[k, 1]))
            for k, name in enumerate(POINT_NAMES)
            if found[k]
        }

    def _confidence(self, name: str) -> float:
        if self._labelling:
            return 0.3 if name in self._proposed else 1.0
        return float(self._answer.confidence[POINT_NAMES.index(name)]) if self._answer is not None else 0.0

    def drawForeground(self, painter: QPainter, rect: QRectF | QRectF) -> None:  # noqa: D102
        super().drawForeground(painter, rect)
        if not self.image_size[0]:
            return
        self.frames_painted += 1
        painter.save()
        painter.resetTransform()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._layers["marker"]:
            self._draw_anchors(painter)
        places = self._places()
        at = {name: self._at(*place) for name, place in places.items()}
        if self._layers["bones"]:
            self._draw_bones(painter, at)
        if self._layers["points"] or self._labelling:
            for name, place in at.items():
                self._draw_point(painter, name, place)
        if self._layers["names"]:
            self._draw_names(painter, at)
        painter.restore()

    def _draw_anchors(self, painter: QPainter) -> None:
        known = self._anchors[np.isfinite(self._anchors).all(axis=1)]
        if not len(known):
            return
        style = Qt.PenStyle.SolidLine if self._anchors_seen else Qt.PenStyle.DashLine
        corners = [self._at(float(u), float(v)) for u, v in known]
        for color, wide in ((QColor(16, 30, 36, 190), 4.0), (QColor("#7FE3EA"), 1.8)):
            painter.setPen(QPen(color, wide, style, Qt.PenCapStyle.FlatCap))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            if self._anchor_kind == "marker" and len(corners) == 4:
                painter.drawPolygon(QPolygonF(corners))
            else:
                for c in corners:
                    painter.drawLine(c + QPointF(-5, 0), c + QPointF(5, 0))
                    painter.drawLine(c + QPointF(0, -5), c + QPointF(0, 5))
        if self._anchor_kind == "marker" and len(corners) == 4:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor("#7FE3EA"))
            painter.drawEllipse(corners[0], 3.5, 3.5)

    def _draw_bones(self, painter: QPainter, at: Mapping[str, QPointF]) -> None:
        for a, b in BONES:
            one, other = POINT_NAMES[a], POINT_NAMES[b]
            if one not in at or other not in at:
                continue
            sure = min(self._confidence(one), self._confidence(other)) >= SURE
            for color, wide in ((QColor(255, 255, 255, 210), 5.0), (point_color(a), 2.8)):
                pen = QPen(color, wide, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
                if not sure and wide < 4:
                    pen.setStyle(Qt.PenStyle.DotLine)
                painter.setPen(pen)
                painter.drawLine(at[one], at[other])

    def _draw_point(self, painter: QPainter, name: str, place: QPointF) -> None:
        color, confidence = point_color(POINT_NAMES.index(name)), self._confidence(name)
        radius = 5.5 if name.endswith("_tip") else 4.5
        if confidence >= SURE:
            color.setAlphaF(0.55 + 0.45 * min(confidence, 1.0))
            painter.setPen(QPen(QColor("#FFFFFF"), 1.6))
            painter.setBrush(color)
        else:
            painter.setBrush(QColor(255, 255, 255, 120))
            painter.setPen(QPen(color, 2.2))
        painter.drawEllipse(place, radius, radius)
        if self._labelling and name in (self._current, self._held):
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(QColor(palette.TEXT), 1.4))
            painter.drawEllipse(place, radius + 4, radius + 4)

    def _draw_names(self, painter: QPainter, at: Mapping[str, QPointF]) -> None:
        font = QFont(self.font())
        font.setPixelSize(12)
        font.setWeight(QFont.Weight.DemiBold)
        painter.setFont(font)
        metrics = painter.fontMetrics()
        taken: list[QRectF] = []
        for name, place in sorted(at.items(), key=lambda item: item[1].y()):
            text = short_name(name)
            box = QRectF(place.x() + 8, place.y() - 9, metrics.horizontalAdvance(text) + 8, 17)
            while any(box.intersects(other) for other in taken):
                box.translate(0.0, 4.0)
            taken.append(box)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(255, 255, 255, 215))
            painter.drawRoundedRect(box, 4, 4)
            painter.setPen(QColor(palette.TEXT))
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    # --- mouse -------------------------------------------------------------------------------------------

    def point_at(self, position: QPoint) -> str | None:
        """The labelled point under a viewport position."""
        best: tuple[float, str] | None = None
        for name, place in self.drawn_points().items():
            distance = (QPointF(position) - QPointF(place)).manhattanLength()
            if distance <= _REACH_PX and (best is None or distance < best[0]):
                best = (distance, name)
        return None if best is None else best[1]

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        if self._labelling and event.button() == Qt.MouseButton.LeftButton:
            position = event.position().toPoint()
            self._held = self.point_at(position)
            if self._held is not None:
                self._held_from, self._held_moves = position, False
                self.viewport().update()
                return
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        if self._held is None:
            super().mouseMoveEvent(event)
            return
        position = event.position().toPoint()
        if (position - self._held_from).manhattanLength() >= QApplication.startDragDistance() // 2:
            self._held_moves = True
        if self._held_moves:
            self._labels[self._held] = self.image_position(position)
            self.viewport().update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        if self._held is None:
            super().mouseReleaseEvent(event)
            return
        name, self._held = self._held, None
        if self._held_moves:
            self.point_moved.emit(name, *self.image_position(event.position()))
        else:
            self.point_chosen.emit(name)
        self.viewport().update()
