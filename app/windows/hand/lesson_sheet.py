"""The sheet that shows what was learned, from which frames, and how well configurations are told apart."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QAbstractItemView, QLabel, QTableWidget, QTableWidgetItem, QWidget

from app.theme import palette, style_class
from app.widgets.sheet import Sheet
from app.widgets.tables import Column, Row, RowTable

if TYPE_CHECKING:
    from core.hand.learning import Confusion, Lesson

_MOST_ROWS = 6
_CELL, _ROW = 92, 32


class LessonSheet(Sheet):
    """See the module's documentation.

    Parameters
    ----------
    parent : QWidget
    lesson : Lesson
    save, use : callable
        What its buttons do.
    """

    def __init__(
        self,
        parent: QWidget,
        lesson: Lesson,
        save: Callable[[], object],
        use: Callable[[], object],
    ) -> None:
        super().__init__(parent, "What was learned", "hand_lesson", width=720)
        self.body.addWidget(_label(used_text(lesson), "strong", "hand_lesson_used"))
        if lesson.confusion is not None:
            self.body.addWidget(_label(accuracy_text(lesson.confusion), "secondary", "hand_lesson_accuracy"))
            self.body.addWidget(confusion_table(lesson.confusion))
        for remark in lesson.remarks:
            self.body.addWidget(_label(remark, "caption", "hand_lesson_remark"))
        gone = [*lesson.left_out, *lesson.points_left_out]
        if gone:
            self.body.addWidget(_label(left_out_text(lesson), "strong", "hand_lesson_left_out"))
            table = RowTable([Column("Frame", 150), Column("Why it teaches less, or nothing")])
            table.setObjectName("hand_lesson_frames")
            table.setAccessibleName("Frames that were left out, with reasons")
            table.setWordWrap(True)
            table.verticalHeader().setDefaultSectionSize(_ROW)
            table.set_rows(
                [Row(f"{k}", (name, reason), tooltip=reason) for k, (name, reason) in enumerate(gone)]
            )
            table.resizeRowsToContents()
            table.setFixedHeight(40 + _ROW * min(len(gone) + 1, _MOST_ROWS))
            self.body.addWidget(table)
        self.add_button("Close", "secondary", self.close_sheet, "hand_lesson_done")
        self.add_button("Save model…", "secondary", save, "hand_lesson_save")
        self.add_button("Use now", "primary", use, "hand_lesson_use")


def used_text(lesson: Lesson) -> str:
    """From how many frames of each configuration."""
    told = ", ".join(f"{name} ({count})" for name, count in lesson.used.items())
    return f"Learned from {sum(lesson.used.values())} frames: {told}."


def accuracy_text(confusion: Confusion) -> str:
    """How often the configuration is told rightly."""
    right, count = round(confusion.accuracy * confusion.counts.sum()), int(confusion.counts.sum())
    return (
        f"Configuration told rightly in {right} of {count} frames ({confusion.accuracy:.0%}), each frame "
        f"judged by what was learned without it ({confusion.folds} parts). Rows: what it is; "
        "columns: what was told."
    )


def left_out_text(lesson: Lesson) -> str:
    """How many frames do not count."""
    frames, points = len(lesson.left_out), len(lesson.points_left_out)
    parts = []
    if frames:
        parts.append(f"{frames} frame{'s'[: frames != 1]} left out")
    if points:
        parts.append(f"{points} point{'s'[: points != 1]} left out")
    return f"{', '.join(parts)}:"


def confusion_table(confusion: Confusion) -> QTableWidget:
    """The matrix, right answers green, wrong ones red."""
    names = list(confusion.classes)
    told = [*names, "unknown"]
    table = QTableWidget(len(names), len(told))
    table.setObjectName("hand_lesson_confusion")
    table.setAccessibleName("Confusion matrix: rows what it is, columns what was told")
    table.setHorizontalHeaderLabels(told)
    table.setVerticalHeaderLabels(names)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
    table.setTabKeyNavigation(False)
    table.horizontalHeader().setDefaultAlignment(Qt.AlignmentFlag.AlignCenter)
    table.horizontalHeader().setDefaultSectionSize(max(_CELL, 600 // (len(told) + 1) // 2))
    table.verticalHeader().setDefaultSectionSize(_ROW)
    table.verticalHeader().setMinimumWidth(100)
    for row in range(len(names)):
        for column in range(len(told)):
            count = int(confusion.counts[row, column])
            cell = QTableWidgetItem(str(count))
            cell.setTextAlignment(Qt.AlignmentFlag.AlignCenter)
            if count:
                right = row == column
                cell.setBackground(QColor(palette.GREEN_SOFT if right else palette.RED_SOFT))
                cell.setForeground(QColor(palette.GREEN if right else palette.RED))
            else:
                cell.setForeground(QColor(palette.FAINT))
            table.setItem(row, column, cell)
    table.setFixedHeight(44 + _ROW * min(len(names), _MOST_ROWS))
    return table


def _label(text: str, look: str, name: str) -> QLabel:
    label = QLabel(text)
    label.setObjectName(name)
    label.setWordWrap(True)
    label.setTextFormat(Qt.TextFormat.PlainText)
    style_class(label, look)
    return label
