"""Joints and bones drawn over a photo so that they can be taken by the mouse."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen
from PySide6.QtWidgets import QGraphicsItem, QGraphicsLineItem, QStyleOptionGraphicsItem, QWidget

from app.theme import palette
from app.widgets.photo_view import PhotoView

if TYPE_CHECKING:
    from core.anchors import Joint, Skeleton

LEFT_COLOR = palette.ACCENT
RIGHT_COLOR = "#6B4A9E"
MIDDLE_COLOR = palette.TEXT
"""Left and right must never be mistaken for each other: teal and violet differ for every kind of sight."""

_RADIUS = 7.0
_REACH = 13.0
_LABEL_GAP = 12.0


def joint_color(name: str) -> QColor:
    """Colour of a joint by the side of the body it is on."""
    side = name.partition("_")[0]
    return QColor({"left": LEFT_COLOR, "right": RIGHT_COLOR}.get(side, MIDDLE_COLOR))


class JointMark(QGraphicsItem):
    """One joint: a disc of the same size at every zoom; hollow if only guessed, dotted if set by hand."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.hovered = False
        self._seen, self._by_hand = True, False
        self.setFlag(QGraphicsItem.GraphicsItemFlag.ItemIgnoresTransformations)
        self.setZValue(31)

    def show_joint(self, joint: Joint, visible: float) -> None:
        """Show a joint where it is."""
        self._seen, self._by_hand = joint.visibility >= visible, joint.source == "hand"
        self.move_to(float(joint.pixel[0]), float(joint.pixel[1]))
        self.update()

    def move_to(self, x: float, y: float) -> None:
        """Put the mark at an image pixel."""
        self.setPos(x + 0.5, y + 0.5)

    def set_hovered(self, on: bool) -> None:
        """Show the name."""
        self.hovered = on
        self.setZValue(33 if on else 31)
        self.prepareGeometryChange()
        self.update()

    def boundingRect(self) -> QRectF:  # noqa: D102
        width = _LABEL_GAP + QFontMetricsF(_font()).horizontalAdvance(self.name) + 24.0
        return QRectF(-_REACH, -_REACH - 4, _REACH + width, 2 * _REACH + 8)

    def paint(  # noqa: D102
        self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None = None
    ) -> None:
        color = joint_color(self.name)
        radius = _RADIUS + (2.0 if self.hovered else 0.0)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor("#FFFFFF"), 2.0))
        if self._seen:
            painter.setBrush(color)
            painter.drawEllipse(QPointF(0, 0), radius, radius)
        else:
            painter.setBrush(QColor(255, 255, 255, 150))
            painter.drawEllipse(QPointF(0, 0), radius, radius)
            painter.setPen(QPen(color, 2.0, Qt.PenStyle.DotLine))
            painter.drawEllipse(QPointF(0, 0), radius - 1, radius - 1)
        if self._by_hand:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor("#FFFFFF"))
            painter.drawEllipse(QPointF(0, 0), 2.6, 2.6)
        if self.hovered:
            self._draw_name(painter, color)

    def _draw_name(self, painter: QPainter, color: QColor) -> None:
        text = self.name.replace("_", " ")
        metrics = QFontMetricsF(_font())
        box = QRectF(_LABEL_GAP, -11.0, metrics.horizontalAdvance(text) + 16.0, 22.0)
        painter.setPen(QPen(QColor("#FFFFFF"), 1.5))
        painter.setBrush(color)
        painter.drawRoundedRect(box, 11.0, 11.0)
        painter.setFont(_font())
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)


class JointMarks:
    """All joints of a skeleton with their bones, on a `PhotoView`."""

    def __init__(self, photo: PhotoView) -> None:
        self._photo = photo
        self._marks: dict[str, JointMark] = {}
        self._bones: dict[tuple[str, str], tuple[QGraphicsLineItem, QGraphicsLineItem]] = {}

    def show(self, skeleton: Skeleton) -> None:
        """Show exactly the joints of this skeleton."""
        from core.anchors import BONES, VISIBLE

        scene = self._photo.scene()
        for name in set(self._marks) - set(skeleton.joints):
            scene.removeItem(self._marks.pop(name))
        for name, joint in skeleton.joints.items():
            if name not in self._marks:
                self._marks[name] = JointMark(name)
                scene.addItem(self._marks[name])
            self._marks[name].show_joint(joint, VISIBLE)
        for bone in BONES:
            if bone not in self._bones and all(end in self._marks for end in bone):
                self._bones[bone] = (_bone("#FFFFFF", 4.0, 160, 29), _bone(palette.SECONDARY, 2.0, 255, 30))
                for line in self._bones[bone]:
                    scene.addItem(line)
        self._place_bones(self._bones)

    def clear(self) -> None:
        """Take everything off the photo."""
        scene = self._photo.scene()
        for mark in self._marks.values():
            scene.removeItem(mark)
        for lines in self._bones.values():
            for line in lines:
                scene.removeItem(line)
        self._marks.clear()
        self._bones.clear()

    def at(self, position: QPoint) -> str | None:
        """The joint under a viewport position, the nearest if several are."""
        best: tuple[float, str] | None = None
        for name, mark in self._marks.items():
            offset = self._photo.viewportTransform().map(mark.pos()) - QPointF(position)
            distance = math.hypot(offset.x(), offset.y())
            if distance <= _REACH and (best is None or distance < best[0]):
                best = (distance, name)
        return None if best is None else best[1]

    def drag(self, name: str, x: float, y: float) -> None:
        """Let a joint follow the mouse, its bones with it."""
        self._marks[name].move_to(x, y)
        self._place_bones(bone for bone in self._bones if name in bone)

    def hover(self, name: str | None) -> None:
        """Show the name of one joint."""
        for other, mark in self._marks.items():
            if mark.hovered != (other == name):
                mark.set_hovered(other == name)

    @property
    def hovered(self) -> str | None:
        """The joint whose name is shown."""
        return next((name for name, mark in self._marks.items() if mark.hovered), None)

    def position(self, name: str) -> QPoint:
        """Where a joint is in the viewport."""
        return self._photo.viewportTransform().map(self._marks[name].pos()).toPoint()

    def _place_bones(self, bones: Iterable[tuple[str, str]]) -> None:
        for a, b in bones:
            for line in self._bones[a, b]:
                ends = self._marks.get(a), self._marks.get(b)
                line.setVisible(None not in ends)
                if ends[0] is not None and ends[1] is not None:
                    p, q = ends[0].pos(), ends[1].pos()
                    line.setLine(p.x(), p.y(), q.x(), q.y())


def _bone(color: str, width: float, alpha: int, level: int) -> QGraphicsLineItem:
    line = QGraphicsLineItem()
    value = QColor(color)
    value.setAlpha(alpha)
    pen = QPen(value, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
    pen.setCosmetic(True)
    line.setPen(pen)
    line.setZValue(level)
    return line


def _font() -> QFont:
    font = QFont()
    font.setPixelSize(13)
    font.setWeight(QFont.Weight.DemiBold)
    return font
