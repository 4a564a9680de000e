"""The start: a window at once, the clinic when its records are open, a clear word when they are not."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton
from pytestqt.qtbot import QtBot

from app.gui import run_gui
from app.windows.main_window import MainWindow
from app.windows.start_window import StartWindow
from core.errors import GeodermError
from core.records import ClinicStore

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def nothing_heavy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No kernels are compiled for a window that closes at once; the log stays in the test."""
    monkeypatch.setattr("app.gui._load_heavy_things", lambda: None)
    monkeypatch.setenv("GEODERM_LOG_DIR", str(tmp_path / "log"))


def test_the_main_window_takes_the_place_of_the_start_window(tmp_path: Path, qapp: QApplication) -> None:
    titles: list[str] = []

    def look(window: MainWindow) -> None:
        titles.extend(w.objectName() for w in QApplication.topLevelWidgets() if w.isVisible())
        window.close()
        window.deleteLater()

    assert run_gui(tmp_path / "clinic", when_open=look) == 0
    assert titles == ["main_window"]


def test_records_that_cannot_be_opened_are_told_in_the_window_and_to_the_caller(
    tmp_path: Path, qapp: QApplication
) -> None:
    ClinicStore.open(tmp_path).close()
    with sqlite3.connect(tmp_path / "clinic.db") as database:
        database.execute("update alembic_version set version_num = 'from the future'")
    database.close()
    told: list[str] = []

    def read_and_close() -> None:
        start = next(w for w in QApplication.topLevelWidgets() if isinstance(w, StartWindow))
        close = start.findChild(QPushButton, "start_close")
        if not close.isVisible():
            QTimer.singleShot(20, read_and_close)
            return
        told.append(start.text.text())
        QTest.mouseClick(close, Qt.MouseButton.LeftButton)

    QTimer.singleShot(20, read_and_close)
    with pytest.raises(GeodermError) as failure:
        run_gui(tmp_path)
    assert told == [str(failure.value)]
    assert failure.value.advice


def test_closing_the_start_window_early_leaves_nothing_open(qtbot: QtBot) -> None:
    may_end = threading.Event()

    def slow() -> str:
        may_end.wait(10)
        return "records"

    start = StartWindow(slow)
    qtbot.addWidget(start)
    start.begin()
    start.close()
    may_end.set()
    assert start.abandon() == "records"
    assert start.abandon() is None


def test_the_start_window_needs_qt_alone() -> None:
    heavy = ("sqlalchemy", "vtkmodules", "pyvista", "numba", "cv2", "open3d", "mediapipe", "pydicom")
    code = f"import sys, app.gui; print([m for m in {heavy} if m in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert loaded.strip() == "[]"
