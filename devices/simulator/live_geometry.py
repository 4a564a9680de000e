"""Sizes of the viewfinder's pictures."""

from __future__ import annotations

from dataclasses import replace

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig

LIVE_COLOR_WIDTH = 640


def resized(camera: PinholeCamera, width: int) -> PinholeCamera:
    """The same camera with its picture enlarged or reduced to another width."""
    if width == camera.width:
        return camera
    share = width / camera.width
    return replace(
        camera,
        width=width,
        height=round(camera.height * share),
        fx=camera.fx * share,
        fy=camera.fy * share,
        cx=(camera.cx + 0.5) * share - 0.5,
        cy=(camera.cy + 0.5) * share - 0.5,
    )


def live_rig_of(rig: CameraRig) -> CameraRig:
    """The rig as the viewfinder has it: the picture is reduced to 640 pixels, a smaller one enlarged."""
    return CameraRig(rig.depth, resized(rig.picture_camera, LIVE_COLOR_WIDTH), rig.picture_from_depth)
