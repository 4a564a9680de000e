"""Which earlier view is laid over the live picture, and its outline."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Slot

from app.tasks import TaskFailure
from app.workflows.analysis import Role
from app.workflows.snapshot import VisitSnapshot

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from app.windows.visit.camera_deck import CameraDeck
    from app.windows.visit.capture_screen import CaptureScreen
    from app.windows.visit.host import VisitHost
    from core.capture.rgbd import CameraRig
    from core.progress import Progress
    from core.records import CaptureRecord, ClinicStore


def ghost_record(snapshot: VisitSnapshot, role: str, view: str) -> CaptureRecord | None:
    """The newest capture of the same role and side of an earlier visit, else of this visit.

    Of this visit only another take of the same view serves: to repeat a capture as it stood.
    """
    earlier = {visit.id for visit in snapshot.earlier}
    same = [c for c in snapshot.captures.values() if c.role == role and c.view == view]
    before = [c for c in same if c.visit_id in earlier]
    return max(before or same, key=lambda c: c.id, default=None)


def ghost_name(snapshot: VisitSnapshot, record: CaptureRecord) -> str:
    """What the outline is called."""
    return "Outline of this visit" if record.visit_id == snapshot.visit.id else "Outline of the last visit"


def ghost_outlines(store: ClinicStore, capture_id: int, rig: CameraRig) -> list[NDArray[np.float64]]:
    """Worker: the outline of a stored capture in the pixels of a live picture.

    Raises
    ------
    GeodermError
        If the capture cannot be read or shows nobody.
    """
    from core.guidance import Ghost

    return list(Ghost.of_capture(store.captures.load(capture_id, frames=1)).outlines(rig))


class GhostLayer(QObject):
    """Lays the outline over the live picture of a screen, found once for each view and camera."""

    def __init__(self, host: VisitHost, deck: CameraDeck, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._host, self._deck = host, deck
        self._screen: CaptureScreen | None = None
        self._key: tuple[object, ...] | None = None

    def forget(self) -> None:
        """Look again next time."""
        self._key = None

    def lay(self, screen: CaptureScreen, role: Role) -> None:
        """Lay the outline of the screen's view, or none if there is none."""
        session, camera = self._host.session, self._deck.camera
        if camera is None or not self._deck.is_live:
            return
        view = "front" if role == "psi" else screen.view
        record = ghost_record(session.snapshot, role, view)
        key = (screen, id(camera), None if record is None else record.id)
        if key == self._key:
            return
        self._key, self._screen = key, screen
        screen.live_view.set_ghost(None)
        screen.controls.offer_ghost("" if record is None else ghost_name(session.snapshot, record))
        if record is None:
            return
        capture_id, store = record.id, session.store

        def work(progress: Progress) -> list[NDArray[np.float64]]:
            return ghost_outlines(store, capture_id, camera.rig)  # type: ignore[attr-defined]

        def laid(outlines: Any) -> None:
            if self._key == key:
                screen.live_view.set_ghost(outlines)
                self.show_opacity()

        def missing(failure: TaskFailure) -> None:
            if self._key == key:
                screen.controls.offer_ghost("")

        task = self._host.context.tasks.start("Drawing the outline", work)
        task.finished.connect(laid)
        task.failed.connect(missing)

    @Slot()
    def show_opacity(self) -> None:
        """Draw the outline as strongly as the slider says."""
        if self._screen is not None:
            self._screen.live_view.set_ghost_opacity(self._screen.controls.ghost_opacity)
