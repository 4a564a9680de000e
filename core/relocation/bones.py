"""Carrying a place from visit to visit with the nearest bone: what the skeleton alone knows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.relocation.pair import VisitPair

FloatArray = NDArray[np.float64]

Part = Literal["head", "trunk", "upper arm", "forearm", "thigh", "lower leg"]

PART_OF_BONE: dict[str, Part] = {
    "trunk": "trunk",
    "neck to head": "head",
    "shoulder to elbow": "upper arm",
    "elbow to hand": "forearm",
    "hip to knee": "thigh",
    "knee to foot": "lower leg",
}

TORSO = ("neck", "torso", "left_shoulder", "right_shoulder", "left_hip", "right_hip")
RADIUS_M = {"torso": 0.15, "upper": 0.09, "fore": 0.06}
"""Usual radii of body parts: a place belongs to the bone nearest in these units (METHOD section 3)."""

LEAST_BONE_M = 0.03

LIMB_BONES = (
    ("left_shoulder", "left_elbow", "left_hand", 0.09, 0.06),
    ("right_shoulder", "right_elbow", "right_hand", 0.09, 0.06),
    ("left_hip", "left_knee", "left_foot", 0.09, 0.09),
    ("right_hip", "right_knee", "right_foot", 0.09, 0.09),
)
"""Joints of every limb from the trunk outward, and the usual radii of its two segments in metres."""


@dataclass(frozen=True, eq=False)
class Bone:
    """A segment with the rigid motion that takes it from the first visit to the follow-up.

    `parent` is the number of the bone it hangs on; None for the trunk, which comes first.
    """

    name: str
    start: FloatArray
    end: FloatArray
    radius_m: float
    rotation: FloatArray
    moved_start: FloatArray
    parent: int | None = None

    @property
    def spoken(self) -> str:
        """Name of the body part for a sentence: "left upper arm", "trunk"."""
        side = self.name.split("_")[0]
        part = PART_OF_BONE[self.name.replace("left_", "").replace("right_", "")]
        return f"{side} {part}" if side in ("left", "right") else part


def rigid_fit(first: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and translation (3,) that take points (n, 3) onto others best (Kabsch)."""
    a, b = first.mean(axis=0), second.mean(axis=0)
    u, _, vt = np.linalg.svd((first - a).T @ (second - b))
    sign = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(vt.T @ u.T)))])
    rotation = vt.T @ sign @ u.T
    return rotation, b - rotation @ a


def minimal_rotation(a: FloatArray, b: FloatArray) -> FloatArray:
    """The smallest rotation (3, 3) that turns direction a into direction b."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.999999:
        helper = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        helper = helper / np.linalg.norm(helper)
        return np.asarray(2.0 * np.outer(helper, helper) - np.eye(3))
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + cosine))


def torso_joints(pair: VisitPair) -> tuple[FloatArray, FloatArray] | None:
    """The torso's joints seen in both captures, (k, 3) each; None with fewer than four."""
    shared = set(pair.first.skeleton.visible()) & set(pair.followup.skeleton.visible())
    names = [name for name in TORSO if name in shared]
    if len(names) < 4:
        return None
    both = [pair.joints_m(name) for name in names]
    return np.array([b[0] for b in both]), np.array([b[1] for b in both])


def torso_rotation(pair: VisitPair) -> FloatArray | None:
    """How the trunk turned between the captures (3, 3); None when its joints were not seen."""
    joints = torso_joints(pair)
    return None if joints is None else rigid_fit(*joints)[0]


def bones(pair: VisitPair) -> tuple[Bone, ...]:
    """The trunk and every limb segment seen in both captures; empty without a trunk.

    The trunk moves by Kabsch on its joints, limbs by the smallest rotation from their parent's, so a twist
    about a limb's own axis stays unknown.
    """
    joints = torso_joints(pair)
    if joints is None:
        return ()
    rotation, _ = rigid_fit(*joints)
    centre1, centre2 = joints[0].mean(axis=0), joints[1].mean(axis=0)
    shared = set(pair.first.skeleton.visible()) & set(pair.followup.skeleton.visible())
    out = [_trunk(pair, shared, rotation, centre1, centre2)]
    for root, middle, tip, thick, thin in LIMB_BONES:
        parent, parent_bone = rotation, 0
        for near, far, radius in ((root, middle, thick), (middle, tip, thin)):
            if near not in shared or far not in shared or not _long_enough(pair, near, far):
                break
            (a1, a2), (b1, b2) = pair.joints_m(near), pair.joints_m(far)
            parent = minimal_rotation(parent @ (b1 - a1), b2 - a2) @ parent
            out.append(Bone(f"{near} to {far}", a1, b1, radius, parent, a2, parent_bone))
            parent_bone = len(out) - 1
    if {"neck", "head"} <= shared and _long_enough(pair, "neck", "head"):
        (a1, a2), (b1, b2) = pair.joints_m("neck"), pair.joints_m("head")
        out.append(
            Bone(
                "neck to head",
                a1,
                b1,
                0.09,
                minimal_rotation(rotation @ (b1 - a1), b2 - a2) @ rotation,
                a2,
                0,
            )
        )
    return tuple(out)


def _long_enough(pair: VisitPair, near: str, far: str) -> bool:
    """Whether a bone has a direction in both visits; joints on one point have none."""
    (a1, a2), (b1, b2) = pair.joints_m(near), pair.joints_m(far)
    return min(float(np.linalg.norm(b1 - a1)), float(np.linalg.norm(b2 - a2))) > LEAST_BONE_M


def _trunk(
    pair: VisitPair, shared: set[str], rotation: FloatArray, centre1: FloatArray, centre2: FloatArray
) -> Bone:
    start, end = centre1, centre1
    if {"neck", "left_hip", "right_hip"} <= shared:
        start = pair.joints_m("neck")[0]
        end = (pair.joints_m("left_hip")[0] + pair.joints_m("right_hip")[0]) / 2
    return Bone("trunk", start, end, 0.15, rotation, centre2 + rotation @ (start - centre1))


def nearest_bone(place: FloatArray, candidates: tuple[Bone, ...]) -> Bone:
    """The bone nearest to a place of the first visit, in units of its radius."""
    return min(candidates, key=lambda bone: _segment_distance(place, bone) / bone.radius_m)


def _segment_distance(place: FloatArray, bone: Bone) -> float:
    along = bone.end - bone.start
    square = float(along @ along)
    share = float(np.clip((place - bone.start) @ along / square, 0.0, 1.0)) if square > 0 else 0.0
    return float(np.linalg.norm(place - bone.start - share * along))


def carry(place: FloatArray, bone: Bone) -> FloatArray:
    """A place of the first visit moved rigidly with a bone."""
    return np.asarray(bone.moved_start + bone.rotation @ (place - bone.start))
