"""Right side while watching: the hand in 3D, distances over time, distances and points of the frame."""

from __future__ import annotations

import time
from typing import Final

import numpy as np
from PySide6.QtCore import QTimer, Slot
from PySide6.QtWidgets import QCheckBox, QFrame, QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.theme import palette, style_class
from app.widgets.distance_chart import Curve, DistanceChart
from app.widgets.hand_view import HandView
from app.widgets.pair_table import PairTable
from app.widgets.tables import Column, Row, RowTable
from app.windows.hand.parts import Segments, tool
from app.windows.hand.ticks import Tick
from app.workflows.hand_log import TrackLog, pair_name, short_name
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS, POINT_INDEX, POINT_NAMES, spoken

_EVERY_S: Final = 0.2
_FIRST_PAIRS: Final = (("index_tip", "index_mcp"), ("thumb_tip", "index_tip"))


class WatchPanel(QWidget):
    """See the module's documentation."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._log = TrackLog()
        self._tick: Tick | None = None
        self._shown_s = 0.0
        self._later = QTimer(self, singleShot=True)
        self._later.timeout.connect(self._refresh)
        self.view = HandView("hand_3d")
        self.skin = self._check("hand_3d_skin", "Skin")
        self.points3d = self._check("hand_3d_points", "Points and bones")
        self.chart = DistanceChart("hand_chart")
        self.chart.setFixedHeight(158)
        self.pairs = PairTable("hand_pairs")
        self.pairs.ticked_changed.connect(self._show_chart)
        self.sorted = QCheckBox("Largest deviation first")
        self.sorted.setObjectName("hand_pairs_sorted")
        self.sorted.toggled.connect(self.pairs.set_sorted)
        self.points = RowTable(
            [
                Column("Point"),
                Column("Sure", 62, number=True),
                Column("Error mm", 80, number=True),
                Column("x, y, z mm", 116, number=True),
            ]
        )
        self.points.setObjectName("hand_points")
        self.points.setAccessibleName("Points of the frame")
        self.points.verticalHeader().setDefaultSectionSize(26)
        self.points.horizontalHeader().setMinimumSectionSize(40)
        self.points.setStyleSheet(
            "QTableView { font-size: 14px; } QTableView::item { padding: 0 4px; }"
            "QHeaderView::section { padding: 0 6px; }"
        )
        self.pages = QStackedWidget()
        distances = QWidget()
        column = QVBoxLayout(distances)
        column.setContentsMargins(12, 4, 4, 4)
        column.setSpacing(2)
        column.addWidget(self.chart)
        column.addWidget(self.pairs, 1)
        self.pages.addWidget(distances)
        listed = QWidget()
        inner = QVBoxLayout(listed)
        inner.setContentsMargins(12, 4, 4, 4)
        inner.addWidget(self.points)
        self.pages.addWidget(listed)
        self.segments = Segments(
            "hand_show", (("distances", "Distances"), ("points", "Points")), self.show_page
        )
        self._lay_out()
        self.pairs.set_ticked(
            [PAIRS.index(tuple(sorted((POINT_INDEX[a], POINT_INDEX[b])))) for a, b in _FIRST_PAIRS]  # type: ignore[arg-type]
        )

    def _check(self, name: str, text: str) -> QCheckBox:
        box = QCheckBox(text)
        box.setObjectName(name)
        box.setChecked(True)
        box.toggled.connect(self._layers_changed)
        return box

    def _lay_out(self) -> None:
        above = QFrame()
        style_class(above, "card")
        tools = QHBoxLayout()
        tools.setContentsMargins(12, 0, 6, 2)
        tools.setSpacing(12)
        tools.addWidget(self.skin)
        tools.addWidget(self.points3d)
        tools.addStretch(1)
        tools.addWidget(tool("hand_3d_out", "zoom-out", "Farther (-)", lambda: self.view.zoom(0.8)))
        tools.addWidget(tool("hand_3d_in", "zoom-in", "Nearer (+)", lambda: self.view.zoom(1.25)))
        tools.addWidget(tool("hand_3d_reset", "refresh", "First view again", self.view.look_again))
        column = QVBoxLayout(above)
        column.setContentsMargins(1, 1, 1, 1)
        column.setSpacing(2)
        column.addWidget(self.view, 1)
        column.addLayout(tools)
        below = QFrame()
        style_class(below, "card")
        lower = QVBoxLayout(below)
        lower.setContentsMargins(1, 1, 1, 6)
        lower.addWidget(self.pages)
        choice = QHBoxLayout()
        choice.setContentsMargins(0, 0, 0, 0)
        choice.addWidget(self.segments)
        choice.addStretch(1)
        choice.addWidget(self.sorted)
        all_of_it = QVBoxLayout(self)
        all_of_it.setContentsMargins(0, 0, 0, 0)
        all_of_it.setSpacing(8)
        all_of_it.addWidget(above, 5)
        all_of_it.addLayout(choice)
        all_of_it.addWidget(below, 6)

    # --- contents ----------------------------------------------------------------------------------------

    def show_page(self, key: str) -> None:
        """Distances or points."""
        self.pages.setCurrentIndex(0 if key == "distances" else 1)
        self.sorted.setVisible(key == "distances")
        self._refresh()

    def set_log(self, log: TrackLog) -> None:
        """Where the chart finds what was tracked."""
        self._log, self._tick = log, None
        self.view.show_hand(None)
        self._refresh()

    def show_tick(self, tick: Tick) -> None:
        """Another frame; tables and chart follow a few times a second."""
        self._tick = tick
        if tick.mesh is not None:
            self.view.show_hand(tick.mesh)
        if not self._later.isActive():
            spare_s = self._shown_s + _EVERY_S - time.monotonic()
            self._later.start(max(0, round(1000 * spare_s)))

    @Slot()
    def _layers_changed(self) -> None:
        self.view.set_layers(skin=self.skin.isChecked(), points=self.points3d.isChecked())

    @Slot()
    def _refresh(self) -> None:
        self._shown_s = time.monotonic()
        if not self.isVisible():
            return
        answer = None if self._tick is None else self._tick.answer
        if self.pages.currentIndex() == 0:
            self.pairs.show_answer(answer)
            self._show_chart()
        else:
            self.points.set_rows(point_rows(answer))

    @Slot()
    def _show_chart(self) -> None:
        curves = []
        for pair in self.pairs.ticked():
            series = self._log.series(pair)
            first = series.time_s[0] if len(series.time_s) and self._live else 0.0
            curves.append(
                Curve(
                    pair_name(pair),
                    series.time_s - first,
                    1000.0 * series.measured_m,
                    1000.0 * series.expected_m,
                )
            )
        now = None if self._tick is None or self._live else self._tick.shot.time_s
        self.chart.show_series(curves, now)

    @property
    def _live(self) -> bool:
        return self._tick is not None and self._tick.live


def point_rows(answer: HandAnswer | None) -> list[Row]:
    """Rows of the table of points."""
    rows = []
    for k, name in enumerate(POINT_NAMES):
        cells = (short_name(name).capitalize(), "–", "–", "–")
        state = "hidden"
        if answer is not None:
            error = "–" if not np.isfinite(answer.error_m[k]) else f"{1000 * answer.error_m[k]:.1f}"
            if answer.found[k]:
                state = "placed" if answer.confidence[k] >= 0.5 else "open"
                x, y, z = 1000 * answer.points_m[k]
                place = f"{x:.0f}, {y:.0f}, {z:.0f}"
                cells = (cells[0], f"{answer.confidence[k]:.0%}", error, place)
            else:
                cells = (cells[0], "–", error, "–")
        colors = {} if state != "hidden" else dict.fromkeys(range(4), palette.FAINT)
        rows.append(Row(name, cells, colors, tooltip=spoken(name).capitalize()))
    return rows
