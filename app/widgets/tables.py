"""Tables: rows of immutable values, one selection, no cell editing.

Public API
----------
``RowTable(columns)``: ``set_rows(list[Row])``, ``rows()``, ``set_selected(key | None)``, ``selected()``;
    signals ``selected_changed(str key)`` (by the user), ``activated_key(str key)`` (double click or Enter).
``LesionTable()``: a `RowTable`; ``set_lesions(list[LesionRow])``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QItemSelection, QModelIndex, QObject, Qt, Signal, Slot
from PySide6.QtGui import QColor, QFont, QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from app.theme import icon_pixmap, palette

ROW_HEIGHT = 48

_Index = QModelIndex


@dataclass(frozen=True)
class Column:
    """A column: its title, its width in pixels (0: takes the rest), right-aligned numbers or not."""

    title: str
    width: int = 0
    number: bool = False


@dataclass(frozen=True)
class Row:
    """A row: its identity, its texts, and how some cells look."""

    key: str
    cells: tuple[str, ...]
    colors: dict[int, str] = field(default_factory=dict)
    icons: dict[int, tuple[str, str]] = field(default_factory=dict)
    strong: frozenset[int] = frozenset()
    tooltip: str = ""


class _Model(QAbstractTableModel):
    def __init__(self, columns: Sequence[Column], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.columns = list(columns)
        self.rows: list[Row] = []

    def set_rows(self, rows: Sequence[Row]) -> None:
        self.beginResetModel()
        self.rows = list(rows)
        self.endResetModel()

    def rowCount(self, parent: _Index = _Index()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: _Index = _Index()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(self.columns)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if orientation == Qt.Orientation.Horizontal:
            if role == Qt.ItemDataRole.DisplayRole:
                return self.columns[section].title
            if role == Qt.ItemDataRole.TextAlignmentRole:
                return self._alignment(section)
        return None

    def _alignment(self, column: int) -> Qt.AlignmentFlag:
        side = Qt.AlignmentFlag.AlignRight if self.columns[column].number else Qt.AlignmentFlag.AlignLeft
        return side | Qt.AlignmentFlag.AlignVCenter

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        row, column = self.rows[index.row()], index.column()
        if role == Qt.ItemDataRole.DisplayRole:
            return row.cells[column]
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return self._alignment(column)
        if role == Qt.ItemDataRole.ForegroundRole and column in row.colors:
            return QColor(row.colors[column])
        if role == Qt.ItemDataRole.DecorationRole and column in row.icons:
            name, color = row.icons[column]
            return icon_pixmap(name, 18, color)
        if role == Qt.ItemDataRole.FontRole and column in row.strong:
            font = QFont()
            font.setWeight(QFont.Weight.DemiBold)
            return font
        if role == Qt.ItemDataRole.ToolTipRole:
            return row.tooltip or row.cells[column] or None
        return None


class RowTable(QTableView):
    """See the module's documentation."""

    selected_changed = Signal(str)
    activated_key = Signal(str)

    def __init__(self, columns: Sequence[Column], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._model = _Model(columns, self)
        self._quiet = False
        self.setModel(self._model)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTabKeyNavigation(False)
        self.setMouseTracking(True)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(ROW_HEIGHT)
        header = self.horizontalHeader()
        header.setHighlightSections(False)
        header.setSectionsClickable(False)
        header.setMinimumSectionSize(40)
        for number, column in enumerate(columns):
            if column.width:
                header.setSectionResizeMode(number, QHeaderView.ResizeMode.Fixed)
                header.resizeSection(number, column.width)
            else:
                header.setSectionResizeMode(number, QHeaderView.ResizeMode.Stretch)
        self.doubleClicked.connect(self._on_activated)
        self.selectionModel().selectionChanged.connect(self._on_selection)

    def set_rows(self, rows: Sequence[Row]) -> None:
        """Show exactly these rows; the selection is kept if it is among them."""
        before = self.selected()
        self._quiet = True
        self._model.set_rows(rows)
        self._quiet = False
        self.set_selected(before)

    def rows(self) -> list[Row]:
        """The rows shown."""
        return list(self._model.rows)

    def selected(self) -> str | None:
        """Key of the selected row."""
        indexes = self.selectionModel().selectedRows()
        return self._model.rows[indexes[0].row()].key if indexes else None

    def set_selected(self, key: str | None) -> None:
        """Select a row without emitting."""
        self._quiet = True
        keys = [row.key for row in self._model.rows]
        if key in keys:
            self.selectRow(keys.index(key))
            self.scrollTo(self._model.index(keys.index(key), 0))
        else:
            self.clearSelection()
        self._quiet = False

    @Slot(QItemSelection, QItemSelection)
    def _on_selection(self, selected: QItemSelection, deselected: QItemSelection) -> None:
        key = self.selected()
        if not self._quiet and key is not None:
            self.selected_changed.emit(key)

    @Slot(QModelIndex)
    def _on_activated(self, index: QModelIndex) -> None:
        self.activated_key.emit(self._model.rows[index.row()].key)

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        key = self.selected()
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and key is not None:
            self.activated_key.emit(key)
        else:
            super().keyPressEvent(event)


@dataclass(frozen=True)
class LesionRow:
    """A lesion as the table shows it."""

    id: str
    number: int
    site: str
    size: str = ""
    status: str = ""
    tone: str = "marked"
    last_seen: str = ""
    images: int = 0


class LesionTable(RowTable):
    """The lesions of a patient: number, anatomic site, size, state, when last seen, dermoscopic images."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            [
                Column("No.", 56),
                Column("Anatomic site"),
                Column("Status", 148),
                Column("Last seen", 136),
                Column("Images", 76, number=True),
            ],
            parent,
        )
        self.setObjectName("lesion_table")

    def set_lesions(self, lesions: Sequence[LesionRow]) -> None:
        """Show exactly these lesions."""
        self.set_rows(
            [
                Row(
                    key=x.id,
                    cells=(
                        str(x.number),
                        x.site + (f"   {x.size}" if x.size else ""),
                        x.status,
                        x.last_seen,
                        str(x.images) if x.images else "",
                    ),
                    colors={
                        1: palette.TEXT if x.tone != "removed" else palette.FAINT,
                        2: palette.STATE_COLORS.get(x.tone, palette.TEXT),
                        3: palette.SECONDARY,
                        4: palette.SECONDARY,
                    },
                    strong=frozenset({0}),
                )
                for x in lesions
            ]
        )
