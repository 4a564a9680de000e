"""The camera of a visit: chosen, opened and asked for preview pictures without ever holding up the window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.tasks import TaskFailure
from app.workflows.analysis import PosablePatient, camera_id_of_path
from core.progress import Progress

if TYPE_CHECKING:
    from app.context import AppContext
    from devices.camera import DepthCamera, DeviceInfo

_PREVIEW_INTERVAL_MS = 150


class CameraDeck(QObject):
    """Holds at most one open camera.

    Signals
    -------
    changed()
        Another camera is in use, is being opened, or none is.
    failed(object)
        A `TaskFailure`: the camera could not be opened, or its preview broke off.
    frame(object)
        A `PreviewFrame`.
    """

    changed = Signal()
    failed = Signal(object)
    frame = Signal(object)

    def __init__(self, context: AppContext, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._context = context
        self._camera: DepthCamera | None = None
        self._wanted = ""
        self._stands: tuple[str | None, str | None, int | None] = (None, None, None)
        self._looking = False
        self._rendering = False
        self._timer = QTimer(self, interval=_PREVIEW_INTERVAL_MS, singleShot=True)
        self._timer.timeout.connect(self._render)

    @property
    def camera(self) -> DepthCamera | None:
        """The open camera, or None while there is none."""
        return self._camera

    @property
    def camera_id(self) -> str:
        """Id of the camera chosen, open or being opened."""
        return self._wanted

    @property
    def is_simulator(self) -> bool:
        """Whether the patient is simulated and can be told how to stand."""
        return isinstance(self._camera, PosablePatient)

    @property
    def kind(self) -> str:
        """Kind of the open camera; empty while there is none."""
        return "" if self._camera is None else self._camera.info.kind

    def choices(self) -> list[DeviceInfo]:
        """Cameras that could be opened now."""
        return self._context.cameras.list()

    def choose_path(self, path: Path) -> None:
        """Use a capture folder or an .oni recording."""
        self.choose(camera_id_of_path(path))

    def choose(self, camera_id: str) -> None:
        """Close the camera in use and open another; `changed` or `failed` follows."""
        if camera_id == self._wanted and self._camera is not None:
            return
        self.close()
        self._wanted = camera_id
        opener = self._open_path if camera_id.startswith(("folder:", "recording:")) else self._open_listed

        def work(progress: Progress) -> DepthCamera:
            camera = opener(camera_id)
            camera.open()
            return camera

        task = self._context.tasks.start("Opening the camera", work)
        task.finished.connect(lambda camera, wanted=camera_id: self._opened(camera, wanted))
        task.failed.connect(self._on_failed)
        self.changed.emit()

    def _open_listed(self, camera_id: str) -> DepthCamera:
        return self._context.cameras.open(camera_id)

    @staticmethod
    def _open_path(camera_id: str) -> DepthCamera:
        from devices.registry import open_device

        return open_device(camera_id)

    def _opened(self, camera: DepthCamera, wanted: str) -> None:
        if wanted != self._wanted:
            camera.close()
            return
        self._camera = camera
        if camera.info.kind not in ("folder", "recording"):
            self._context.change_settings(camera_id=wanted)
        self.stand(*self._stands)
        self.changed.emit()

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
        self._render()

    def look(self, on: bool) -> None:
        """Begin or end the preview."""
        self._looking = on
        if on:
            self._render()
        else:
            self._timer.stop()

    @Slot()
    def _render(self) -> None:
        """Ask for one picture in the worker: a simulated patient is drawn, a device is read."""
        camera = self._camera
        if camera is None or self._rendering or not self._looking:
            return
        self._timer.stop()
        if self._context.tasks.busy:
            self._timer.start()
            return
        self._rendering = True
        task = self._context.tasks.start("Looking through the camera", lambda progress: camera.preview())
        task.finished.connect(lambda frame, of=camera: self._show(frame, of))
        task.failed.connect(self.failed)
        task.ended.connect(self._rendered)

    @Slot()
    def _rendered(self) -> None:
        self._rendering = False

    def _show(self, frame: object, camera: DepthCamera) -> None:
        if not self._looking or camera is not self._camera:
            return
        if frame is not None:
            self.frame.emit(frame)
        if camera.info.live:
            self._timer.start()

    def close(self) -> None:
        """Release the camera."""
        self._timer.stop()
        camera, self._camera, self._wanted = self._camera, None, ""
        if camera is not None:
            self._context.tasks.start(
                "Closing the camera", lambda progress: camera.close(), quiet=True, cancellable=False
            )
