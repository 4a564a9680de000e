"""The cameras that could be calibrated, and how each of them stands."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from core.errors import GeodermError
from core.progress import Progress

if TYPE_CHECKING:
    from app.context import CameraSource
    from app.windows.calibration.last_checks import LastCheck
    from core.calibration.profile import CalibrationProfile, ProfileStore
    from devices.camera import DeviceInfo
    from devices.live import CameraIdentity


_LOGGER = logging.getLogger("geoderm.cameras")


@dataclass(frozen=True, eq=False)
class KnownCamera:
    """A camera in the list.

    Attributes
    ----------
    info : DeviceInfo
    identity : CameraIdentity or None
        None if it could not be asked.
    profile : CalibrationProfile or None
        The newest calibration of this rig.
    problem : str
        Why it cannot be used now, empty if it can.
    """

    info: DeviceInfo
    identity: CameraIdentity | None
    profile: CalibrationProfile | None
    problem: str = ""


def calibratable(devices: Sequence[DeviceInfo]) -> list[DeviceInfo]:
    """Live cameras other than simulated patients, whose geometry is known exactly."""
    return [d for d in devices if d.live and not d.id.startswith(("simulator:", "simulator-hand:"))]


def _listed(source: CameraSource, progress: Progress) -> list[DeviceInfo]:
    """What is connected now. The registry is asked itself: its `CameraSource` tells what was there before."""
    from app.context import RegisteredCameras
    from devices.registry import camera_kinds, list_devices

    if not isinstance(source, RegisteredCameras):
        return calibratable(source.list())
    found: list[DeviceInfo] = []
    kinds = camera_kinds()
    for k, kind in enumerate(kinds):
        progress(0.5 * k / len(kinds), "Looking for cameras")
        try:
            found += list_devices(kind)
        except GeodermError as error:
            _LOGGER.warning("Cameras of kind %s could not be listed: %s", kind, error.message)
    return calibratable(found)


def ask_cameras(source: CameraSource, store: ProfileStore, progress: Progress) -> list[KnownCamera]:
    """Open each camera for a moment and ask who it is."""
    from devices.live import LiveCamera

    found = _listed(source, progress)
    known = []
    for k, info in enumerate(found):
        progress(0.5 + 0.5 * k / len(found), f"Asking {info.name}")
        try:
            camera = source.open(info.id)
            with camera:
                if not isinstance(camera, LiveCamera):
                    continue
                who = camera.identity
                profile = store.newest(who.depth_serial, who.color_serial)
                known.append(KnownCamera(info, who, profile))
        except GeodermError as error:
            known.append(KnownCamera(info, None, None, str(error)))
    return known


def state_in_words(camera: KnownCamera, last: LastCheck | None = None) -> str:
    """Its calibration in a few words; ``last`` is the last daily check of it."""
    if camera.problem:
        return "Cannot be opened"
    if camera.profile is None:
        return "Not calibrated"
    made = camera.profile.made_at.astimezone()
    words = f"Version {camera.profile.version} of {made:%d %b %Y}"
    return f"{words}, rig was moved" if last is not None and last.verdict == "moved" else words
