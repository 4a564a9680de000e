"""Real windows on a real screen. A Qt warning, or a window, thread or 3D view left behind, fails the test."""

from __future__ import annotations

import gc
import json
import os
import shutil
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QMessageLogContext, QtMsgType, qInstallMessageHandler
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import isValid

from app.context import AppContext
from app.demo.driver import WindowDriver
from app.lasting_none import keep_none
from app.theme import apply_theme
from app.widgets.body_backend import body_backend
from app.windows.main_window import MainWindow
from app.workflows.session import VisitSession
from app.workflows.table import Event
from core.capture import write_capture
from core.records import ClinicStore, PatientDraft
from devices.camera import DeviceInfo
from devices.simulator import SimulatedCapture, SimulatedPatient
from devices.simulator.room import make_rig
from devices.trackers import default_tracker

W = TypeVar("W", bound=QWidget)
USER, DISPLAY_NAME, PASSWORD = "weber", "Dr Anna Weber", "a long password 1"
LOUD = (QtMsgType.QtWarningMsg, QtMsgType.QtCriticalMsg, QtMsgType.QtFatalMsg)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    reason = _no_screen()
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker("no_qt_log")  # `nothing_left_behind` listens longer: until all windows are gone
            if reason:
                item.add_marker(pytest.mark.skip(reason=reason))


def _no_screen() -> str:
    """Why no window can be shown, empty if one can."""
    if not sys.platform.startswith("linux"):
        return ""
    advice = "run the tests with .setup/virtual-screen"
    display = os.environ.get("DISPLAY", "")
    if not display:
        return f"there is no screen: {advice}"
    if display.startswith(":"):
        place = f"/tmp/.X11-unix/X{display[1:].split('.')[0]}"
        with socket.socket(socket.AF_UNIX) as door:
            if door.connect_ex(place) and door.connect_ex("\0" + place):
                return f"the screen {display} does not answer: {advice}"
    return ""


# --- what every test is held to ---------------------------------------------------------------------------


@pytest.fixture(scope="session")
def backend(qapp: QApplication) -> None:
    """The 3D libraries, loaded once, as the application does in the background."""
    keep_none()
    loader = body_backend()
    loader.load()
    deadline = time.monotonic() + 120
    while not loader.ready:
        QApplication.processEvents()
        assert time.monotonic() < deadline, "the 3D libraries did not load"
        time.sleep(0.02)


@pytest.fixture(autouse=True)
def nothing_left_behind(backend: None, qapp: QApplication) -> Iterator[list[str]]:
    """Fails the test on a Qt warning, and on a window, thread or 3D view that outlives it.

    The messages of Qt are handed out: a test that expects one takes it out of the list.
    """
    apply_theme(qapp)
    messages: list[str] = []

    def listen(kind: QtMsgType, context: QMessageLogContext, text: str) -> None:
        if kind in LOUD:
            messages.append(f"{kind.name}: {text}")

    before = qInstallMessageHandler(listen)
    hook, windows, threads = sys.excepthook, set(_windows()), set(threading.enumerate())
    yield messages
    sys.excepthook = hook
    _finish_deletions()
    left = [f"{w!r} '{w.objectName()}'" for w in _windows() if w not in windows]
    running = [t.name for t in threading.enumerate() if t not in threads]
    views = _open_3d_views()
    qInstallMessageHandler(before)
    assert not messages, "Qt complained"
    assert not left, "windows were left behind"
    assert not running, "threads were left behind"
    assert not views, "3D views were left behind"


def _finish_deletions() -> None:
    for _ in range(3):
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QApplication.processEvents()


def _windows() -> list[QWidget]:
    """Top-level windows; Qt keeps its tooltip for the next time."""
    return [
        w for w in QApplication.topLevelWidgets() if isValid(w) and w.metaObject().className() != "QTipLabel"
    ]


def _open_3d_views() -> list[str]:
    """Plotters and OpenGL windows of VTK that were not freed."""
    from pyvista.plotting.plotter import _ALL_PLOTTERS
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    open_plotters = [name for name, plotter in _ALL_PLOTTERS.items() if not plotter._closed]
    if not _ALL_PLOTTERS:
        return []
    gc.collect()
    return open_plotters + [type(o).__name__ for o in gc.get_objects() if isinstance(o, vtkRenderWindow)]


# --- windows ----------------------------------------------------------------------------------------------


class NoCameras:
    """A computer with no camera: captures come from folders."""

    def list(self) -> list[DeviceInfo]:
        return []

    def open(self, camera_id: str) -> object:
        raise AssertionError(camera_id)


Show = Callable[..., Any]


@pytest.fixture
def show(qapp: QApplication, qtbot: QtBot) -> Iterator[Show]:
    """Shows a widget as a window of its own, and takes it away at the end."""
    shown: list[QWidget] = []

    def make(widget: W, size: tuple[int, int] = (900, 700)) -> W:
        shown.append(widget)
        widget.resize(*size)
        widget.show()
        qtbot.waitExposed(widget)
        QApplication.processEvents()
        return widget

    yield make
    for widget in reversed(shown):
        if isValid(widget):
            widget.close()
            widget.deleteLater()


