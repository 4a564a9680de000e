"""Starts the application: the window first, on Qt alone; everything heavy once it is painted."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from app.logs import start_logging
from app.paths import default_data_dir

if TYPE_CHECKING:
    from app.context import AppContext, CameraSource
    from app.windows.main_window import MainWindow


def application() -> QApplication:
    """The Qt application in the house style."""
    from app.theme import apply_theme

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
    QTimer.singleShot(300, _load_heavy_things)
    return window


def _load_heavy_things() -> None:
    """Load 3D libraries and compiled kernels in the background: no click waits for them later."""
    from app.widgets.body_backend import body_backend

    body_backend().load()
    threading.Thread(target=_warm_up, name="kernels", daemon=True).start()


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

    Parameters
    ----------
    data_dir : Path, optional
        The clinic's folder.
    cameras : CameraSource, optional
    demonstration : bool
    when_open : callable, optional
        Called with the window once it is shown.
    """
    start_logging()
    app = application()
    context = open_clinic(data_dir or default_data_dir(), cameras=cameras, demonstration=demonstration)
    try:
        window = open_window(context)
        window.show()
        if when_open is not None:
            QTimer.singleShot(0, lambda: when_open(window))
        code = app.exec()
    finally:
        context.close()
    return code
