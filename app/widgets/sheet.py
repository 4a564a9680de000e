"""Dialogs inside the window: a card over a dimmed page. They never block; answers come by signal.

Public API
----------
``Sheet(parent, title, object_name="sheet")``: fill ``sheet.body`` (a QVBoxLayout), add buttons with
    ``sheet.add_button(text, "primary" | "secondary" | "danger" | "quiet", slot, object_name)``; ``open()``,
    ``close_sheet()``; signal ``gone()``. Escape closes it, Tab stays inside.
``ask(parent, title, text, confirm, on_confirm, *, danger=False) -> Sheet``   buttons ``sheet_confirm``,
    ``sheet_cancel``
``tell(parent, title, text) -> Sheet``                                        button ``sheet_ok``
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt, Signal, Slot
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QApplication,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import icon, palette, style_class

_MARGIN = 32


class Sheet(QWidget):
    """See the module's documentation."""

    gone = Signal()

    def __init__(
        self, parent: QWidget, title: str, object_name: str = "sheet", *, width: int | None = 520
    ) -> None:
        super().__init__(parent.window())
        self.setObjectName(object_name)
        self._fills = width is None
        card = self._card = QFrame()
        style_class(card, "sheet")
        if width is not None:
            card.setFixedWidth(width)
        heading = QLabel(title)
        heading.setObjectName(f"{object_name}_title")
        style_class(heading, "heading")
        close = QToolButton()
        close.setObjectName(f"{object_name}_close")
        close.setIcon(icon("close", palette.SECONDARY))
        close.setToolTip("Close (Esc)")
        close.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        style_class(close, "icon")
        close.clicked.connect(self.close_sheet)
        head = self.head = QHBoxLayout()
        head.addWidget(heading)
        head.addStretch(1)
        head.addWidget(close)
        self.body = QVBoxLayout()
        self.body.setSpacing(12)
        self._buttons = QHBoxLayout()
        self._buttons.setSpacing(8)
        self._buttons.addStretch(1)
        column = QVBoxLayout(card)
        column.setContentsMargins(28, 20, 28, 24)
        column.setSpacing(16)
        column.addLayout(head)
        column.addLayout(self.body, 1)
        column.addLayout(self._buttons)
        box = QVBoxLayout(self)
        box.setContentsMargins(_MARGIN, _MARGIN, _MARGIN, _MARGIN)
        if width is None:
            box.addWidget(card)
        else:
            box.addWidget(card, 0, Qt.AlignmentFlag.AlignCenter)
        self._before: QWidget | None = None
        self.parentWidget().installEventFilter(self)
        self.hide()

    def add_button(
        self, text: str, kind: str, slot: Callable[[], object], object_name: str = ""
    ) -> QPushButton:
        """Add a button at the lower right; the primary one answers Enter."""
        button = QPushButton(text)
        button.setObjectName(object_name or f"sheet_{text.lower().replace(' ', '_')}")
        style_class(button, kind)
        button.clicked.connect(lambda _=False: slot())
        if kind == "primary":
            self._primary = button
        self._buttons.addWidget(button)
        return button

    def open(self, focus: QWidget | None = None) -> Sheet:
        """Show the sheet and give ``focus`` (or its first field) the keyboard."""
        self._before = QApplication.focusWidget()
        self.setGeometry(self.parentWidget().rect())
        self.raise_()
        self.show()
        if focus is not None:
            focus.setFocus(Qt.FocusReason.OtherFocusReason)
        else:
            self.focusNextChild()
        return self

    @Slot()
    def close_sheet(self) -> None:
        """Take the sheet away and give the keyboard back."""
        if not self.isVisible() and self._before is None:
            return
        before, self._before = self._before, None
        self.parentWidget().removeEventFilter(self)
        self.hide()
        if before is not None and before.isVisible():
            before.setFocus(Qt.FocusReason.OtherFocusReason)
        self.gone.emit()
        self.deleteLater()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        if watched is self.parent() and event.type() == QEvent.Type.Resize:
            self.setGeometry(self.parentWidget().rect())
        return super().eventFilter(watched, event)

    def focusNextPrevChild(self, forward: bool) -> bool:  # noqa: D102
        fields = [
            w
            for w in self.findChildren(QWidget)
            if w.focusPolicy() & Qt.FocusPolicy.TabFocus and w.isEnabled() and w.isVisibleTo(self)
        ]
        if not fields:
            return False
        now = QApplication.focusWidget()
        at = fields.index(now) + (1 if forward else -1) if now in fields else 0
        fields[at % len(fields)].setFocus(
            Qt.FocusReason.TabFocusReason if forward else Qt.FocusReason.BacktabFocusReason
        )
        return True

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102
        if event.key() == Qt.Key.Key_Escape:
            self.close_sheet()
        elif event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            primary = getattr(self, "_primary", None)
            if primary is not None and primary.isEnabled():
                primary.click()
        else:
            event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102
        event.accept()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        QPainter(self).fillRect(self.rect(), QColor(23, 36, 43, 120))


def _text(text: str) -> QLabel:
    label = QLabel(text)
    label.setWordWrap(True)
    label.setObjectName("sheet_text")
    style_class(label, "secondary")
    return label


def ask(
    parent: QWidget,
    title: str,
    text: str,
    confirm: str,
    on_confirm: Callable[[], object],
    *,
    danger: bool = False,
) -> Sheet:
    """Ask before something is done."""
    sheet = Sheet(parent, title, "ask_sheet", width=480)
    sheet.body.addWidget(_text(text))

    def confirmed() -> None:
        sheet.close_sheet()
        on_confirm()

    sheet.add_button("Cancel", "secondary", sheet.close_sheet, "sheet_cancel")
    button = sheet.add_button(confirm, "danger" if danger else "primary", confirmed, "sheet_confirm")
    sheet.open(button)
    return sheet


def tell(parent: QWidget, title: str, text: str) -> Sheet:
    """Tell something that needs to be read."""
    sheet = Sheet(parent, title, "tell_sheet", width=480)
    sheet.body.addWidget(_text(text))
    button = sheet.add_button("OK", "primary", sheet.close_sheet, "sheet_ok")
    sheet.open(button)
    return sheet