class Desk(WindowDriver):
    """The main window of a clinic, and the hands on it."""

    def __init__(self, window: MainWindow, pictures: Path) -> None:
        super().__init__(window, pictures)
        self.main, self.context, self.store = window, window.context, window.context.store

    @property
    def page(self) -> QWidget:
        """The page shown."""
        return self.main.stack.currentWidget()

    def text(self, name: str) -> str:
        """Text of a visible widget."""
        return str(self.find(name).text())  # type: ignore[attr-defined]

    def idle(self) -> None:
        """Wait for all work to end."""
        self.wait_until(lambda: not self.context.tasks.busy, "the work to end", 60)

    def sign_in(self) -> None:
        """As the user of the test clinics."""
        self.type("login_username", USER)
        self.type("login_password", PASSWORD, enter=True)
        self.find("patients_page")

    def open_patient(self, search: str) -> None:
        """From the list, by name."""
        self.type("patient_search", search, enter=True)
        self.find("patient_page")


OpenDesk = Callable[..., Desk]


@pytest.fixture
def open_desk(tmp_path: Path, show: Show, qapp: QApplication) -> Iterator[OpenDesk]:
    """Opens the main window on a clinic folder; closes it as the application does."""
    windows: list[MainWindow] = []

    def make(folder: Path | None = None, *, signed_in: bool = True) -> Desk:
        folder = folder or tmp_path / "clinic"
        context = AppContext(
            ClinicStore.open(folder), folder, cameras=NoCameras(), tracker_factory=default_tracker
        )
        window = MainWindow(context)
        windows.append(window)
        show(window, (1440, 900))
        desk = Desk(window, tmp_path / "pictures")
        if signed_in:  # at once; signing in by hand is tested in test_login.py
            context.log_in(context.store.users.list()[0])
            window.login.logged_in.emit()
        return desk

    yield make
    for window in windows:
        window.close()
        context = window.context
        assert context.tasks.shut_down()
        QApplication.processEvents()
        context.store.close()


@pytest.fixture(scope="session")
def small_clinic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clinic with a user and four patients who were never seen."""
    folder = tmp_path_factory.mktemp("small") / "clinic"
    with ClinicStore.open(folder) as store:
        user = store.users.create(USER, DISPLAY_NAME, PASSWORD)
        for draft in (
            PatientDraft("Novák", "Jiří", date(1986, 5, 14), "M", "GD-1042"),
            PatientDraft("Müller", "Jörg", date(1971, 1, 30), "M", "GD-0998"),
            PatientDraft("Åkesson", "Maja", date(1993, 2, 27), "F", "GD-0871"),
            PatientDraft("Fournier", "Rémi", None, "U", ""),
        ):
            store.patients.create(draft, by=user.id)
    return folder


@pytest.fixture
def small_desk(small_clinic: Path, tmp_path: Path, open_desk: OpenDesk) -> Desk:
    """The main window on a copy of the small clinic, signed in."""
    shutil.copytree(small_clinic, tmp_path / "clinic")
    return open_desk()


# --- one simulated patient --------------------------------------------------------------------------------


@dataclass(frozen=True)
class World:
    """Capture folders of one simulated patient, and a clinic whose first visit is closed."""

    root: Path
    captures: dict[str, SimulatedCapture]


@pytest.fixture(scope="session")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    root = tmp_path_factory.mktemp("visit")
    patient = SimulatedPatient("m_young_avg", seed=4, moles=60, freckles=40, rig=make_rig((640, 480)))
    captures: dict[str, SimulatedCapture] = {}
    for name, stance, visit in (("psi", "psi", 1), ("down", "down", 1), ("A1", "A", 1), ("A2", "A", 2)):
        captures[name] = patient.capture(stance, "front", visit, frames=2)
        write_capture(captures[name].capture, root / name)
    empty = replace(
        captures["psi"].capture, depth_frames=np.full_like(captures["psi"].capture.depth_frames, 4000)
    )
    write_capture(empty, root / "empty")
    shutil.copytree(root / "psi", root / "truncated")
    depth = next((root / "truncated").glob("depth*.png"))
    depth.write_bytes(depth.read_bytes()[:200])
    _spoil(root, "sizes", lambda doc: doc["color"]["intrinsics"].update(width=320))
    _spoil(root, "calibration", lambda doc: doc["depth"].pop("intrinsics"))
    _spoil(root, "units", lambda doc: doc["depth"].update(unit_m=1.0))
    cv2.imwrite(str(root / "dermoscopy.png"), np.full((90, 120, 3), 150, np.uint8))
    (root / "holiday.jpg").write_bytes(b"this is no picture")

    with ClinicStore.open(root / "clinic") as store:
        user = store.users.create(USER, DISPLAY_NAME, PASSWORD)
        person = store.patients.create(PatientDraft("Müller", "Jörg"), by=user.id)
        store.patients.create(PatientDraft("Nováková", "Eva"), by=user.id)
        session = VisitSession.begin(store, user.id, person.id, default_tracker)
        session.adopt_stance(session.take_stance(captures["psi"].capture))
        session.fire(Event.GO_CAPTURE)
        session.adopt_working(session.take_working(captures["A1"].capture))
        session.fire(Event.GO_LESIONS)
        for pixel in list(seen(captures["A1"]).values())[:3]:
            session.mark(session.snapshot.views["front"], pixel)
        session.fire(Event.GO_REVIEW)
        session.close()
    return World(root, captures)


def _spoil(root: Path, name: str, change: Callable[[dict[str, Any]], object]) -> None:
    """A copy of the psi capture folder with another capture.json."""
    shutil.copytree(root / "psi", root / name)
    path = root / name / "capture.json"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))


def seen(capture: SimulatedCapture) -> dict[str, tuple[float, float]]:
    """Pixels of the lesions of interest that a capture shows."""
    truth = capture.truth
    return {
        name: (float(u), float(v))
        for name, (u, v), visible in zip(truth.mole_ids, truth.mole_pixels, truth.mole_visible, strict=True)
        if visible and name.startswith("L")
    }
