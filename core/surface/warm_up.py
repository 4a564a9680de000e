"""Compile or load every kernel of this room before the first click."""

from __future__ import annotations

import numpy as np

from core.capture.camera import PinholeCamera
from core.capture.registration import register_color_to_depth
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.surface.picking import pick_skin
from core.surface.scan import scan_body


def warm_up() -> None:
    """Run the whole way from frames to a click once on a small made-up body.

    Takes a minute on a fresh installation, where the kernels are compiled and cached, and a second later on.
    Call it in a background thread.
    """
    camera = PinholeCamera(160, 120, 140.0, 140.0, 79.5, 59.5)
    u, v = np.meshgrid(np.arange(160) - 79.5, np.arange(120) - 59.5)
    inside = np.clip(1.0 - (u / 30.0) ** 2 - (v / 50.0) ** 2, 0.0, None)
    depth = np.where(inside > 0, 1500.0 - 200.0 * np.sqrt(inside), 0.0)
    frames = np.stack([depth, depth + (depth > 0)]).astype(np.uint16)
    color = np.full((120, 160, 3), (200, 150, 130), np.uint8)
    capture = RgbdCapture(frames, 0.001, CameraRig(camera, camera, RigidTransform()), color)
    scan = scan_body(capture)
    pick_skin(scan, (80.0, 60.0))
    scan.surface.nearest(scan.surface.vertices[:1])
    scan.surface.nearest_vertex(scan.surface.vertices[:1])
    scan.surface.vertices_within(scan.surface.vertices[:1], 0.01)
    register_color_to_depth(color, scan.fused.depth_m, capture.rig)
