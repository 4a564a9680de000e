"""The OpenNI2 cameras that the registry knows."""

from __future__ import annotations

from collections.abc import Sequence

from core.errors import WorkError
from devices.camera import DeviceInfo
from devices.openni.live import OpenNICamera
from devices.openni.process import RuntimeProcess
from devices.openni.recording import MAX_STREAM_WIDTH, OniRecording, write_oni

__all__ = [
    "CONNECTED_CAMERAS",
    "MAX_STREAM_WIDTH",
    "OniRecording",
    "OpenNICamera",
    "find_cameras",
    "write_oni",
]

_LIST_TIMEOUT_S = 8.0


def find_cameras() -> list[DeviceInfo]:
    """Cameras that the runtime sees.

    Raises
    ------
    WorkError
        If there is no runtime (the message names the folders it was looked for in), or it does not answer.
    """
    runtime = RuntimeProcess("camera")
    try:
        found: list[tuple[str, str]] = runtime.request("list_devices", timeout_s=_LIST_TIMEOUT_S)
    finally:
        runtime.stop()
    return [DeviceInfo(f"openni:{uri}", name, "openni", True) for uri, name in found]


class _ConnectedCameras:
    """Factory of live cameras."""

    def devices(self) -> Sequence[DeviceInfo]:
        """Cameras that the runtime sees; none if there is no runtime or no camera."""
        try:
            return find_cameras()
        except WorkError:
            return []

    def create(self, address: str) -> OpenNICamera:
        """Camera with the runtime's own address."""
        return OpenNICamera(address)


CONNECTED_CAMERAS = _ConnectedCameras()
