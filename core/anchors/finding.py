"""From a scanned body to its skeleton, with everything that makes the answer trustworthy."""

from __future__ import annotations

from typing import Final

from core.anchors.calibration import SkeletonCalibration, apply_calibration
from core.anchors.detection import detect_pose
from core.anchors.joint_fusion import fuse_skeletons
from core.anchors.left_right import guard_left_right, same_sides
from core.anchors.lifting import lift, recorded_skeleton
from core.anchors.skeleton import JointSource, Skeleton, SkeletonTracker
from core.errors import WorkError
from core.surface import BodyScan

MIN_JOINTS: Final = 4
"""Fewer visible joints than this are not a person."""

_ADVICE: Final = (
    "Let the whole body be seen, arms away from it, in even light, and repeat the capture; "
    "or place the joints by hand."
)


def find_skeleton(
    scan: BodyScan,
    tracker: SkeletonTracker,
    *,
    use_recorded: bool = True,
    calibration: SkeletonCalibration | None = None,
) -> Skeleton:
    """Find the joints of the scanned person.

    Parameters
    ----------
    scan : BodyScan
    tracker : SkeletonTracker
        Not called where recorded joints are used.
    use_recorded : bool
        Take the joints stored with the capture if there are any.
    calibration : SkeletonCalibration or None
        Bone lengths of this patient's psi capture.

    Raises
    ------
    WorkError
        If no person is found.
    """
    capture = scan.capture
    if use_recorded and capture.joints_m:
        skeleton = recorded_skeleton(capture.joints_m, capture.rig, scan.surface)
        second = None
        if len(skeleton.visible()) < MIN_JOINTS:
            raise WorkError("The joints stored with the capture do not lie on the body.", _ADVICE)
    else:
        found = detect_pose(scan, tracker)
        if found is None:
            raise WorkError("No person was recognised in the capture.", _ADVICE)
        skeleton = lift(found.landmarks, found.source, capture.rig, scan.surface)
        if len(skeleton.visible()) < MIN_JOINTS:
            raise WorkError("No person was recognised clearly enough in the capture.", _ADVICE)
        skeleton = skeleton.with_warnings(*found.warnings)
        other: JointSource = "relief" if found.source == "color" else "color"
        second = None if found.second is None else lift(found.second, other, capture.rig, scan.surface)
        if second is not None and same_sides(skeleton, second):
            skeleton = fuse_skeletons(skeleton, second)
    if calibration is not None:
        skeleton = apply_calibration(skeleton, calibration, capture.rig)
    return skeleton.with_warnings(*guard_left_right(skeleton, capture.view, second, scan.surface).warnings)
