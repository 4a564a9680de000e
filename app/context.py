"""What every window is given: the clinic's store, the user, the task runner, settings, cameras, the tracker.

Public API
----------
``context.store``            `core.records.ClinicStore`
``context.user``             the `User` logged in, or None; ``context.user_id`` raises if nobody is
``context.tasks``            `app.tasks.TaskRunner`
``context.settings``         `app.settings.Settings` (frozen); ``context.change_settings(privacy_mode=True)``
``context.privacy_mode``     names are hidden; use ``context.patient_title(patient)`` wherever a name is shown
``context.demonstration``    True on the demonstration clinic
``context.cameras``          `CameraSource`: ``.list() -> list[DeviceInfo]``, ``.open(id) -> DepthCamera``
``context.open_camera(id)``  the opened camera with its newest calibration (slow: call it in a task)
``context.profiles``         `core.calibration.profile.ProfileStore` of this workstation
``context.tracker()``        the `core.anchors.SkeletonTracker` (slow on first use: call it in a task)
``context.method``           the relocation method's name, or None for the default

Signals: ``user_changed()``, ``privacy_changed(bool)``, ``records_changed(int)`` (patient id; emit it with
``context.touch(patient_id)`` after every change to the store so that the other pages refresh).
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from PySide6.QtCore import QObject, Signal

from app.lasting_none import keep_none
from app.paths import calibration_dir
from app.settings import Settings, read_settings, write_settings
from app.tasks import TaskRunner
from core.errors import GeodermError, WorkError

if TYPE_CHECKING:
    from core.anchors import SkeletonTracker
    from core.calibration.profile import ProfileStore
    from core.records import ClinicStore, Patient, User
    from devices.camera import DepthCamera, DeviceInfo


_LOGGER = logging.getLogger(__name__)

_QUICK_KINDS = ("simulator", "simulator-board", "simulator-hand", "folder", "recording")
"""Kinds that are listed without asking any driver."""

_FILE_KINDS = ("folder", "recording")


class CameraSource(Protocol):
    """Where cameras come from: the device registry, or the demonstration's scripted patient."""

    def list(self) -> list[DeviceInfo]:
        """Every camera that could be opened now."""

    def open(self, camera_id: str) -> DepthCamera:
        """The camera with that id, not yet opened (it is a context manager)."""


class RegisteredCameras:
    """The cameras of `devices.registry`.

    Asking a driver what is connected starts a process and may take seconds: it is done in the background, and
    `list` tells what was found last.
    """

    def __init__(self) -> None:
        self._connected: list[DeviceInfo] = []
        self._looking: threading.Thread | None = None

    def look(self) -> None:
        """Look for connected cameras in the background."""
        if self._looking is None or not self._looking.is_alive():
            self._looking = threading.Thread(target=self._look, name="connected-cameras", daemon=True)
            self._looking.start()

    def _look(self) -> None:
        from devices.registry import camera_kinds, list_devices

        found: list[DeviceInfo] = []
        for kind in camera_kinds():
            if kind in _QUICK_KINDS:
                continue
            try:
                found += list_devices(kind)
            except GeodermError as error:
                _LOGGER.warning("Cameras of kind %s could not be listed: %s", kind, error.message)
        self._connected = found

    def list(self) -> list[DeviceInfo]:
        """Every camera that could be opened, connected ones as last seen."""
        from devices.registry import camera_kinds, list_devices

        self.look()
        quick = [d for kind in camera_kinds() if kind in _QUICK_KINDS for d in list_devices(kind)]
        return [*self._connected, *quick]

    def open(self, camera_id: str) -> DepthCamera:
        """The camera with that id."""
        from devices.registry import open_device

        return open_device(camera_id)


def _default_tracker() -> SkeletonTracker:
    from devices.trackers import default_tracker

    return default_tracker()


