"""Sizes of the viewfinder's pictures."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from devices.camera import PreviewFrame
from devices.live import LiveFrame

LIVE_COLOR_WIDTH = 640
_PREVIEW_WIDTH = 320


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


def made_small(frame: LiveFrame) -> PreviewFrame:
    """Half the depth image, and the picture 320 pixels wide."""
    depth = rgb = None
    if frame.depth is not None:
        depth = frame.depth[::2, ::2].astype(np.float32) * np.float32(frame.depth_unit_m)
    if frame.rgb is not None:
        height = round(frame.rgb.shape[0] * _PREVIEW_WIDTH / frame.rgb.shape[1])
        small = cv2.resize(frame.rgb, (_PREVIEW_WIDTH, height), interpolation=cv2.INTER_AREA)
        rgb = np.asarray(small, np.uint8)
    return PreviewFrame(depth, rgb)
