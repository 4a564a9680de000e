"""The live picture: painted as it comes, with skeleton, ghost, countdown and the sentence of the moment.

Public API of `LiveView`
------------------------
``show_picture(Shown | None)``      a picture in the size of `room`, painted one to one
``room() -> (width, height)``       device pixels that a picture may take; signal ``room_changed(int, int)``
``visible_changed(bool)``            signal: nobody needs pictures while it is hidden
``set_pose(LivePose | None)``, ``set_ghost(outlines | None, opacity)``, ``set_ghost_opacity(0..1)``
``set_count(int)``                  3, 2, 1 in figures that are read from 2 m; 0 for none
``set_sentence(str, state)``        what to say now, large, along the bottom
``set_notice(str)``                 instead of a picture
``frames_painted``                  how many pictures were painted, for measurements
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFont,
    QHideEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QPolygonF,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import QWidget

from app.theme import palette

if TYPE_CHECKING:
    from app.live.status import Shown
    from core.anchors import LivePose

COUNT_SHARE: Final = 0.5
"""Height of the countdown's figures as a share of the view's."""

_SENTENCE_PX: Final = (26, 22, 18)
_BAND_PX: Final = 60
_STATE_COLORS: Final = {
    "good": palette.GREEN,
    "fair": palette.AMBER,
    "bad": palette.RED,
    "unknown": palette.SECONDARY,
}


class LiveView(QWidget):
    """See the module's documentation."""

    room_changed = Signal(int, int)
    visible_changed = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setMinimumSize(320, 240)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self._shown: Shown | None = None
        self._pose: LivePose | None = None
        self._ghost: list[QPolygonF] = []
        self._ghost_opacity = 0.7
        self._count = 0
        self._sentence = ""
        self._state = "unknown"
        self._notice = ""
        self.frames_painted = 0

    # --- contents ----------------------------------------------------------------------------------------

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(640, 480)

    def room(self) -> tuple[int, int]:
        """Width and height in device pixels that a picture may take: all but the band of the sentence."""
        ratio = self.devicePixelRatioF()
        return round(self.width() * ratio), round((self.height() - _BAND_PX) * ratio)

    def show_picture(self, shown: Shown | None) -> None:
        """Show a picture from now on; None for none."""
        self._shown = shown
        if shown is None:
            self._pose = None
        self.update()

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the camera's picture; zeros without one."""
        return (0, 0) if self._shown is None else self._shown.source_size

    @property
    def shown(self) -> Shown | None:
        """The picture shown."""
        return self._shown

    def set_pose(self, pose: LivePose | None) -> None:
        """The joints to draw; they are painted with the next picture."""
        self._pose = pose

    @property
    def pose(self) -> LivePose | None:
        """The joints drawn."""
        return self._pose

    def set_ghost(self, outlines: list[NDArray[np.float64]] | None) -> None:
        """Outlines in pixels of the camera's picture; None for none."""
        self._ghost = [QPolygonF([QPointF(*p) for p in outline]) for outline in outlines or ()]
        self.update()

    @property
    def has_ghost(self) -> bool:
        """Whether outlines are drawn."""
        return bool(self._ghost) and self._ghost_opacity > 0

    def set_ghost_opacity(self, opacity: float) -> None:
        """How strongly they are drawn, 0..1."""
        self._ghost_opacity = opacity
        self.update()

    def set_count(self, count: int) -> None:
        """The figure of the countdown; 0 for none."""
        if count != self._count:
            self._count = count
            self.update()

    @property
    def count(self) -> int:
        """The figure shown."""
        return self._count

    def set_sentence(self, sentence: str, state: str = "unknown") -> None:
        """What to say now."""
        if (sentence, state) != (self._sentence, self._state):
            self._sentence, self._state = sentence, state
            self.update()

    @property
    def sentence(self) -> str:
        """What is said now."""
        return self._sentence

    def set_notice(self, text: str) -> None:
        """What is read where there is no picture."""
        if text != self._notice:
            self._notice = text
            self.update()

    # --- painting ----------------------------------------------------------------------------------------

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        self.room_changed.emit(*self.room())

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102
        super().showEvent(event)
        self.visible_changed.emit(True)

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: D102
        super().hideEvent(event)
        self.visible_changed.emit(False)

    def _picture_rect(self) -> QRectF:
        """Where the picture is painted, in the widget's pixels."""
        shown = self._shown
        if shown is None:
            return QRectF()
        ratio = self.devicePixelRatioF()
        w, h = shown.image.width() / ratio, shown.image.height() / ratio
        free = self.height() - _BAND_PX
        scale = min(1.0, self.width() / w, free / h)
        w, h = w * scale, h * scale
        return QRectF(round((self.width() - w) / 2), round((free - h) / 2), w, h)

    def view_position(self, u: float, v: float) -> QPointF:
        """Where a pixel of the camera's picture is in the widget."""
        rect, (width, height) = self._picture_rect(), self.image_size
        return QPointF(
            rect.x() + (u + 0.5) * rect.width() / max(width, 1),
            rect.y() + (v + 0.5) * rect.height() / max(height, 1),
        )

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        shown = self._shown
        if shown is None:
            painter.fillRect(self.rect(), QColor(palette.PHOTO_BACKGROUND))
            self._paint_notice(painter)
        else:
            rect = self._picture_rect()
            self._paint_margins(painter, rect)
            if rect.width() * self.devicePixelRatioF() == shown.image.width():
                shown.image.setDevicePixelRatio(self.devicePixelRatioF())
                painter.drawImage(rect.topLeft(), shown.image)
            else:
                painter.drawImage(rect, shown.image)
            self.frames_painted += 1
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            self._paint_ghost(painter)
            self._paint_pose(painter)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self._paint_sentence(painter)
        self._paint_count(painter)
        painter.end()

    def _paint_margins(self, painter: QPainter, rect: QRectF) -> None:
        """Only what the picture leaves free: filling everything first would paint each pixel twice."""
        background = QColor(palette.PHOTO_BACKGROUND)
        width, height = float(self.width()), float(self.height())
        for part in (
            QRectF(0, 0, width, rect.top()),
            QRectF(0, rect.bottom(), width, height - rect.bottom()),
            QRectF(0, 0, rect.left(), height),
            QRectF(rect.right(), 0, width - rect.right(), height),
        ):
            if part.width() > 0 and part.height() > 0:
                painter.fillRect(part, background)

    def _paint_notice(self, painter: QPainter) -> None:
        font = QFont(self.font())
        font.setPixelSize(18)
        painter.setFont(font)
        painter.setPen(QColor(palette.BORDER_STRONG))
        painter.drawText(
            self.rect().adjusted(32, 0, -32, 0),
            Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap,
            self._notice,
        )

    def _paint_ghost(self, painter: QPainter) -> None:
        if not self.has_ghost:
            return
        painter.save()
        painter.setOpacity(self._ghost_opacity)
        corner = self.view_position(-0.5, -0.5)
        rect, (width, height) = self._picture_rect(), self.image_size
        painter.translate(corner)
        painter.scale(rect.width() / width, rect.height() / height)
        painter.translate(0.5, 0.5)
        for color, wide in (("#10343A", 4.5), ("#7FE3EA", 2.2)):
            pen = QPen(QColor(color), wide, Qt.PenStyle.DashLine, Qt.PenCapStyle.RoundCap)
            pen.setCosmetic(True)
            pen.setDashPattern([4.0 * 2.2 / wide, 3.0 * 2.2 / wide])
            painter.setPen(pen)
            for outline in self._ghost:
                painter.drawPolygon(outline)
        painter.restore()

    def _paint_pose(self, painter: QPainter) -> None:
        pose = self._pose
        if pose is None:
            return
        scale = np.array(self.image_size) / np.array(pose.size)
        at = {
            name: self.view_position(*(joint.pixel + 0.5) * scale - 0.5)
            for name, joint in pose.joints.items()
            if np.isfinite(joint.pixel).all()
        }
        for color, wide in (("#FFFFFF", 5.0), (palette.ACCENT, 2.8)):
            pen = QPen(QColor(color), wide, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap)
            painter.setPen(pen)
            for a, b in pose.bones():
                painter.drawLine(at[a], at[b])
        painter.setPen(QPen(QColor("#FFFFFF"), 1.5))
        painter.setBrush(QColor(palette.ACCENT))
        ends = {name for bone in pose.bones() for name in bone}
        for name in ends:
            painter.drawEllipse(at[name], 4.5, 4.5)
        painter.setBrush(Qt.BrushStyle.NoBrush)

    def _paint_sentence(self, painter: QPainter) -> None:
        band = QRectF(0, self.height() - _BAND_PX, self.width(), _BAND_PX)
        if not self._sentence or self._count:
            return
        painter.fillRect(band, QColor(_STATE_COLORS.get(self._state, palette.SECONDARY)))
        room = band.adjusted(24, 0, -24, 0)
        flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
        font = QFont(self.font())
        font.setWeight(QFont.Weight.DemiBold)
        for size in _SENTENCE_PX:
            font.setPixelSize(size)
            painter.setFont(font)
            if painter.boundingRect(room, flags, self._sentence).height() <= _BAND_PX:
                break
        painter.setPen(QColor("#FFFFFF"))
        painter.drawText(room, flags, self._sentence)

    def _paint_count(self, painter: QPainter) -> None:
        if not self._count:
            return
        side = COUNT_SHARE * min(self.width(), self.height() - _BAND_PX)
        font = QFont(self.font())
        font.setPixelSize(max(48, round(0.8 * side)))
        font.setWeight(QFont.Weight.Bold)
        disc = QRectF(0, 0, side, side)
        disc.moveCenter(QRectF(0, 0, self.width(), self.height() - _BAND_PX).center())
        painter.setPen(QPen(QColor("#FFFFFF"), 6))
        dark = QColor(palette.TEXT)
        dark.setAlpha(190)
        painter.setBrush(dark)
        painter.drawEllipse(disc)
        path = QPainterPath()
        path.addText(0, 0, font, str(self._count))
        bounds = path.boundingRect()
        path.translate(disc.center() - bounds.center())
        painter.fillPath(path, QColor("#FFFFFF"))
        painter.setBrush(Qt.BrushStyle.NoBrush)
