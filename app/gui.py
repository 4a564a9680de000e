"""Starts the application: the window first, on Qt alone; everything heavy once it is painted."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from app.lasting_none import keep_none
from app.logs import start_logging
from app.paths import default_data_dir
from app.windows.start_window import StartWindow

if TYPE_CHECKING:
    from app.context import AppContext, CameraSource
    from app.windows.main_window import MainWindow
    from core.records import ClinicStore


_CALM_MS = 200
"""From the first paint to the loading of heavy libraries: what was painted reaches the screen first."""


_loading: list[threading.Thread] = []


def application() -> QApplication:
    """The Qt application in the house style."""
    from app.theme import apply_theme

    keep_none()
    existing = QApplication.instance()
    app = existing if isinstance(existing, QApplication) else QApplication(sys.argv[:1])
    app.setApplicationName("GeoDerm")
    apply_theme(app)
    return app


def open_clinic(
    data_dir: Path, *, cameras: CameraSource | None = None, demonstration: bool = False
) -> AppContext:
    """Open the records of a clinic for the windows."""
    from app.context import AppContext
    from core.records import ClinicStore

    return AppContext(ClinicStore.open(data_dir), data_dir, cameras=cameras, demonstration=demonstration)


def open_window(context: AppContext) -> MainWindow:
    """Make the main window of a clinic, and have heavy libraries loaded once it is painted."""
    from app.tasks import install_excepthook
    from app.windows.main_window import MainWindow

    window = MainWindow(context)
    install_excepthook(window.tell_failure)
    context.tasks.unhandled.connect(window.tell_failure)
    window.ready.connect(lambda: QTimer.singleShot(_CALM_MS, _load_heavy_things))
    return window


def _load_heavy_things() -> None:
    """Load 3D libraries and compiled kernels in the background: no click waits for them later."""
    from app.widgets.body_backend import body_backend

    body_backend().load()
    kernels = threading.Thread(target=_warm_up, name="kernels", daemon=True)
    _loading.append(kernels)
    kernels.start()


def _await_heavy_things() -> None:
    """Let what loads in the background end: native code that the end of the process interrupts aborts it."""
    from app.widgets.body_backend import body_backend

    for thread in _loading:
        thread.join()
    body_backend().join()


def _warm_up() -> None:
    from core.warm_up import warm_up

    warm_up()


def run_gui(
    data_dir: Path | None = None,
    *,
    cameras: CameraSource | None = None,
    demonstration: bool = False,
    when_open: Callable[[MainWindow], None] | None = None,
) -> int:
    """Run the application until its window is closed; return the exit code.

    A start window is painted at once; the main window takes its place when the records are open.

    Parameters
    ----------
    data_dir : Path, optional
        The clinic's folder.
    cameras : CameraSource, optional
    demonstration : bool
    when_open : callable, optional
        Called with the main window once it is shown.

    Raises
    ------
    GeodermError
        If the records cannot be opened: after the user has read it in the start window and closed that.
    """
    start_logging()
    app = application()
    start = StartWindow(lambda: _open_records(data_dir or default_data_dir()))
    opened: list[tuple[AppContext, MainWindow]] = []

    def show_clinic(store: ClinicStore) -> None:
        from app.context import AppContext

        context = AppContext(
            store, data_dir or default_data_dir(), cameras=cameras, demonstration=demonstration
        )
        window = open_window(context)
        opened.append((context, window))
        window.setGeometry(start.geometry())
        window.show()
        start.close()
        if when_open is not None:
            QTimer.singleShot(0, lambda: when_open(window))

    start.opened.connect(show_clinic)
    start.begin()
    try:
        code = app.exec()
    finally:
        for context, _ in opened:
            context.close()
        unused = start.abandon()
        if unused is not None:
            unused.close()
        start.deleteLater()
        _await_heavy_things()
    if start.error is not None:
        raise start.error
    return code


def _open_records(data_dir: Path) -> ClinicStore:
    from core.records import ClinicStore

    return ClinicStore.open(data_dir)
