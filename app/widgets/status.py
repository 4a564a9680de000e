"""Where the user is and what is happening: `StepBar`, `MessageBanner`, `ProgressOverlay`, `EmptyState`.

Public API
----------
``StepBar(steps: Sequence[tuple[str key, str title]])``: ``set_current(key)``, ``set_done(keys)``,
    ``set_enabled_steps(keys)``; signal ``step_clicked(str key)``. Each step is a button named ``step_<key>``.
``MessageBanner()``: ``show_info|show_success|show_warning|show_error(message, advice="", actions=[(key,
    text)])``,
    ``show_failure(TaskFailure)``, ``clear()``; signal ``action_triggered(str key)``. Hidden while it has
        nothing to say.
``ProgressOverlay(parent)``: covers its parent; ``attach(task)`` shows title, bar, message and Cancel until
    the task ends.
``EmptyState(icon, title, text, action="")``: signal ``action_triggered()``; the button is ``empty_action``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from PySide6.QtCore import QEvent, QObject, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.tasks import Task, TaskFailure
from app.theme import icon, icon_pixmap, palette, set_state, style_class


class StepBar(QFrame):
    """The steps of a workflow in a row: done, current, still to come."""

    step_clicked = Signal(str)

    def __init__(self, steps: Sequence[tuple[str, str]] = (), parent: QWidget | None = None) -> None:
        super().__init__(parent)
        style_class(self, "stepbar")
        self.setObjectName("step_bar")
        self._layout = QHBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(4)
        self._buttons: dict[str, QPushButton] = {}
        self._titles: dict[str, str] = {}
        self._current = ""
        self._done: set[str] = set()
        self._enabled: set[str] = set()
        self.set_steps(steps)

    def set_steps(self, steps: Sequence[tuple[str, str]]) -> None:
        """Show other steps."""
        while (item := self._layout.takeAt(0)) is not None:
            if item.widget() is not None:
                item.widget().deleteLater()
        self._buttons, self._titles = {}, dict(steps)
        for number, (key, title) in enumerate(steps, start=1):
            if number > 1:
                arrow = QLabel()
                arrow.setPixmap(icon_pixmap("chevron-right", 14, palette.FAINT))
                self._layout.addWidget(arrow)
            button = QPushButton(f"{number}  {title}")
            button.setObjectName(f"step_{key}")
            button.setIconSize(QSize(16, 16))
            button.clicked.connect(lambda _=False, k=key: self.step_clicked.emit(k))
            style_class(button, "step")
            self._buttons[key] = button
            self._layout.addWidget(button)
        self._layout.addStretch(1)
        self._refresh()

    def set_current(self, key: str) -> None:
        """Mark where the user is."""
        self._current = key
        self._refresh()

    def current(self) -> str:
        """Key of the current step."""
        return self._current

    def set_done(self, keys: Iterable[str]) -> None:
        """Mark the steps that are finished."""
        self._done = set(keys)
        self._refresh()

    def set_enabled_steps(self, keys: Iterable[str]) -> None:
        """Which steps may be clicked; the current one never needs to be."""
        self._enabled = set(keys)
        self._refresh()

    def _refresh(self) -> None:
        for number, (key, button) in enumerate(self._buttons.items(), start=1):
            done, current = key in self._done, key == self._current
            set_state(button, "phase", "current" if current else "done" if done else "todo")
            button.setEnabled(current or key in self._enabled)
            tint = (palette.ACCENT if current else palette.GREEN) if done else "none"
            button.setIcon(icon("check", tint, disabled=tint))
            button.setText(f"{self._titles[key]}" if done else f"{number}   {self._titles[key]}")
            button.setIconSize(QSize(16, 16) if done else QSize(1, 16))


class MessageBanner(QFrame):
    """A message in the page, with advice and optional actions; never a pop-up."""

    action_triggered = Signal(str)
    _KINDS = {  # noqa: RUF012 - a constant
        "info": ("info", palette.SECONDARY),
        "success": ("success", palette.GREEN),
        "warning": ("warning", palette.AMBER),
        "error": ("error", palette.RED),
    }

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("message_banner")
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 10, 8, 10)
        row.setSpacing(12)
        self._icon = QLabel()
        self._message = QLabel()
        self._message.setObjectName("banner_message")
        self._advice = QLabel()
        self._advice.setObjectName("banner_advice")
        for label in (self._message, self._advice):
            label.setWordWrap(True)
            label.setTextFormat(Qt.TextFormat.PlainText)
        style_class(self._message, "strong")
        texts = QVBoxLayout()
        texts.setSpacing(2)
        texts.addWidget(self._message)
        texts.addWidget(self._advice)
        self._actions = QHBoxLayout()
        self._actions.setSpacing(8)
        self._close = QToolButton()
        self._close.setObjectName("banner_close")
        self._close.setIcon(icon("close", palette.SECONDARY))
        self._close.setToolTip("Dismiss")
        style_class(self._close, "icon")
        self._close.clicked.connect(self.clear)
        row.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignVCenter)
        row.addLayout(texts, 1)
        row.addLayout(self._actions)
        row.addWidget(self._close, 0, Qt.AlignmentFlag.AlignVCenter)
        self.kind = ""
        self.hide()

    def show_info(self, message: str, advice: str = "", actions: Sequence[tuple[str, str]] = ()) -> None:
        """Say something neutral."""
        self._show("info", message, advice, actions)

    def show_success(self, message: str, advice: str = "", actions: Sequence[tuple[str, str]] = ()) -> None:
        """Say that something is done."""
        self._show("success", message, advice, actions)

    def show_warning(self, message: str, advice: str = "", actions: Sequence[tuple[str, str]] = ()) -> None:
        """Say what to look at."""
        self._show("warning", message, advice, actions)

    def show_error(self, message: str, advice: str = "", actions: Sequence[tuple[str, str]] = ()) -> None:
        """Say what could not be done, and what to do about it."""
        self._show("error", message, advice, actions)

    def show_failure(self, failure: TaskFailure) -> None:
        """Tell of a failed task."""
        self.show_error(failure.message, failure.advice)

    def text(self) -> str:
        """Message and advice as shown; empty while hidden."""
        return f"{self._message.text()} {self._advice.text()}".strip() if self.kind else ""

    @Slot()
    def clear(self) -> None:
        """Say nothing."""
        self.kind = ""
        self.hide()

    def _show(self, kind: str, message: str, advice: str, actions: Sequence[tuple[str, str]]) -> None:
        self.kind = kind
        name, color = self._KINDS[kind]
        style_class(self, f"banner-{kind}")
        self._icon.setPixmap(icon_pixmap(name, 22, color))
        self._message.setText(message)
        self._advice.setText(advice)
        self._advice.setVisible(bool(advice))
        while (item := self._actions.takeAt(0)) is not None:
            item.widget().deleteLater()
        for key, text in actions:
            button = QPushButton(text)
            button.setObjectName(f"banner_action_{key}")
            button.clicked.connect(lambda _=False, k=key: self.action_triggered.emit(k))
            self._actions.addWidget(button)
        self.show()


class ProgressOverlay(QWidget):
    """Covers its parent while a task runs: what is done, how far it is, and Cancel."""

    cancel_clicked = Signal()

    def __init__(self, parent: QWidget, delay_ms: int = 250) -> None:
        super().__init__(parent)
        self.setObjectName("progress_overlay")
        self._task: Task | None = None
        self._title = QLabel()
        self._title.setObjectName("progress_title")
        style_class(self._title, "heading")
        self._bar = QProgressBar()
        self._bar.setObjectName("progress_bar")
        self._bar.setRange(0, 1000)
        self._bar.setTextVisible(False)
        self._message = QLabel(" ")
        self._message.setObjectName("progress_message")
        style_class(self._message, "secondary")
        self._cancel = QPushButton("Cancel")
        self._cancel.setObjectName("progress_cancel")
        self._cancel.clicked.connect(self._on_cancel)
        card = QFrame()
        style_class(card, "sheet")
        card.setFixedWidth(440)
        column = QVBoxLayout(card)
        column.setContentsMargins(28, 24, 28, 20)
        column.setSpacing(12)
        column.addWidget(self._title)
        column.addWidget(self._bar)
        column.addWidget(self._message)
        column.addWidget(self._cancel, 0, Qt.AlignmentFlag.AlignRight)
        box = QVBoxLayout(self)
        box.addWidget(card, 0, Qt.AlignmentFlag.AlignCenter)
        self._show_timer = QTimer(self, singleShot=True, interval=delay_ms)
        self._show_timer.timeout.connect(self._appear)
        parent.installEventFilter(self)
        self.hide()

    @property
    def task(self) -> Task | None:
        """The task being shown."""
        return self._task

    def attach(self, task: Task) -> None:
        """Show ``task`` until it ends (after a moment: short tasks do not flash)."""
        self._task = task
        self._title.setText(task.title)
        self._message.setText("Starting")
        self._bar.setValue(0)
        self._cancel.setVisible(task.cancellable)
        self._cancel.setEnabled(True)
        self._cancel.setText("Cancel")
        task.progressed.connect(self._on_progress)
        task.ended.connect(self._on_ended)
        self._show_timer.start()

    @Slot()
    def _appear(self) -> None:
        if self._task is not None:
            self.setGeometry(self.parentWidget().rect())
            self.raise_()
            self.show()
            self._cancel.setFocus()

    @Slot(float, str)
    def _on_progress(self, fraction: float, message: str) -> None:
        self._bar.setValue(round(1000 * fraction))
        if message:
            self._message.setText(message)

    @Slot()
    def _on_cancel(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._cancel.setEnabled(False)
            self._cancel.setText("Stopping")
        self.cancel_clicked.emit()

    @Slot()
    def _on_ended(self) -> None:
        if self._task is None or not self._task.running:
            self._task = None
            self._show_timer.stop()
            self.hide()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: D102
        if watched is self.parent() and event.type() == QEvent.Type.Resize:
            self.setGeometry(self.parentWidget().rect())
        return super().eventFilter(watched, event)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        QPainter(self).fillRect(self.rect(), QColor(23, 36, 43, 110))


class EmptyState(QWidget):
    """What a list shows while there is nothing in it, and what to do about it."""

    action_triggered = Signal()

    def __init__(
        self, icon_name: str, title: str, text: str = "", action: str = "", parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        picture = QLabel()
        picture.setPixmap(icon_pixmap(icon_name, 44, palette.BORDER_STRONG))
        picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._title = QLabel(title)
        self._text = QLabel(text)
        style_class(self._title, "heading")
        style_class(self._text, "secondary")
        for label in (self._title, self._text):
            label.setAlignment(Qt.AlignmentFlag.AlignCenter)
            label.setWordWrap(True)
            label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        column = QVBoxLayout(self)
        column.setSpacing(8)
        column.addStretch(1)
        for widget in (picture, self._title, self._text):
            column.addWidget(widget)
        if action:
            button = QPushButton(action)
            button.setObjectName("empty_action")
            button.clicked.connect(self.action_triggered)
            column.addSpacing(8)
            column.addWidget(button, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addStretch(1)

    def set_text(self, title: str, text: str = "") -> None:
        """Say something else."""
        self._title.setText(title)
        self._text.setText(text)
