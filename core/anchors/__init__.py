"""Anchors: the 15 joints and further landmarks of a person, on the skin, with their reliability."""

from core.anchors.analyse import AnalysedCapture, analyse_capture, with_skeleton
from core.anchors.by_hand import JointPlacer, by_hand
from core.anchors.calibration import SkeletonCalibration, apply_calibration, calibrate_skeleton
from core.anchors.finding import find_skeleton
from core.anchors.joint_fusion import fuse_skeletons
from core.anchors.left_right import LeftRightReport, Sides, exchange_sides, guard_left_right
from core.anchors.live import LiveSkeleton, PictureFollower
from core.anchors.live_pose import LiveJoint, LivePose
from core.anchors.live_psi import PsiCoach, check_psi_live
from core.anchors.names import BONES, EXTRA_NAMES, JOINT_NAMES, LANDMARK_NAMES, opposite
from core.anchors.psi import PsiReport, check_psi
from core.anchors.relief import shade_depth
from core.anchors.skeleton import VISIBLE, Joint, PoseLandmarks, Skeleton, SkeletonTracker
from core.anchors.skin_anchors import Anchor, AnchorSet, project_to_skin
from core.anchors.tracked import DepthTracker, TrackedPerson, TrackingState, tracked_skeleton

__all__ = [
    "BONES",
    "EXTRA_NAMES",
    "JOINT_NAMES",
    "LANDMARK_NAMES",
    "VISIBLE",
    "AnalysedCapture",
    "Anchor",
    "AnchorSet",
    "DepthTracker",
    "Joint",
    "JointPlacer",
    "LeftRightReport",
    "LiveJoint",
    "LivePose",
    "LiveSkeleton",
    "PictureFollower",
    "PoseLandmarks",
    "PsiCoach",
    "PsiReport",
    "Sides",
    "Skeleton",
    "SkeletonCalibration",
    "SkeletonTracker",
    "TrackedPerson",
    "TrackingState",
    "analyse_capture",
    "apply_calibration",
    "by_hand",
    "calibrate_skeleton",
    "check_psi",
    "check_psi_live",
    "exchange_sides",
    "find_skeleton",
    "fuse_skeletons",
    "guard_left_right",
    "opposite",
    "project_to_skin",
    "shade_depth",
    "tracked_skeleton",
    "with_skeleton",
]
