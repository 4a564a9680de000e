"""The cameras of the demonstration: the patient behind the prepared record, and the real devices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.context import RegisteredCameras
from app.demo.clinic import simulated_patient

if TYPE_CHECKING:
    from devices.camera import DepthCamera, DeviceInfo
    from devices.simulator import SimulatedCamera


class DemoCameras(RegisteredCameras):
    """A `CameraSource` that offers the demonstration's patient first."""

    def __init__(self) -> None:
        super().__init__()
        self._camera: SimulatedCamera | None = None

    @property
    def camera(self) -> SimulatedCamera:
        """The demonstration's patient before the camera; the page of a visit says how to stand."""
        if self._camera is None:
            from devices.simulator import SimulatedCamera

            self._camera = SimulatedCamera(simulated_patient())
        return self._camera

    def list(self) -> list[DeviceInfo]:
        """The demonstration's patient, then every other device."""
        own = self.camera.info
        return [own, *(d for d in super().list() if d.id != own.id)]

    def open(self, camera_id: str) -> DepthCamera:
        """The camera with that id."""
        return self.camera if camera_id == self.camera.info.id else super().open(camera_id)
