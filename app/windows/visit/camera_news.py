"""What the banner of a visit says about its camera: it failed, stopped, is gone, is back."""

from __future__ import annotations

from PySide6.QtCore import QObject, Slot

from app.live import LiveStatus
from app.tasks import TaskFailure
from app.windows.visit.camera_deck import CameraDeck
from app.windows.visit.host import VisitHost


class CameraNews(QObject):
    """Tells the user; changes nothing else."""

    def __init__(self, host: VisitHost, deck: CameraDeck, parent: QObject) -> None:
        super().__init__(parent)
        self._host, self._deck = host, deck
        self._warned = False
        deck.failed.connect(self._on_failed)
        deck.status_changed.connect(self._on_status)
        deck.came_back.connect(self._on_came_back)

    @Slot(object)
    def _on_failed(self, failure: TaskFailure) -> None:
        self._host.banner.show_error(
            failure.message, failure.advice or "Choose another camera, capture folder or recording."
        )

    @Slot(object)
    def _on_status(self, status: LiveStatus) -> None:
        if status.kind in ("stalled", "gone"):
            self._warned = True
            self._host.banner.show_error(status.message, status.advice)
        elif status.kind == "streaming" and self._warned:
            self._on_came_back()
        elif self._warned and self._deck.camera is None:  # another one was chosen instead
            self._warned = False
            self._host.banner.clear()

    @Slot()
    def _on_came_back(self) -> None:
        if self._warned:
            self._warned = False
            self._host.banner.show_success("The camera is back.", "Everything of the visit is still here.")
