"""The start of the application as a process of its own."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

from core.records import ClinicStore

ROOT = Path(__file__).resolve().parents[2]

START = """
import json, sys
from pathlib import Path
from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QWidget
from app.gui import application, run_gui

HEAVY = {heavy}
told = {{"heavy": {{}}}}

def then(window):
{then}

class Watch(QObject):
    def eventFilter(self, watched, event):
        if event.type() == QEvent.Type.Paint and isinstance(watched, QWidget):
            window = watched.window()
            if window.objectName() not in told["heavy"]:
                told["heavy"][window.objectName()] = sorted(set(HEAVY) & set(sys.modules))
                if window.objectName() == "main_window":
                    QTimer.singleShot(0, lambda: then(window))
        return False

watch = Watch()
application().installEventFilter(watch)
try:
    code = run_gui(Path(sys.argv[1]))
finally:
    Path(sys.argv[2]).write_text(json.dumps(told))
sys.exit(code)
"""
HEAVY = ("pyvista", "pyvistaqt", "vtkmodules", "open3d", "mediapipe", "numba", "scipy", "pydicom")
Told = dict[str, Any]


def start(tmp_path: Path, clinic: Path, then: str) -> tuple[subprocess.CompletedProcess[str], Told]:
    """Run the application until ``then`` ends it; it is given the main window once that is painted."""
    out = tmp_path / "told.json"
    body = "\n".join(f"    {line}" for line in then.strip().splitlines())
    done = python(tmp_path, START.format(heavy=HEAVY, then=body), str(clinic), str(out))
    return done, json.loads(out.read_text()) if out.exists() else {}


def python(tmp_path: Path, script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", script, *arguments],
        env={**os.environ, "GEODERM_LOG_DIR": str(tmp_path / "log"), "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_heavy_libraries_are_loaded_after_the_first_paint_and_closing_meanwhile_ends_cleanly(
    tmp_path: Path,
) -> None:
    done, told = start(
        tmp_path,
        tmp_path / "clinic",
        """
from app.widgets.body_backend import body_backend
body_backend().loaded.connect(window.close)
QTimer.singleShot(45_000, lambda: sys.exit(9))
""",
    )
    assert done.returncode == 0, done.stderr
    assert told["heavy"] == {"start_window": [], "main_window": []}
    assert not done.stderr


def newer_clinic(folder: Path) -> Path:
    """A clinic that a later version has written."""
    ClinicStore.open(folder).close()
    with closing(sqlite3.connect(folder / "clinic.db")) as database:
        database.execute("UPDATE alembic_version SET version_num = '9999_from_the_future'")
        database.commit()
    return folder


def test_records_of_a_newer_version_are_told_in_the_window_and_left_alone(tmp_path: Path) -> None:
    clinic = newer_clinic(tmp_path / "clinic")
    before = (clinic / "clinic.db").read_bytes()
    script = """
import sys
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget
from app.gui import application
from app.cli.main import main
app = application()
def look():
    for window in app.topLevelWidgets():
        button = window.findChild(QWidget, "start_close")
        if button is not None and button.isVisible():
            print(window.findChild(QWidget, "start_text").text())
            QTest.mouseClick(button, Qt.MouseButton.LeftButton)
timer = QTimer(interval=50)
timer.timeout.connect(look)
timer.start()
sys.exit(main(["run", "--data", sys.argv[1]]))
"""
    done = python(tmp_path, script, str(clinic))
    assert "newer version" in done.stdout
    assert "Install" in done.stdout, "it says what to do"
    assert done.returncode == 3, "and the command says the same"
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("geoderm: ")
    assert (clinic / "clinic.db").read_bytes() == before
