"""Loads the 3D libraries (seconds) in a thread of its own, so that no window waits for them."""

from __future__ import annotations

import importlib
import os
import threading

from PySide6.QtCore import QObject, Qt, Signal, Slot

_MODULE = "app.widgets.body_scene"


class BodyBackend(QObject):
    """Signals ``loaded()`` in the GUI thread when the 3D view can be built."""

    loaded = Signal()
    _imported = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._thread: threading.Thread | None = None
        self.ready = False
        self._imported.connect(self._on_imported, Qt.ConnectionType.QueuedConnection)

    def load(self) -> None:
        """Start loading; harmless to call again."""
        if self._thread is None:
            os.environ.setdefault("QT_API", "pyside6")
            self._thread = threading.Thread(target=self._import, name="3d-libraries", daemon=True)
            self._thread.start()

    def join(self) -> None:
        """Wait until loading has ended, if it was started; for the end of the application."""
        if self._thread is not None:
            self._thread.join()

    def _import(self) -> None:
        importlib.import_module(_MODULE)
        self._imported.emit()

    @Slot()
    def _on_imported(self) -> None:
        self.ready = True
        self.loaded.emit()


_backend: BodyBackend | None = None


def body_backend() -> BodyBackend:
    """The one loader of the application (needs a QApplication)."""
    global _backend
    if _backend is None:
        _backend = BodyBackend()
    return _backend
