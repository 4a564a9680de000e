"""Joints that a person puts where they belong, on the picture."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.covariance import hand_covariance
from core.anchors.lifting import SkinUnder, bone_cost
from core.anchors.names import BONES, JOINT_NAMES, spoken
from core.anchors.skeleton import Joint, Skeleton
from core.capture.rgbd import CameraRig
from core.errors import InputError
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

_LIMB_ENDS: Final = frozenset({"elbow", "hand", "knee", "foot"})


class JointPlacer:
    """Puts joints of one capture where a person says. Building it takes some 30 ms, placing a joint 1 ms.

    Parameters
    ----------
    rig : CameraRig
    surface : BodySurface
    """

    def __init__(self, rig: CameraRig, surface: BodySurface) -> None:
        self._rig = rig
        self._skin = SkinUnder(rig, surface)

    def place(self, skeleton: Skeleton, name: str, pixel: FloatArray) -> Skeleton:
        """The skeleton with one joint at a pixel of the picture.

        The joint gets the depth of the skin under the pixel, as the tracker's joints do. Where limbs overlap,
        the layer that makes possible bones with the neighbouring joints is taken, else the one that fills
        the place.

        Parameters
        ----------
        skeleton : Skeleton
        name : str
            One of `names.JOINT_NAMES`.
        pixel : ndarray (2,)
            Of the picture (the depth image without colour).

        Raises
        ------
        InputError
            If the pixel is not on the body.
        """
        if name not in JOINT_NAMES:
            raise ValueError(f"'{name}' is no joint")
        at = np.asarray(pixel, dtype=float)
        points, shares = self._skin.layers(name, at)
        if not len(points):
            raise InputError(
                f"The {spoken(name)} must lie on the body; it stays where it was.",
                "Drop it on the patient, where depth was measured.",
            )
        costs = [
            _misfit(skeleton, name, point) - np.log(share)
            for point, share in zip(points, shares, strict=True)
        ]
        point = points[int(np.argmin(costs))]
        origin = self._rig.picture_from_depth.inverse().translation
        covariance = hand_covariance(name, point - origin)
        return skeleton.with_joint(
            Joint(name, point, self._rig.project_to_picture(point)[0], 1.0, "hand", covariance)
        )


def _misfit(skeleton: Skeleton, name: str, point: FloatArray) -> float:
    """How impossible the limb's bones at this joint would be."""
    cost = 0.0
    for near, far in BONES:
        if far.split("_")[-1] not in _LIMB_ENDS or name not in (near, far):
            continue
        other = far if name == near else near
        if other in skeleton.joints and skeleton.sees(other):
            cost += bone_cost(far, float(np.linalg.norm(skeleton.point(other) - point)))
    return cost


def by_hand(skeleton: Skeleton) -> dict[str, FloatArray]:
    """Joints that were placed by hand and their pixels."""
    return {name: joint.pixel for name, joint in skeleton.joints.items() if joint.source == "hand"}
