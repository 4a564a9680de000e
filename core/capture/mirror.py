"""Un-mirroring: a mirrored recording swaps the patient's left and right, so it is mended first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform

_FLIP = np.diag([-1.0, 1.0, 1.0])

# OpenCV's coefficients that are odd in x: p2, s1, s2 and the tilt about the y axis.
_ODD_IN_X = (3, 8, 9, 13)


def mirror_camera(camera: PinholeCamera) -> PinholeCamera:
    """The camera of the left-right flipped image: pixel u becomes ``width - 1 - u``."""
    distortion = tuple(-k if i in _ODD_IN_X else k for i, k in enumerate(camera.distortion))
    return replace(camera, cx=camera.width - 1 - camera.cx, distortion=distortion)


def mirror_transform(transform: RigidTransform) -> RigidTransform:
    """The transform between two frames whose x axes are both reversed."""
    return RigidTransform(_FLIP @ transform.rotation @ _FLIP, _FLIP @ transform.translation)


def unmirror(capture: RgbdCapture) -> RgbdCapture:
    """The capture as a camera that does not mirror would have seen it.

    Images are flipped, principal points and the odd lens coefficients follow, and x changes sign in the
    extrinsics and in recorded joints. Joint names stay: they are the subject's own left and right. A capture
    that is not mirrored is returned as it is.
    """
    if not capture.mirrored:
        return capture
    rig = capture.rig
    flipped_rig = CameraRig(
        mirror_camera(rig.depth),
        mirror_camera(rig.color) if rig.color is not None else None,
        mirror_transform(rig.color_from_depth) if rig.color_from_depth is not None else None,
    )
    joints = capture.joints_m
    return replace(
        capture,
        depth_frames=np.ascontiguousarray(capture.depth_frames[:, :, ::-1]),
        color=None if capture.color is None else np.ascontiguousarray(capture.color[:, ::-1]),
        rig=flipped_rig,
        mirrored=False,
        joints_m=None if joints is None else {name: _FLIP @ p for name, p in joints.items()},
    )
