"""Which cameras there are. A new kind of camera is one file with a `CameraFactory` plus one registration."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Protocol, cast

from core.calibration.profile import ProfileStore
from core.errors import InputError
from devices.camera import DepthCamera, DeviceInfo
from devices.live import LiveCamera


class CameraFactory(Protocol):
    """Finds and opens the cameras of one kind."""

    def devices(self) -> Sequence[DeviceInfo]:
        """Cameras of this kind that are there now. Without driver or hardware: none, and no error."""

    def create(self, address: str) -> DepthCamera:
        """Return the camera at ``address`` (what follows ``kind:`` in its id), not opened yet.

        Raises
        ------
        InputError
            If there can be no such camera.
        """


_factories: dict[str, CameraFactory | str] = {}


def register_camera(kind: str, factory: CameraFactory | str) -> None:
    """Make a kind of camera known.

    Parameters
    ----------
    kind : str
        First part of the ids of its devices.
    factory : CameraFactory or str
        The factory, or ``"package.module:attribute"`` of it, which is imported when first needed.
    """
    if not kind or ":" in kind:
        raise ValueError("A kind of camera needs a name without a colon.")
    _factories[kind] = factory


def camera_kinds() -> list[str]:
    """Names of the registered kinds."""
    return list(_factories)


def camera_factory(kind: str) -> CameraFactory:
    """Return the factory of a registered kind, imported now if it was not yet."""
    factory = _factories.get(kind)
    if factory is None:
        known = ", ".join(camera_kinds())
        raise InputError(f"There is no kind of camera called '{kind}'.", f"Choose one of: {known}.")
    if isinstance(factory, str):
        module, _, attribute = factory.partition(":")
        factory = cast(CameraFactory, getattr(import_module(module), attribute))
        _factories[kind] = factory
    return factory


def list_devices(kind: str | None = None) -> list[DeviceInfo]:
    """Cameras that can be opened now, of one kind or of all."""
    kinds = camera_kinds() if kind is None else [kind]
    return [info for k in kinds for info in camera_factory(k).devices()]


def open_device(device_id: str, profiles: ProfileStore | None = None) -> DepthCamera:
    """Return the opened camera with this id (``kind:address``).

    Parameters
    ----------
    device_id : str
    profiles : ProfileStore, optional
        A live camera uses the newest calibration profile of its serial numbers.

    Raises
    ------
    InputError
        If the id names no camera that can exist.
    WorkError
        If the camera cannot be opened.
    """
    kind, colon, address = device_id.partition(":")
    if not colon:
        raise InputError(
            f"'{device_id}' is not a camera.", "Write kind:address, such as simulator:m_young_avg."
        )
    camera = camera_factory(kind).create(address)
    camera.open()
    if profiles is not None and isinstance(camera, LiveCamera):
        profile = profiles.newest(camera.identity.depth_serial, camera.identity.color_serial)
        if profile is not None:
            camera.use_profile(profile)
    return camera


register_camera("simulator", "devices.simulator.live_address:SIMULATED_CAMERAS")
register_camera("simulator-board", "devices.simulator.board_device:BOARD_CAMERAS")
register_camera("simulator-hand", "devices.simulator.hand_device:SIMULATED_HANDS")
register_camera("openni", "devices.openni.cameras:CONNECTED_CAMERAS")
register_camera("recording", "devices.recordings.cameras:RECORDINGS")
register_camera("folder", "devices.folders:FOLDERS")
register_camera("realsense", "devices.realsense.camera:REALSENSE_CAMERAS")
register_camera("realsense-bag", "devices.realsense.recording:REALSENSE_RECORDINGS")
register_camera("rig", "devices.auxiliary.rig:RIGS")
