"""One depth frame of one stance, analysed as the thesis did: raw depth, joints moved to the nearest skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from core.anchors import AnalysedCapture, Joint, Skeleton, SkeletonTracker, find_skeleton, with_skeleton
from core.capture.rgbd import RgbdCapture
from core.errors import WorkError
from core.evaluation.thesis.clicks import Pixel
from core.evaluation.thesis.sequences import ClickedCapture
from core.surface import BodyScan, BodySurface, pick_skin, scan_body

SurfaceKind = Literal["raw", "smoothed"]
"""Raw depth as the thesis used it, or smoothed by the application's plane fit."""

JUMP_M = 0.05
"""Depth difference that cuts the raw surface: neighbours of one raw frame differ by three times its noise,
up to 30 mm at 2.3 m, and the thesis's graph joins them up to this."""


def single_frame(capture: RgbdCapture) -> RgbdCapture:
    """The capture with its first depth frame alone."""
    return replace(capture, depth_frames=capture.depth_frames[:1])


def raw_scan(scan: BodyScan) -> BodyScan:
    """The scan with a surface of depth as it was measured."""
    depth = np.where(scan.mask.mask, scan.fused.depth_m, 0.0)
    return replace(scan, surface=BodySurface.from_depth(depth, scan.capture.rig.depth, jump_m=JUMP_M))


def analyse_frame(
    clicked: ClickedCapture, tracker: SkeletonTracker, kind: SurfaceKind = "raw"
) -> AnalysedCapture:
    """Body, joints and anchors of the first depth frame of a capture.

    Joints are found by the tracker (or stored with the capture); those that were clicked replace them.

    Raises
    ------
    WorkError
        If there is no body, or fewer than four joints.
    """
    scan = scan_body(single_frame(clicked.capture))
    placed = clicked_joints(scan, clicked.clicks.joints)
    try:
        skeleton = find_skeleton(scan, tracker)
    except WorkError:
        if len(placed) < 4:
            raise
        skeleton = Skeleton({}, source="hand")
    for joint in placed:
        skeleton = skeleton.with_joint(joint)
    return with_skeleton(raw_scan(scan) if kind == "raw" else scan, skeleton)


def clicked_joints(scan: BodyScan, clicks: Mapping[str, Pixel]) -> list[Joint]:
    """Joints on the skin under clicks; a click that misses the body is left out."""
    joints = []
    for name, pixel in clicks.items():
        pick = pick_skin(scan, pixel)
        if pick.point is not None:
            joints.append(Joint(name, pick.point.position_m, np.array(pixel), 1.0, "hand"))
    return joints
