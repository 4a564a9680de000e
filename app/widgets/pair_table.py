"""The 105 distances between points of one frame: measured, the model's, and by how much they differ.

Public API: ``PairTable(name)``; ``show_answer(HandAnswer | None)``, ``ticked() -> list[int]``,
``set_ticked(pairs)``, ``set_sorted(bool)`` (largest deviation first); signal ``ticked_changed()``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from app.theme import palette
from app.widgets.distance_chart import CURVE_COLORS, MOST_CURVES
from app.workflows.hand_log import pair_name
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS

_TITLES = ("Distance along the skin", "mm", "Model", "Differs")
_LARGE_MM = 10.0

_Index = QModelIndex


class _Model(QAbstractTableModel):
    ticked_changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.order = list(range(len(PAIRS)))
        self.names = [pair_name(pair) for pair in range(len(PAIRS))]
        self.measured = np.full(len(PAIRS), np.nan)
        self.expected = np.full(len(PAIRS), np.nan)
        self.ticked: list[int] = []
        self.by_deviation = False

    def show(self, measured: np.ndarray[Any, Any], expected: np.ndarray[Any, Any]) -> None:
        self.measured, self.expected = 1000.0 * measured, 1000.0 * expected
        if self.by_deviation:
            self.sort_rows()
        self.tell()

    def sort_rows(self) -> None:
        size = np.abs(self.measured - self.expected)
        key = np.where(np.isfinite(size), -size, np.inf)
        self.order = list(np.argsort(key, kind="stable")) if self.by_deviation else list(range(len(PAIRS)))

    def tell(self) -> None:
        self.dataChanged.emit(self.index(0, 0), self.index(len(PAIRS) - 1, len(_TITLES) - 1))

    def rowCount(self, parent: _Index = _Index()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(PAIRS)

    def columnCount(self, parent: _Index = _Index()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(_TITLES)

    def flags(self, index: _Index) -> Qt.ItemFlag:
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return flags | Qt.ItemFlag.ItemIsUserCheckable if index.column() == 0 else flags

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return _TITLES[section]
        if orientation == Qt.Orientation.Horizontal and role == Qt.ItemDataRole.TextAlignmentRole:
            side = Qt.AlignmentFlag.AlignLeft if section == 0 else Qt.AlignmentFlag.AlignRight
            return side | Qt.AlignmentFlag.AlignVCenter
        return None

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        pair, column = self.order[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            return self.names[pair] if column == 0 else self._number(pair, column)
        if role == Qt.ItemDataRole.CheckStateRole and column == 0:
            return Qt.CheckState.Checked if pair in self.ticked else Qt.CheckState.Unchecked
        if role == Qt.ItemDataRole.TextAlignmentRole:
            side = Qt.AlignmentFlag.AlignLeft if column == 0 else Qt.AlignmentFlag.AlignRight
            return side | Qt.AlignmentFlag.AlignVCenter
        if role == Qt.ItemDataRole.ForegroundRole:
            if column == 0 and pair in self.ticked:
                return QColor(CURVE_COLORS[self.ticked.index(pair)])
            if column == 3 and abs(self.measured[pair] - self.expected[pair]) > _LARGE_MM:
                return QColor(palette.AMBER)
        if role == Qt.ItemDataRole.ToolTipRole and column == 0:
            return self.names[pair]
        return None

    def _number(self, pair: int, column: int) -> str:
        values = (self.measured[pair], self.expected[pair], self.measured[pair] - self.expected[pair])
        value = values[column - 1]
        if not np.isfinite(value):
            return "–"
        return f"{value:+.1f}" if column == 3 else f"{value:.1f}"

    def setData(self, index: _Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        if role != Qt.ItemDataRole.CheckStateRole or index.column() != 0:
            return False
        pair = self.order[index.row()]
        if pair in self.ticked:
            self.ticked.remove(pair)
        else:
            self.ticked = [*self.ticked, pair][-MOST_CURVES:]
        self.tell()
        self.ticked_changed.emit()
        return True


class PairTable(QTableView):
    """See the module's documentation."""

    ticked_changed = Signal()

    def __init__(self, object_name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(object_name)
        self.setAccessibleName("Distances between points, measured and of the model, in millimetres")
        self._model = _Model(self)
        self._model.ticked_changed.connect(self.ticked_changed)
        self.setModel(self._model)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTabKeyNavigation(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(30)
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setSectionsClickable(False)
        header.setMinimumSectionSize(40)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.setStyleSheet(
            "QTableView { font-size: 14px; } QTableView::item { padding: 0 4px; }"
            "QHeaderView::section { padding: 0 6px; }"
        )
        for column, wide in ((1, 58), (2, 64), (3, 68)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, wide)

    def show_answer(self, answer: HandAnswer | None) -> None:
        """The distances of a frame; dashes without one."""
        nothing = np.full(len(PAIRS), np.nan)
        if answer is None:
            self._model.show(nothing, nothing)
        else:
            self._model.show(answer.pair_m, answer.expected_pair_m)

    def ticked(self) -> list[int]:
        """Pairs chosen for the chart, in the order of their colours."""
        return list(self._model.ticked)

    def set_ticked(self, pairs: list[int]) -> None:
        """Choose pairs for the chart."""
        self._model.ticked = list(pairs[:MOST_CURVES])
        self._model.tell()
        self.ticked_changed.emit()

    def set_sorted(self, on: bool) -> None:
        """Largest deviation first, or in the order of the fingers."""
        self._model.by_deviation = on
        self._model.sort_rows()
        self._model.tell()

    def row_of(self, pair: int) -> int:
        """Row in which a pair is shown."""
        return self._model.order.index(pair)

    def cells(self, row: int) -> tuple[str, ...]:
        """Texts of a row."""
        return tuple(str(self._model.data(self._model.index(row, c))) for c in range(len(_TITLES)))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        index = self.currentIndex()
        if event.key() in (Qt.Key.Key_Space, Qt.Key.Key_Return) and index.isValid():
            first = self._model.index(index.row(), 0)
            self._model.setData(first, None, Qt.ItemDataRole.CheckStateRole)
        else:
            super().keyPressEvent(event)
