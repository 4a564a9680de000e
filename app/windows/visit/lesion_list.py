"""The lesions of a visit in a table: number, site, status in words with its colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPersistentModelIndex, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QPainter
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.theme import palette
from app.widgets.markers import marker_color

_ID = Qt.ItemDataRole.UserRole
_WIDEST_STATUS, _STATUS_ROOM = 288, 56
"""Pixels of the status column: at most, and beside its text. The site takes what is left."""
_TONE = Qt.ItemDataRole.UserRole + 1


@dataclass(frozen=True)
class LesionLine:
    """A row: lesion id as text, number, site, status, tone, whether the doctor must act, images attached."""

    id: str
    number: int
    site: str
    status: str
    detail: str
    tone: str
    needs_doctor: bool
    images: int


class LesionList(QTableWidget):
    """Rows of lesions; one may be selected.

    Signals
    -------
    lesion_clicked(str)
        The user selected a lesion (never emitted by `set_selected`).
    lesion_activated(str)
        Double click or Enter.
    """

    lesion_clicked = Signal(str)
    lesion_activated = Signal(str)

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(0, 3, parent)
        self.setObjectName(name)
        self.setHorizontalHeaderLabels(["No.", "Site", "Status"])
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(36)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setStyleSheet(
            f"QTableView, QTableView:focus {{ background: {palette.CARD}; }}"
            f"QTableView::item {{ padding: 0 6px; }} QHeaderView::section {{ padding: 0 6px; }}"
        )
        self.setMinimumHeight(112)
        self.setItemDelegateForColumn(2, _StatusDelegate(self))
        header = self.horizontalHeader()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(2, QHeaderView.ResizeMode.Fixed)
        header.setHighlightSections(False)
        header.setMinimumSectionSize(40)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.setColumnWidth(0, 44)
        self.setColumnWidth(2, _WIDEST_STATUS)
        self._quiet = False
        self.itemSelectionChanged.connect(self._on_selection)
        self.itemActivated.connect(lambda item: self.lesion_activated.emit(str(item.data(_ID))))

    def set_lines(self, lines: Sequence[LesionLine]) -> None:
        """Show these rows; the selection is kept by id."""
        selected = self.selected()
        self._quiet = True
        self.setRowCount(len(lines))
        widest = max((self.fontMetrics().horizontalAdvance(line.status) for line in lines), default=0)
        self.setColumnWidth(2, min(_WIDEST_STATUS, widest + _STATUS_ROOM))
        for row, line in enumerate(lines):
            texts = (str(line.number), line.site or "no site", line.status)
            for column, text in enumerate(texts):
                item = QTableWidgetItem(text)
                item.setData(_ID, line.id)
                item.setData(_TONE, line.tone)
                item.setToolTip(line.detail or text)
                if column == 1 and not line.site:
                    item.setForeground(QColor(palette.FAINT))
                self.setItem(row, column, item)
        self._quiet = False
        self.set_selected(selected)

    def ids(self) -> list[str]:
        """Lesion ids, from the top."""
        return [str(self.item(row, 0).data(_ID)) for row in range(self.rowCount())]

    def selected(self) -> str | None:
        """Id of the selected lesion."""
        rows = self.selectionModel().selectedRows()
        return str(self.item(rows[0].row(), 0).data(_ID)) if rows and self.item(rows[0].row(), 0) else None

    def set_selected(self, lesion_id: str | None) -> None:
        """Select a row without telling."""
        self._quiet = True
        ids = self.ids()
        if lesion_id in ids:
            row = ids.index(lesion_id)
            self.selectRow(row)
            self.scrollToItem(self.item(row, 0))
        else:
            self.clearSelection()
        self._quiet = False

    def _on_selection(self) -> None:
        selected = self.selected()
        if not self._quiet and selected is not None:
            self.lesion_clicked.emit(selected)


class _StatusDelegate(QStyledItemDelegate):
    """A coloured dot before the words."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: QPersistentModelIndex) -> None:
        shifted = QStyleOptionViewItem(option)
        self.initStyleOption(shifted, index)
        text, shifted.text = shifted.text, ""
        style = option.widget.style()
        style.drawControl(QStyle.ControlElement.CE_ItemViewItem, shifted, painter, option.widget)
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(marker_color(index.data(_TONE)))
        middle = option.rect.center().y() + 0.5
        painter.drawEllipse(QRectF(option.rect.left() + 8, middle - 5, 10, 10))
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(shifted.font)
        room = option.rect.adjusted(26, 0, -4, 0)
        words = painter.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, room.width())
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, words)
        painter.restore()
