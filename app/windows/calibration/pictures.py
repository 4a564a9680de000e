"""What is painted while views are collected: pictures with the board, and what is covered so far."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import palette

if TYPE_CHECKING:
    from app.live.status import Shown
    from core.calibration.coverage import CameraCoverage

_FLASH_STEPS, _FLASH_MS = 8, 40
_FULL_CELL = 12


class BoardPicture(QWidget):
    """The picture of one camera, the corners found in it, and the coverage of its regions.

    Regions that are covered get a green tint; the others stay as they are. A soft flash tells that a view
    was taken.
    """

    def __init__(self, object_name: str, waiting: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(280, 210)
        self._waiting = waiting
        self._shown: Shown | None = None
        self._corners: NDArray[np.float64] = np.zeros((0, 2))
        self._regions: NDArray[np.int64] | None = None
        self._paused = False
        self._note = ""
        self._flash = 0
        self._timer = QTimer(self, interval=_FLASH_MS)
        self._timer.timeout.connect(self._fade)

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(480, 360)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102
        super().resizeEvent(event)
        width, height = (4, 3) if self._shown is None else self._shown.source_size
        self.setMaximumHeight(max(self.minimumHeight(), round(self.width() * height / width)))

    @property
    def corner_count(self) -> int:
        """Corners drawn now."""
        return len(self._corners)

    @property
    def showing(self) -> bool:
        """Whether there is a picture that is not paused."""
        return self._shown is not None and not self._paused

    def show_gone(self) -> None:
        """The camera is not there: the last picture stays, dimmed."""
        self._corners, self._paused = np.zeros((0, 2)), self._shown is not None
        self._note = "No picture"
        self.update()

    def show_frame(self, shown: Shown | None, corners: NDArray[np.float64]) -> None:
        """Paint another picture; without one the last stays, dimmed: the camera shows something else now."""
        self._paused = shown is None and self._shown is not None
        self._note = "Waiting: the other camera is looking"
        if shown is not None:
            self._shown, self._corners = shown, corners
        else:
            self._corners = np.zeros((0, 2))
        self.update()

    def show_coverage(self, coverage: CameraCoverage | None) -> None:
        """Tint the regions that the views cover."""
        self._regions = None if coverage is None else coverage.regions
        self.update()

    def flash(self) -> None:
        """Tell that a view was taken."""
        self._flash = _FLASH_STEPS
        self._timer.start()
        self.update()

    def clear(self) -> None:
        """Show nothing."""
        self._shown, self._regions, self._paused = None, None, False
        self._corners = np.zeros((0, 2))
        self.update()

    def _fade(self) -> None:
        self._flash -= 1
        if self._flash <= 0:
            self._timer.stop()
        self.update()

    def _place(self) -> QRectF:
        """Where the picture is painted."""
        if self._shown is None:
            return QRectF(self.rect())
        width, height = self._shown.source_size
        scale = min(self.width() / width, self.height() / height)
        w, h = width * scale, height * scale
        return QRectF((self.width() - w) / 2, 0.0, w, h)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        if self._shown is None:
            height = min(self.height(), round(0.75 * self.width()))
            room = QRectF(0, 0, self.width(), height)
            painter.fillRect(room, QColor(palette.PHOTO_BACKGROUND))
            painter.setPen(QColor(palette.FAINT))
            painter.drawText(room, Qt.AlignmentFlag.AlignCenter, self._waiting)
            return
        place = self._place()
        painter.drawImage(place, self._shown.image)
        if self._regions is not None:
            self._paint_regions(painter, place)
        if self._paused:
            painter.fillRect(place, QColor(29, 39, 44, 170))
            painter.setPen(QColor("#FFFFFF"))
            painter.drawText(place, Qt.AlignmentFlag.AlignCenter, self._note)
        self._paint_corners(painter, place)
        if self._flash:
            painter.fillRect(place, QColor(255, 255, 255, 18 * self._flash))

    def _paint_regions(self, painter: QPainter, place: QRectF) -> None:
        regions = self._regions
        if regions is None:
            return
        rows, columns = regions.shape
        w, h = place.width() / columns, place.height() / rows
        for row in range(rows):
            for column in range(columns):
                share = min(int(regions[row, column]), _FULL_CELL) / _FULL_CELL
                cell = QRectF(place.x() + column * w, place.y() + row * h, w, h)
                if share > 0:
                    green = QColor(palette.GREEN)
                    green.setAlpha(round(50 * share))
                    painter.fillRect(cell, green)
        painter.setPen(QPen(QColor(255, 255, 255, 70), 1))
        for column in range(1, columns):
            x = place.x() + column * w
            painter.drawLine(QPointF(x, place.top()), QPointF(x, place.bottom()))
        for row in range(1, rows):
            y = place.y() + row * h
            painter.drawLine(QPointF(place.left(), y), QPointF(place.right(), y))

    def _paint_corners(self, painter: QPainter, place: QRectF) -> None:
        if self._shown is None or len(self._corners) == 0:
            return
        scale = place.width() / self._shown.source_size[0]
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(palette.PHOTO_BACKGROUND), 1))
        painter.setBrush(QColor("#4FD1B5"))
        for u, v in self._corners:
            painter.drawEllipse(
                QPointF(place.x() + (u + 0.5) * scale, place.y() + (v + 0.5) * scale), 3.2, 3.2
            )


class CoverageGauge(QWidget):
    """Which distances and tilts the views of a camera have, as dots to be filled."""

    ROW_H, DOT, GAP = 22, 9, 5
    COLUMNS = ((0, 3, 0, 62), (3, 8, 138, 116))  # rows from, to; left edge, width of the names

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self._rows: list[tuple[str, int, int]] = [(name, 0, wanted) for name, wanted in _WANTED]
        self.setFixedHeight(5 * self.ROW_H)
        self.setMinimumWidth(280)

    def show_coverage(self, coverage: CameraCoverage) -> None:
        """Fill the dots."""
        counts = (coverage.near, coverage.middle, coverage.far, *(coverage.tilts[t] for t in _TILTS))
        self._rows = [(name, n, wanted) for (name, wanted), n in zip(_WANTED, counts, strict=True)]
        self.setAccessibleDescription("; ".join(f"{name} {n} of {wanted}" for name, n, wanted in self._rows))
        self.update()

    def filled(self) -> int:
        """Dots that are filled."""
        return sum(min(n, wanted) for _, n, wanted in self._rows)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        font = painter.font()
        font.setPixelSize(13)
        painter.setFont(font)
        for start, end, left, name_w in self.COLUMNS:
            for k, row in enumerate(self._rows[start:end]):
                self._paint_row(painter, row, left, name_w, k * self.ROW_H)

    def _paint_row(
        self, painter: QPainter, row: tuple[str, int, int], left: int, name_w: int, y: int
    ) -> None:
        name, n, wanted = row
        painter.setPen(QColor(palette.SECONDARY if n >= wanted else palette.TEXT))
        painter.drawText(QRectF(left, y, name_w, self.ROW_H), Qt.AlignmentFlag.AlignVCenter, name)
        for dot in range(wanted):
            x = left + name_w + dot * (self.DOT + self.GAP)
            painter.setPen(QPen(QColor(palette.GREEN if dot < n else palette.BORDER_STRONG), 1.5))
            painter.setBrush(QColor(palette.GREEN) if dot < n else Qt.BrushStyle.NoBrush)
            painter.drawEllipse(QRectF(x, y + (self.ROW_H - self.DOT) / 2, self.DOT, self.DOT))


_WANTED = (
    ("Near", 3),
    ("Middle", 3),
    ("Far", 3),
    ("Square", 2),
    ("Left nearer", 3),
    ("Right nearer", 3),
    ("Top nearer", 3),
    ("Bottom nearer", 3),
)
_TILTS = ("square", "left", "right", "up", "down")


class ResidualPicture(QWidget):
    """How far the corners are from where the calibration puts them, as arrows over the camera's picture."""

    def __init__(self, object_name: str, title: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(240, 200)
        self._title = title
        self._size = (640, 480)
        self._places: NDArray[np.float64] = np.zeros((0, 2))
        self._off: NDArray[np.float64] = np.zeros((0, 2))

    def show_residuals(
        self, size: tuple[int, int], places: NDArray[np.float64], off: NDArray[np.float64]
    ) -> None:
        """Paint residuals ``off`` (n, 2) in pixels at ``places`` (n, 2) of a picture of that size."""
        self._size, self._places, self._off = size, places, off
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        head, foot = 24, 24
        room = QRectF(0, head, self.width(), self.height() - head - foot)
        scale = min(room.width() / self._size[0], room.height() / self._size[1])
        w, h = self._size[0] * scale, self._size[1] * scale
        box = QRectF((self.width() - w) / 2, head, w, h)
        font = painter.font()
        font.setPixelSize(13)
        painter.setFont(font)
        painter.setPen(QColor(palette.TEXT))
        left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(QRectF(box.x(), 0, box.width(), head), left, self._title)
        painter.setPen(QPen(QColor(palette.BORDER_STRONG), 1))
        painter.setBrush(QColor(palette.CARD))
        painter.drawRect(box)
        painter.setPen(QColor(palette.SECONDARY))
        below = QRectF(box.x(), box.bottom() + 2, box.width(), foot - 2)
        if len(self._places) == 0:
            painter.drawText(below, left, "No corners")
            return
        length = np.hypot(self._off[:, 0], self._off[:, 1])
        typical = max(float(np.percentile(length, 90)), 1e-4)
        grow = 0.035 * self._size[0] / typical
        painter.setPen(QPen(QColor(palette.ACCENT), 1))
        for (u, v), (du, dv) in zip(self._places, self._off * grow, strict=True):
            a = QPointF(box.x() + u * scale, box.y() + v * scale)
            painter.drawLine(a, QPointF(a.x() + du * scale, a.y() + dv * scale))
        arrow = 0.035 * w
        y = below.center().y()
        painter.setPen(QPen(QColor(palette.ACCENT), 2))
        painter.drawPolyline(QPolygonF([QPointF(below.x(), y), QPointF(below.x() + arrow, y)]))
        painter.setPen(QColor(palette.SECONDARY))
        text = QRectF(below.x() + arrow + 8, below.y(), below.width() - arrow - 8, below.height())
        painter.drawText(text, left, f"{typical:.2f} px; {len(self._places)} corners")
