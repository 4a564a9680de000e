"""Drives the real windows with real mouse and key events, as a person would; finds widgets by object name."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QLineEdit, QPlainTextEdit, QWidget

from app.widgets.photo_view import PhotoView

W = TypeVar("W", bound=QWidget)
STEP_TIMEOUT_S = 30.0
WORK_TIMEOUT_S = 300.0


def _let_run(seconds: float) -> None:
    """Let the application run for a while.

    Not ``QTest.qWait``: it keeps Python's lock while it waits, and the task runner's thread starves.
    """
    deadline = time.monotonic() + seconds
    while True:
        QApplication.processEvents()
        if time.monotonic() >= deadline:
            return
        time.sleep(0.005)


class DriverError(AssertionError):
    """The windows did not do what a person would expect of them."""


class WindowDriver:
    """A pair of hands on one window.

    Parameters
    ----------
    window : QWidget
        The main window, shown.
    pictures : Path
        Folder for screenshots.
    """

    def __init__(self, window: QWidget, pictures: Path) -> None:
        self.window, self._pictures = window, pictures
        pictures.mkdir(parents=True, exist_ok=True)

    def wait_until(self, condition: Callable[[], bool], what: str, timeout_s: float = STEP_TIMEOUT_S) -> None:
        """Let the application run until ``condition`` holds.

        Raises
        ------
        DriverError
            If it does not hold in time; a shown error message is quoted.
        """
        deadline = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > deadline:
                self.shoot("stuck")
                raise DriverError(f"waited {timeout_s:.0f} s for: {what}. On screen: {self.banner_text()}")
            _let_run(0.02)

    def banner_text(self) -> str:
        """Text of the visible message banners."""
        texts = [
            label.text()  # type: ignore[attr-defined]
            for name in ("banner_message", "banner_advice", "progress_message")
            for label in self.window.findChildren(QWidget, name)
            if label.isVisible()
        ]
        return " / ".join(texts) or "no message"

    def is_shown(self, name: str) -> bool:
        """Whether a visible, enabled widget of that name is there."""
        return any(w.isVisible() and w.isEnabled() for w in self._all(name))

    def _all(self, name: str) -> list[QWidget]:
        found: list[QWidget] = []
        for top in QApplication.topLevelWidgets():
            if top.objectName() == name:
                found.append(top)
            found += top.findChildren(QWidget, name)
        return found

    def find(self, name: str, kind: type[W] = QWidget, timeout_s: float = STEP_TIMEOUT_S) -> W:  # type: ignore[assignment]
        """Wait for the visible, enabled widget of that name."""
        found: list[W] = []

        def look() -> bool:
            found[:] = [w for w in self._all(name) if isinstance(w, kind) and w.isVisible() and w.isEnabled()]
            return bool(found)

        self.wait_until(look, f"{kind.__name__} '{name}' to be usable", timeout_s)
        return found[0]

    def click(self, name: str, timeout_s: float = STEP_TIMEOUT_S) -> None:
        """Click the middle of a widget."""
        widget = self.find(name, timeout_s=timeout_s)
        if isinstance(widget, QAbstractButton):
            widget.setFocus(Qt.FocusReason.MouseFocusReason)
        QTest.mouseMove(widget, widget.rect().center())
        QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=widget.rect().center())
        _let_run(0.06)

    def type(self, name: str, text: str, *, enter: bool = False) -> None:
        """Replace the text of a field by typing."""
        field = self.find(name)
        if isinstance(field, QComboBox) and field.lineEdit() is not None:
            field = field.lineEdit()
        QTest.mouseClick(field, Qt.MouseButton.LeftButton)
        if isinstance(field, QLineEdit | QPlainTextEdit):
            field.selectAll()
        if not text:
            QTest.keyClick(field, Qt.Key.Key_Delete)
        elif text.isascii():
            QTest.keyClicks(field, text)
        else:
            for character in text:
                QTest.keyClick(field, character) if character.isascii() else _input(field, character)
        if enter:
            QTest.keyClick(field, Qt.Key.Key_Return)
        _let_run(0.06)

    def choose(self, name: str, text: str) -> None:
        """Choose the entry of a combo box that contains ``text``, with the keyboard."""
        box = self.find(name, QComboBox)
        entries = [box.itemText(i).lower() for i in range(box.count())]
        whole = [i for i, entry in enumerate(entries) if entry == text.lower()]
        row = next(iter(whole or [i for i, entry in enumerate(entries) if text.lower() in entry]), -1)
        if row < 0:
            raise DriverError(f"'{name}' has no entry '{text}'")
        box.setFocus()
        QTest.keyClick(box, Qt.Key.Key_Home)
        for _ in range(box.count()):
            if box.currentIndex() == row:
                break
            QTest.keyClick(box, Qt.Key.Key_Down)
        _let_run(0.06)

    def click_photo(self, name: str, u: float, v: float) -> None:
        """Click an image pixel of a photo view, zoomed in so that the click is finer than a pixel."""
        photo = self.find(name, PhotoView)
        photo.center_on(u, v, 6.0)
        _let_run(0.04)
        self._move_and_click(photo, photo.viewport_position(u, v))

    def drag_photo(self, name: str, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag from one image pixel to another."""
        photo = self.find(name, PhotoView)
        photo.center_on((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, 4.0)
        _let_run(0.04)
        a, b = photo.viewport_position(*start), photo.viewport_position(*end)
        QTest.mousePress(photo.viewport(), Qt.MouseButton.LeftButton, pos=a)
        for i in range(1, 9):
            QTest.mouseMove(photo.viewport(), a + (b - a) * (i / 8), 15)
        QTest.mouseRelease(photo.viewport(), Qt.MouseButton.LeftButton, pos=b)
        _let_run(0.08)

    def _move_and_click(self, photo: PhotoView, place: QPoint) -> None:
        QTest.mouseMove(photo.viewport(), place)
        QTest.mouseClick(photo.viewport(), Qt.MouseButton.LeftButton, pos=place)
        _let_run(0.06)

    def settle(self, seconds: float = 0.4) -> None:
        """Let paints and short animations finish."""
        _let_run(seconds)

    def shoot(self, name: str) -> Path:
        """Save a picture of the window."""
        self.settle()
        path = self._pictures / f"{name}.png"
        if not self.window.grab().save(str(path)):
            raise DriverError(f"{path}: the picture could not be saved")
        return path


def _input(field: QWidget, text: str) -> None:
    """Type what no key of the test library's keyboard has, as an input method does."""
    from PySide6.QtGui import QInputMethodEvent

    event = QInputMethodEvent()
    event.setCommitString(text)
    QApplication.sendEvent(field, event)
