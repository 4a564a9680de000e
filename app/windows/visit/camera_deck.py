"""The camera of a visit: chosen, opened and looked through without ever holding up the window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal, Slot

from app.live import LiveService, LiveStatus
from app.tasks import TaskFailure
from app.workflows.analysis import PosablePatient, camera_id_of_path
from core.errors import GeodermError

if TYPE_CHECKING:
    from app.context import AppContext
    from core.progress import Progress
    from devices.camera import DepthCamera, DeviceInfo
    from devices.live import LiveCamera

SIMULATED = "Not calibrated: a simulated camera knows its geometry."
NOT_CALIBRATED = "Not calibrated: places on the skin may be off by a centimetre. Calibrate the camera."


_NO_PATIENTS = ("simulator-board:", "simulator-hand:")
"""Simulated cameras that show something else."""


class CameraDeck(QObject):
    """Holds at most one open camera, and the live service that looks through it.

    Signals
    -------
    changed()
        Another camera is in use, is being opened, or none is.
    failed(object)
        A `TaskFailure`: the camera could not be opened, or its picture could not be read.
    status_changed(object)
        A `LiveStatus`: the camera delivers pictures, has stalled, is gone.
    came_back()
        The camera that was gone is open again.
    """

    changed = Signal()
    failed = Signal(object)
    status_changed = Signal(object)
    came_back = Signal()

    def __init__(self, context: AppContext, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._context = context
        self._camera: DepthCamera | None = None
        self._wanted = ""
        self._calibration = ""
        self._stands: tuple[str | None, str | None, int | None] = (None, None, None)
        self.live = LiveService(self)
        self.live.failed.connect(self.failed)
        self.live.status_changed.connect(self.status_changed)
        self.live.reconnected.connect(self._on_reconnected)
        context.tasks.busy_changed.connect(self.live.rest)

    @property
    def camera(self) -> DepthCamera | None:
        """The open camera, or None while there is none."""
        return self._camera

    @property
    def camera_id(self) -> str:
        """Id of the camera chosen, open or being opened."""
        return self._wanted

    @property
    def status(self) -> LiveStatus:
        """How the camera is."""
        return self.live.status

    @property
    def ready(self) -> bool:
        """Whether a capture can be taken."""
        return self._camera is not None and self.status.kind not in ("stalled", "gone")

    @property
    def is_live(self) -> bool:
        """Whether the camera sees the present."""
        return self.live.is_live

    @property
    def is_simulator(self) -> bool:
        """Whether the patient is simulated and can be told how to stand."""
        return isinstance(self._camera, PosablePatient)

    @property
    def kind(self) -> str:
        """Kind of the open camera; empty while there is none."""
        return "" if self._camera is None else self._camera.info.kind

    @property
    def calibration(self) -> str:
        """Which calibration is in use, in words; empty for cameras that do not see the present."""
        return self._calibration

    def choices(self) -> list[DeviceInfo]:
        """Cameras that a patient can stand before now."""
        return [info for info in self._context.cameras.list() if not info.id.startswith(_NO_PATIENTS)]

    def choose_path(self, path: Path) -> None:
        """Use a capture folder or an .oni recording."""
        self.choose(camera_id_of_path(path))

    def choose(self, camera_id: str) -> None:
        """Close the camera in use and open another; `changed` or `failed` follows."""
        if camera_id == self._wanted and self._camera is not None:
            return
        self._release()
        self._wanted = camera_id

        def work(progress: Progress) -> DepthCamera:
            return self._context.open_camera(camera_id)

        task = self._context.tasks.start("Opening the camera", work)
        task.finished.connect(lambda camera, wanted=camera_id: self._opened(camera, wanted))
        task.failed.connect(self._on_failed)
        self.changed.emit()

    def _opened(self, camera: DepthCamera, wanted: str) -> None:
        if wanted != self._wanted:
            camera.close()
            return
        if camera.info.kind not in ("folder", "recording"):
            self._context.change_settings(camera_id=wanted)
        self._use(camera)
        self.live.set_camera(camera, lambda: self._context.open_camera(wanted))
        self.changed.emit()

    def _use(self, camera: DepthCamera) -> None:
        from devices.live import LiveCamera

        self._camera = camera
        self._calibration = _calibration_text(camera) if isinstance(camera, LiveCamera) else ""
        self.stand(*self._stands)

    @Slot(object)
    def _on_reconnected(self, camera: DepthCamera) -> None:
        self._use(camera)
        self.changed.emit()
        self.came_back.emit()

    @Slot(object)
    def _on_failed(self, failure: TaskFailure) -> None:
        self._wanted = ""
        self.changed.emit()
        self.failed.emit(failure)

    def stand(self, stance: str | None, view: str | None, visit: int | None) -> None:
        """Tell a simulated patient how to stand (remembered until one is there); real people are asked."""
        self._stands = (stance, view, visit)
        if isinstance(self._camera, PosablePatient):
            self._camera.stand(stance, view, visit)

    def look(self, on: bool) -> None:
        """Begin or end looking through the camera."""
        self.live.look(on)

    def _release(self) -> None:
        """Let go of the camera; it is closed in the background."""
        camera, self._camera, self._wanted, self._calibration = self._camera, None, "", ""
        self.live.set_camera(None)
        if camera is not None:
            self._context.tasks.start(
                "Closing the camera", lambda progress: camera.close(), quiet=True, cancellable=False
            )

    def close(self) -> None:
        """Release the camera and end the live threads, for good; both are over when this returns."""
        self.live.close()
        camera, self._camera, self._wanted = self._camera, None, ""
        if camera is not None:
            camera.close()


def _calibration_text(camera: LiveCamera) -> str:
    try:
        profile = camera.profile
    except GeodermError:
        return ""
    if profile is None:
        return SIMULATED if camera.info.kind == "simulator" else NOT_CALIBRATED
    made = profile.made_at.astimezone().strftime("%d %B %Y").lstrip("0")
    return f"Calibrated on {made} (version {profile.version})."