class AppContext(QObject):
    """One per running application; handed to every page.

    Parameters
    ----------
    store : ClinicStore
    data_dir : Path
        The clinic's folder; the settings live there too.
    cameras : CameraSource, optional
        Default: the device registry.
    tracker_factory : callable, optional
        Default: `devices.trackers.default_tracker`.
    demonstration : bool
        Marks the window as showing a simulated patient.
    method : str, optional
        Relocation method; None for the default of `core.relocation`.
    """

    user_changed = Signal()
    privacy_changed = Signal(bool)
    records_changed = Signal(int)

    def __init__(
        self,
        store: ClinicStore,
        data_dir: Path,
        *,
        cameras: CameraSource | None = None,
        tracker_factory: Callable[[], SkeletonTracker] | None = None,
        demonstration: bool = False,
        method: str | None = None,
        parent: QObject | None = None,
    ) -> None:
        keep_none()
        super().__init__(parent)
        self.store = store
        self.data_dir = data_dir
        self.cameras: CameraSource = cameras or RegisteredCameras()
        self.demonstration = demonstration
        self.method = method
        self.tasks = TaskRunner(self)
        self.settings: Settings = read_settings(data_dir)
        self._user: User | None = None
        self._tracker_factory = tracker_factory or _default_tracker
        self._tracker: SkeletonTracker | None = None

    @property
    def user(self) -> User | None:
        """Who is logged in."""
        return self._user

    @property
    def user_id(self) -> int:
        """Id of who is logged in.

        Raises
        ------
        WorkError
            If nobody is.
        """
        if self._user is None:
            raise WorkError("Nobody is logged in.", "Log in and try again.")
        return self._user.id

    def log_in(self, user: User) -> None:
        """Make ``user`` the one whose name is stored with every change."""
        self._user = user
        self.change_settings(last_username=user.username)
        self.user_changed.emit()

    def log_out(self) -> None:
        """Forget the user."""
        self._user = None
        self.user_changed.emit()

    @property
    def privacy_mode(self) -> bool:
        """Whether names are hidden."""
        return self.settings.privacy_mode

    def set_privacy_mode(self, on: bool) -> None:
        """Hide or show names in every window."""
        if on != self.settings.privacy_mode:
            self.change_settings(privacy_mode=on)
            self.privacy_changed.emit(on)

    def patient_title(self, patient: Patient) -> str:
        """The patient's name, or only the clinic number in privacy mode."""
        if self.privacy_mode:
            return f"Patient {patient.clinic_number}" if patient.clinic_number else f"Patient #{patient.id}"
        return f"{patient.family_name}, {patient.given_name}".strip(", ")

    def change_settings(self, **changes: Any) -> None:
        """Change and store settings."""
        self.settings = self.settings.with_(**changes)
        write_settings(self.data_dir, self.settings)

    def touch(self, patient_id: int) -> None:
        """Tell every page that the patient's records have changed."""
        self.records_changed.emit(patient_id)

    @property
    def profiles(self) -> ProfileStore:
        """Calibration profiles of the rigs of this workstation."""
        from core.calibration.profile import ProfileStore

        return ProfileStore(calibration_dir(self.data_dir))

    def open_camera(self, camera_id: str) -> DepthCamera:
        """The opened camera with that id; a live one with the newest calibration profile of its rig.

        May take seconds, and may be called in any thread.

        Raises
        ------
        GeodermError
            If there is no such camera, or it cannot be opened.
        """
        from devices.live import LiveCamera
        from devices.registry import open_device

        kind = camera_id.partition(":")[0]
        camera = open_device(camera_id) if kind in _FILE_KINDS else self.cameras.open(camera_id)
        camera.open()
        if isinstance(camera, LiveCamera):
            identity = camera.identity
            profile = self.profiles.newest(identity.depth_serial, identity.color_serial)
            if profile is not None:
                camera.use_profile(profile)
        return camera

    def tracker(self) -> SkeletonTracker:
        """The skeleton tracker, made on first use (seconds: call it in a task)."""
        if self._tracker is None:
            self._tracker = self._tracker_factory()
        return self._tracker

    def close(self) -> None:
        """End the tasks, the tracker and the store. Call it once, when the last window is gone."""
        self.tasks.shut_down()
        if self._tracker is not None:
            self._tracker.close()
            self._tracker = None
        self.store.close()
