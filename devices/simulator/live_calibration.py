"""A calibration profile on the simulated camera: does it belong there, and what it does to a capture."""

from __future__ import annotations

from dataclasses import replace

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError
from devices.live import CameraIdentity
from devices.simulator.live_geometry import live_rig_of, resized


def check_profile(profile: CalibrationProfile, who: CameraIdentity, rig: CameraRig) -> None:
    """Raise `InputError` if a profile is for other cameras than ``who`` or other sizes than ``rig``'s."""
    if not profile.fits(who.depth_serial, who.color_serial):
        raise InputError(
            f"The calibration belongs to {profile.depth_serial}, not to {who.depth_serial}.",
            "Choose a calibration of this camera, or calibrate it.",
        )
    depth, color = profile.rig.depth, profile.rig.color
    pictures = [(c.width, c.height) for c in (rig.picture_camera, live_rig_of(rig).picture_camera)]
    fitting = color is None or (color.width, color.height) in pictures
    if not fitting or (depth.width, depth.height) != (rig.depth.width, rig.depth.height):
        raise InputError("The calibration was made with other image sizes.", "Calibrate the camera again.")


def calibrated(capture: RgbdCapture, profile: CalibrationProfile) -> RgbdCapture:
    """The capture with the profile's geometry, its depth corrected and the profile kept with it."""
    rig = profile.rig
    color = None if rig.color is None else resized(rig.color, capture.rig.picture_camera.width)
    return replace(
        capture,
        rig=CameraRig(rig.depth, color, rig.color_from_depth),
        depth_frames=profile.depth_correction.apply(capture.depth_frames, capture.depth_unit_m),
        color=capture.color if color is not None else None,
        calibration=profile.document(),
    )
