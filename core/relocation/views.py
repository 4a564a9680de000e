"""How two captures of the same body see a place: turned how far, how frontally, carried where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture
from core.relocation.bones import Bone, bones, carry, nearest_bone, rigid_fit, torso_joints
from core.relocation.pair import VisitPair

FloatArray = NDArray[np.float64]

FACING = 0.35
"""Cosine between the skin's normal and the way to the camera from which on a capture shows a place well
enough that its absence from a list means something (70 degrees)."""

NEAR_SURFACE_M = 0.05
"""A place carried by the bones that misses the measured skin by more is not in that capture."""


MISFIT_M = 0.05
"""A trunk is rigid: joints that fit it worse were not found, but guessed.

On simulated patients the worst torso joint misfits by 33 mm between tracked front and back views, by 135 to
270 mm as soon as a side view is tracked, and by 4 mm with true joints, front to side. Only where it is small
do places carried by the bones lie where they should (18 mm at most, against 80 to 310 mm)."""

OPPOSITE = {"front": "back", "back": "front", "left": "right", "right": "left"}
"""Views that show no common skin but a rim."""


def opposite(a: AnalysedCapture, b: AnalysedCapture) -> bool:
    """Whether two captures were taken of opposite sides, as whoever took them says."""
    return OPPOSITE.get(a.capture.view) == b.capture.view


def is_rigid(pair: VisitPair) -> bool:
    """Whether the trunks of two captures fit each other, so that the skeletons may carry places over."""
    joints = torso_joints(pair)
    if joints is None:
        return False
    rotation, shift = rigid_fit(*joints)
    misfit = np.linalg.norm(joints[0] @ rotation.T + shift - joints[1], axis=1)
    return bool(misfit.max() <= MISFIT_M)


def turn_deg(pair: VisitPair) -> float | None:
    """How far the trunk turned between two captures; None when that cannot be told."""
    joints = torso_joints(pair)
    if joints is None or not is_rigid(pair):
        return None
    rotation, _ = rigid_fit(*joints)
    return float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0))))


def frontality(analysed: AnalysedCapture, point_m: FloatArray) -> float:
    """Cosine between the skin's normal at a place and the way to the camera: 1 is seen from above."""
    surface = analysed.scan.surface
    normal = surface.normal_at(surface.nearest(point_m)[0])
    return float(-(normal @ point_m) / np.linalg.norm(point_m))


@dataclass(frozen=True, eq=False)
class Carried:
    """A place of one capture in another one of the same person.

    Attributes
    ----------
    point_m : ndarray (3,)
        In the other capture's depth-camera frame, moved rigidly with its bone: a few centimetres sharp.
    seen : bool
        Whether the other capture shows that skin from the front, inside its picture.
    """

    point_m: FloatArray
    seen: bool


class BoneBridge:
    """Carries places between two captures by the skeleton alone. Cheap: no distance field is computed."""

    def __init__(self, source: AnalysedCapture, target: AnalysedCapture) -> None:
        self._source, self._target = source, target
        pair = VisitPair(source, target)
        self._bones: tuple[Bone, ...] = bones(pair) if is_rigid(pair) else ()

    @property
    def carries(self) -> bool:
        """Whether the skeletons fit well enough to carry anything."""
        return bool(self._bones)

    def carry(self, point_m: FloatArray) -> Carried | None:
        """The place in the target; None where the skeletons cannot tell."""
        if not self._bones:
            return None
        bone = nearest_bone(point_m, self._bones)
        moved = carry(point_m, bone)
        surface = self._source.scan.surface
        normal = bone.rotation @ surface.normal_at(surface.nearest(point_m)[0])
        target = self._target.scan.surface
        nearest = target.nearest(moved)[0]
        inside = bool(
            self._target.capture.rig.picture_camera.contains(
                self._target.capture.rig.project_to_picture(nearest.position_m)[0]
            )[0]
        )
        near = float(np.linalg.norm(nearest.position_m - moved)) < NEAR_SURFACE_M
        facing = -float(normal @ moved) / float(np.linalg.norm(moved)) > FACING
        alike = float(target.normal_at(nearest) @ normal) > 0.0
        return Carried(moved, inside and near and facing and alike)
