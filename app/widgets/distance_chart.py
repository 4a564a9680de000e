"""Distances along the skin over time: measured as lines, the model's as dashes, one colour per pair.

Public API: ``DistanceChart(name)``; ``show_series(list[Curve], now_s)``, ``curves() -> list[Curve]``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import palette

CURVE_COLORS = ("#0F6E77", "#B7791F", "#7B4FA3", "#B3382C")
MOST_CURVES = len(CURVE_COLORS)

_LEFT, _RIGHT, _BOTTOM, _LEGEND_ROW = 44, 10, 24, 18


@dataclass(frozen=True, eq=False)
class Curve:
    """One distance over time: seconds, and millimetres measured and expected (NaN where unknown)."""

    name: str
    time_s: NDArray[np.float64]
    measured_mm: NDArray[np.float64]
    expected_mm: NDArray[np.float64]


class DistanceChart(QWidget):
    """See the module's documentation."""

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setAccessibleName("Distances along the skin over time")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(240, 130)
        self._curves: list[Curve] = []
        self._now_s: float | None = None

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(400, 190)

    def show_series(self, curves: Sequence[Curve], now_s: float | None) -> None:
        """Show these curves, and a line at the frame that is shown."""
        self._curves, self._now_s = list(curves[:MOST_CURVES]), now_s
        self.setAccessibleDescription(", ".join(curve.name for curve in self._curves))
        self.update()

    def curves(self) -> list[Curve]:
        """The curves shown."""
        return list(self._curves)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        font = QFont(self.font())
        font.setPixelSize(12)
        painter.setFont(font)
        values = [v[np.isfinite(v)] for c in self._curves for v in (c.measured_mm, c.expected_mm)]
        values = [v for v in values if len(v)]
        if not values:
            painter.setPen(QColor(palette.FAINT))
            said = "Tick distances in the table below." if not self._curves else "Nothing was measured yet."
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, said)
            return
        legend = _LEGEND_ROW * ((len(self._curves) + 1) // 2)
        area = QRectF(_LEFT, legend + 8, self.width() - _LEFT - _RIGHT, self.height() - legend - 8 - _BOTTOM)
        low, high, step = _range(float(min(v.min() for v in values)), float(max(v.max() for v in values)))
        times = np.concatenate([c.time_s for c in self._curves])
        first, last = float(times.min()), max(float(times.max()), float(times.min()) + 0.5)
        self._draw_axes(painter, area, (low, high, step), (first, last))

        def at(time_s: float, mm: float) -> QPointF:
            x = area.left() + (time_s - first) / (last - first) * area.width()
            return QPointF(x, area.bottom() - (mm - low) / (high - low) * area.height())

        if self._now_s is not None and first <= self._now_s <= last:
            x = at(self._now_s, low).x()
            painter.setPen(QPen(QColor(palette.BORDER_STRONG), 1.5))
            painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
        for color, curve in zip(CURVE_COLORS, self._curves, strict=False):
            for mm, style, wide in (
                (curve.expected_mm, Qt.PenStyle.DashLine, 1.2),
                (curve.measured_mm, Qt.PenStyle.SolidLine, 2.0),
            ):
                painter.setPen(QPen(QColor(color), wide, style))
                for run in _runs(mm):
                    places = [at(float(curve.time_s[k]), float(mm[k])) for k in run]
                    if len(places) == 1:
                        painter.drawEllipse(places[0], 1.5, 1.5)
                    else:
                        painter.drawPolyline(QPolygonF(places))
        self._draw_legend(painter)
        painter.end()

    def _draw_axes(
        self,
        painter: QPainter,
        area: QRectF,
        vertical: tuple[float, float, float],
        horizontal: tuple[float, float],
    ) -> None:
        low, high, step = vertical
        value = low
        while value <= high + 1e-9:
            y = area.bottom() - (value - low) / (high - low) * area.height()
            painter.setPen(QPen(QColor("#EDF0F2"), 1))
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
            painter.setPen(QColor(palette.SECONDARY))
            box = QRectF(0, y - 9, _LEFT - 6, 18)
            painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, f"{value:.0f}")
            value += step
        first, last = horizontal
        painter.setPen(QColor(palette.SECONDARY))
        below = QRectF(area.left(), area.bottom() + 4, area.width(), 18)
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft, f"{first:.1f} s")
        painter.drawText(below, Qt.AlignmentFlag.AlignRight, f"{last:.1f} s")
        painter.drawText(
            below, Qt.AlignmentFlag.AlignHCenter, "mm, measured (line) and of the model (dashes)"
        )

    def _draw_legend(self, painter: QPainter) -> None:
        wide = (self.width() - _LEFT - _RIGHT) / 2
        for k, (color, curve) in enumerate(zip(CURVE_COLORS, self._curves, strict=False)):
            x, y = _LEFT + (k % 2) * wide, (k // 2) * _LEGEND_ROW
            painter.setPen(QPen(QColor(color), 2.4))
            painter.drawLine(QPointF(x, y + 9), QPointF(x + 16, y + 9))
            painter.setPen(QColor(palette.TEXT))
            text = painter.fontMetrics().elidedText(curve.name, Qt.TextElideMode.ElideRight, round(wide - 26))
            painter.drawText(
                QRectF(x + 22, y, wide - 24, 18),
                Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter,
                text,
            )


def _range(low: float, high: float) -> tuple[float, float, float]:
    """Ends and step of an axis that holds both values, with three to six round steps."""
    spread = max(high - low, 4.0)
    raw = spread / 4.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw)
    return math.floor(low / step) * step, math.ceil(max(high, low + 1e-6) / step + 1e-9) * step, step


def _runs(values: NDArray[np.float64]) -> list[list[int]]:
    """Indices of the stretches without a gap."""
    runs: list[list[int]] = []
    for k in np.flatnonzero(np.isfinite(values)):
        if runs and runs[-1][-1] == k - 1:
            runs[-1].append(int(k))
        else:
            runs.append([int(k)])
    return runs
