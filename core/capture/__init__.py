"""Cameras, captures and the capture folder: what devices hand over and how it is kept on disk."""

from core.capture.camera import PinholeCamera
from core.capture.folder import CAPTURE_FORMAT, read_capture, read_visit, write_capture
from core.capture.mirror import unmirror
from core.capture.registration import register_color_to_depth, register_depth_to_color
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform

__all__ = [
    "CAPTURE_FORMAT",
    "CameraRig",
    "PinholeCamera",
    "RgbdCapture",
    "RigidTransform",
    "read_capture",
    "read_visit",
    "register_color_to_depth",
    "register_depth_to_color",
    "unmirror",
    "write_capture",
]
