"""Bone lengths from the psi stance, used to mend joints of the working capture whose depth went wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.lifting import relifted
from core.anchors.names import BONES, opposite, spoken
from core.anchors.skeleton import Joint, Skeleton
from core.capture.rgbd import CameraRig
from core.errors import WorkError

FloatArray = NDArray[np.float64]
Bone = tuple[str, str]

TOLERANCE_M: Final = 0.06
"""A bone may differ this much from its calibrated length ..."""

TOLERANCE_SHARE: Final = 0.25
"""... or by this share of it, whichever is more: joints are found to 20-40 mm (METHOD section 4)."""

_SLIDES: Final = frozenset(b for b in BONES if b[1].split("_")[-1] in {"elbow", "hand", "knee", "foot"})


@dataclass(frozen=True, eq=False)
class SkeletonCalibration:
    """Lengths of one patient's bones.

    Attributes
    ----------
    bone_lengths_m : mapping of (str, str) to float
        Keys are among `names.BONES`.
    """

    bone_lengths_m: Mapping[Bone, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "bone_lengths_m", MappingProxyType(dict(self.bone_lengths_m)))


def calibrate_skeleton(psi: Skeleton) -> SkeletonCalibration:
    """Measure the bones whose two ends are seen in the psi capture.

    A limb seen on one side only lends its length to the other. Where both sides differ by more than the
    tolerance, one of them is wrong and neither is kept.

    Raises
    ------
    WorkError
        If not a single bone is seen.
    """
    measured = {
        (a, b): float(np.linalg.norm(psi.point(a) - psi.point(b))) for a, b in BONES if psi.sees(a, b)
    }
    lengths: dict[Bone, float] = {}
    for bone in BONES:
        mirrored = _mirrored(bone)
        own, other = measured.get(bone), measured.get(mirrored)
        if own is None or other is None:
            length = own if own is not None else other
            if length is not None:
                lengths[bone] = length
        elif abs(own - other) <= _tolerance((own + other) / 2):
            lengths[bone] = own if bone == mirrored else (own + other) / 2
    if not lengths:
        raise WorkError(
            "The skeleton could not be calibrated: no bone is fully seen.",
            "Repeat the psi capture, arms raised.",
        )
    return SkeletonCalibration(lengths)


def apply_calibration(skeleton: Skeleton, calibration: SkeletonCalibration, rig: CameraRig) -> Skeleton:
    """Slide joints whose bone has an impossible length along their viewing ray until it fits.

    Only the ends of arm and leg bones slide; the place in the picture stays. Every change is said in the
    warnings and takes visibility away.
    """
    origin = rig.picture_from_depth.inverse().translation if skeleton.source == "color" else np.zeros(3)
    joints = dict(skeleton.joints)
    warnings: list[str] = []
    for bone in BONES:
        near, far = bone
        if bone not in _SLIDES or bone not in calibration.bone_lengths_m or not skeleton.sees(near, far):
            continue
        length = calibration.bone_lengths_m[bone]
        root, end = joints[near].point_m, joints[far].point_m
        found = float(np.linalg.norm(end - root))
        # a joint's own error shows at both of its bones: only an outlier may be moved
        if abs(found - length) <= _tolerance(length):
            continue
        mended = _on_ray(origin, end, root, length)
        shift = float(np.linalg.norm(mended - end))
        residual = abs(float(np.linalg.norm(mended - root)) - length)
        side = "nearer to" if mended[2] < end[2] else "farther from"
        if residual <= _tolerance(length) / 2:
            joints[far] = _doubted(
                relifted(joints[far], mended, rig, 0.8 * joints[far].visibility), mended - end
            )
            warnings.append(
                f"The depth of the {spoken(far)} did not fit the calibrated skeleton "
                f"({found * 100:.0f} cm from the {spoken(near)} instead of {length * 100:.0f} cm); "
                f"it was moved {shift * 100:.0f} cm {side} the camera."
            )
        else:
            warnings.append(
                f"The {spoken(far)} is {found * 100:.0f} cm from the {spoken(near)}, calibrated are "
                f"{length * 100:.0f} cm: check both joints."
            )
    return Skeleton(joints, skeleton.landmarks, skeleton.source, (*skeleton.warnings, *warnings))


def _on_ray(origin: FloatArray, end: FloatArray, root: FloatArray, length: float) -> FloatArray:
    """Point of the ray origin -> end at ``length`` from ``root``, nearest to ``end``, or the closest."""
    ray = (end - origin) / np.linalg.norm(end - origin)
    foot = float((root - origin) @ ray)
    gap = float(np.linalg.norm(root - origin - foot * ray))
    half = np.sqrt(max(length**2 - gap**2, 0.0))
    now = float((end - origin) @ ray)
    best = min((foot - half, foot + half), key=lambda t: abs(t - now))
    return np.asarray(origin + best * ray)


def _doubted(joint: Joint, shift: FloatArray) -> Joint:
    """The joint with a covariance that knows it was moved: its depth was wrong, and is only inferred now."""
    if joint.covariance_m2 is None:
        return joint
    return replace(joint, covariance_m2=joint.covariance_m2 + np.outer(shift, shift) / 4.0)


def _mirrored(bone: Bone) -> Bone:
    return opposite(bone[0]), opposite(bone[1])


def _tolerance(length: float) -> float:
    return max(TOLERANCE_M, TOLERANCE_SHARE * length)
