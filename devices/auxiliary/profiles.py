"""Whether a calibration profile may be used for a running camera."""

from __future__ import annotations

from core.calibration.profile import CalibrationProfile
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.errors import InputError
from devices.live import CameraIdentity


def check_profile(profile: CalibrationProfile, identity: CameraIdentity, rig: CameraRig) -> None:
    """Refuse a profile of other cameras or other image sizes.

    Raises
    ------
    InputError
        Saying which.
    """
    if not profile.fits(identity.depth_serial, identity.color_serial):
        raise InputError(
            "The calibration belongs to other cameras than those that are connected.",
            "Calibrate this rig, or connect the cameras it was made with.",
        )
    if not fits_sizes(profile, rig):
        raise InputError(
            "The calibration is for other image sizes than the cameras deliver now.",
            "Choose the modes it was made with, or calibrate again.",
        )


def fits_sizes(profile: CalibrationProfile, rig: CameraRig) -> bool:
    """Whether the profile is for the image sizes of this rig."""
    return _size(profile.rig.depth) == _size(rig.depth) and _size(profile.rig.color) == _size(rig.color)


def _size(camera: PinholeCamera | None) -> tuple[int, int] | None:
    return None if camera is None else (camera.width, camera.height)
