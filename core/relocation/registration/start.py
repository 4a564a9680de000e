"""Where the skeleton carries the skin: the start of the dense registration (METHOD section 3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.anchors import Skeleton
from core.relocation.bones import LEAST_BONE_M, LIMB_BONES, Bone, bones, minimal_rotation
from core.relocation.pair import VisitPair
from core.relocation.registration.patches import SkinOwners

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

BLEND = 0.35
"""How softly bones share the skin between them, in units of their radii."""
HAND_SHARE = 0.35
"""A forearm reaches this share of its length beyond the middle of the hand."""
BENT_FROM, BENT_FULLY = 0.20, 0.35
"""Sine of an elbow's or knee's bend from which on its plane tells the limb's twist, and tells it fully."""
MOST_TWIST_RAD = 2.0


@dataclass(frozen=True, eq=False)
class SkeletonStart:
    """Skin blended between bones that move rigidly.

    Attributes
    ----------
    bones : tuple of Bone
    owners : SkinOwners
    lost : frozenset of int
        Bones that only the first visit shows: they are carried along with the bone that they hang on.
    """

    bones: tuple[Bone, ...]
    owners: SkinOwners
    lost: frozenset[int] = frozenset()

    def __call__(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (k, 3, 3) and new places (k, 3) of first-visit places (k, 3)."""
        weight = self.shares(places)
        moved = np.zeros_like(places)
        for w, b in zip(weight, self.bones, strict=True):
            moved += w[:, None] * ((places - b.start) @ b.rotation.T + b.moved_start)
        mixed = np.einsum("bk,bij->kij", weight, np.array([b.rotation for b in self.bones]))
        return nearest_rotations(mixed), moved

    def shares(self, places: FloatArray) -> FloatArray:
        """How much each bone (b, k) moves first-visit places (k, 3); sums to 1 over the bones."""
        distance = np.stack([off_bone(places, b) / b.radius_m for b in self.bones])
        distance[~self.owners.may_carry(places).T] = np.inf
        weight = np.exp(-(((distance - distance.min(axis=0)) / BLEND) ** 2))
        return np.asarray(weight / weight.sum(axis=0))


def off_bone(places: FloatArray, bone: Bone) -> FloatArray:
    """Distance (k,) of places from a bone's segment."""
    along = bone.end - bone.start
    square = max(float(along @ along), 1e-12)
    share = np.clip((places - bone.start) @ along / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(places - bone.start - share[:, None] * along, axis=1))


def nearest_rotations(matrices: FloatArray) -> FloatArray:
    """The rotations (k, 3, 3) nearest to matrices (k, 3, 3)."""
    u, _, vt = np.linalg.svd(matrices)
    turned = u @ vt
    wrong = np.linalg.det(turned) < 0
    if wrong.any():
        u[wrong, :, 2] *= -1
        turned = u @ vt
    return np.asarray(turned)


def skeleton_start(pair: VisitPair, places: FloatArray, edges: IntArray) -> SkeletonStart | None:
    """The start from the joints of both visits; None without a trunk.

    Parameters
    ----------
    places : ndarray (s, 3)
        Samples of the first skin.
    edges : ndarray (e, 2)
        Samples that are joined along the skin.
    """
    skeleton = bones(pair)
    if not skeleton:
        return None
    moved = posed(pair, skeleton)
    lost = _lost_bones(pair, moved)
    both = moved + lost
    return SkeletonStart(both, SkinOwners(both, places, edges), frozenset(range(len(moved), len(both))))


def _lost_bones(pair: VisitPair, skeleton: tuple[Bone, ...]) -> tuple[Bone, ...]:
    """Limb segments that the first visit shows and the follow-up does not, moving with their parents.

    Without them their skin would pass for that of the bone nearest to it.
    """
    first = pair.first.skeleton
    number = {bone.name: k for k, bone in enumerate(skeleton)}
    out: list[Bone] = []
    for near, middle, far, thick, thin in LIMB_BONES:
        parent = 0
        for start, end, radius in ((near, middle, thick), (middle, far, thin)):
            name = f"{start} to {end}"
            if name in number:
                parent = number[name]
                continue
            if (
                not first.sees(start, end)
                or float(np.linalg.norm(first.point(end) - first.point(start))) < LEAST_BONE_M
            ):
                break
            above = (*skeleton, *out)[parent]
            a, b = first.point(start), first.point(end)
            carried = above.moved_start + above.rotation @ (a - above.start)
            tip = b + (HAND_SHARE * (b - a) if end.endswith("hand") else 0.0)
            out.append(Bone(name, a, tip, radius, above.rotation, carried, parent))
            parent = len(skeleton) + len(out) - 1
    return tuple(out)


def posed(pair: VisitPair, skeleton: tuple[Bone, ...]) -> tuple[Bone, ...]:
    """Bones that keep the first visit's lengths, limbs turned about their axis as their bend shows."""
    out = list(skeleton)
    trunk = out[0]
    for number in range(1, len(out)):
        bone = out[number]
        if bone.parent != 0:
            continue
        length = bone.end - bone.start
        carried = trunk.moved_start + trunk.rotation @ (bone.start - trunk.start)
        origin = 0.5 * (carried + bone.moved_start)
        goal = _goal(pair, bone)
        rotation = minimal_rotation(trunk.rotation @ length, goal - origin) @ trunk.rotation
        child = next((k for k, b in enumerate(out) if b.parent == number), None)
        limb = next((names for names in LIMB_BONES if bone.name == f"{names[0]} to {names[1]}"), None)
        if limb is not None:
            rotation = _twisted(pair, rotation, limb[:3])
        out[number] = replace(bone, rotation=rotation, moved_start=origin)
        if child is None:
            continue
        far = out[child]
        knot = origin + rotation @ length
        along = far.end - far.start
        far_rotation = minimal_rotation(rotation @ along, _goal(pair, far) - knot) @ rotation
        end = far.end + (HAND_SHARE * along if far.name.endswith("hand") else 0.0)
        out[child] = replace(far, end=end, rotation=far_rotation, moved_start=knot)
    return tuple(out)


def _goal(pair: VisitPair, bone: Bone) -> FloatArray:
    """Where the follow-up has the far end of a bone."""
    return pair.joints_m(bone.name.split(" to ")[1])[1]


def _twisted(pair: VisitPair, rotation: FloatArray, names: tuple[str, str, str]) -> FloatArray:
    """The upper limb's rotation, turned about its axis into the plane in which elbow or knee bends.

    A straight limb has no such plane. A straight knee then tells nothing; of a straight elbow anatomy says
    where it would bend: to the front, and in a raised or stretched-out arm inward. So it does of an elbow
    whose hand is out of sight.
    """
    one, two = (_bending(pair, visit, names) for visit in (0, 1))
    if one is None or two is None:
        return rotation
    (direction1, trust1), (direction2, trust2) = one, two
    start, end = (pair.joints_m(name)[1] for name in names[:2])
    axis = (end - start) / np.linalg.norm(end - start)
    across1, across2 = _across(rotation @ direction1, axis), _across(direction2, axis)
    angle = float(np.arctan2(np.cross(across1, across2) @ axis, across1 @ across2))
    most = MOST_TWIST_RAD * min(trust1, trust2)
    return about(axis, float(np.clip(angle, -most, most))) @ rotation


def _bending(pair: VisitPair, visit: int, names: tuple[str, str, str]) -> tuple[FloatArray, float] | None:
    """Direction (3,) into which a limb of three joints bends, across its upper half, and its trust 0..1."""
    skeleton = (pair.first if visit == 0 else pair.followup).skeleton
    natural = _natural_bend(skeleton, names)
    start, middle = (skeleton.point(name) for name in names[:2])
    axis = (middle - start) / np.linalg.norm(middle - start)
    across = np.zeros(3)
    if skeleton.sees(names[2]):
        lower = skeleton.point(names[2]) - middle
        across = _across(lower / np.linalg.norm(lower), axis)
    size = float(np.linalg.norm(across))
    trust = float(np.clip((size - BENT_FROM) / (BENT_FULLY - BENT_FROM), 0.0, 1.0))
    if natural is None:
        return (across, trust) if trust > 0.0 else None
    expected = _across(natural, axis)
    length = float(np.linalg.norm(expected))
    if length < 0.2:
        return (across, trust) if trust > 0.0 else None
    measured = across / size if size > 1e-9 else np.zeros(3)
    return trust * measured + (1.0 - trust) * expected / length, 1.0


def _across(direction: FloatArray, axis: FloatArray) -> FloatArray:
    return np.asarray(direction - axis * (direction @ axis))


def _natural_bend(skeleton: Skeleton, names: tuple[str, str, str]) -> FloatArray | None:
    """Direction (3,) into which a straight elbow would bend; None for knees and without a trunk."""
    needed = ("neck", "left_shoulder", "right_shoulder", "left_hip", "right_hip")
    if not names[1].endswith("elbow") or not skeleton.sees(*needed):
        return None
    up = skeleton.point("neck") - 0.5 * (skeleton.point("left_hip") + skeleton.point("right_hip"))
    left = skeleton.point("left_shoulder") - skeleton.point("right_shoulder")
    up, left = up / np.linalg.norm(up), left / np.linalg.norm(left)
    front = np.cross(left, up)
    front = front / np.linalg.norm(front)
    arm = skeleton.point(names[1]) - skeleton.point(names[0])
    arm = arm / np.linalg.norm(arm)
    inward = -left if names[0].startswith("left") else left
    stretched = float(np.clip((arm @ front - 0.5) / 0.3, 0.0, 1.0))
    raised = float(np.clip((arm @ up - 0.5) / 0.3, 0.0, 1.0))
    other = stretched * up + raised * front
    away = max(stretched, raised)
    return np.asarray((1.0 - away) * front + away * (inward + other) * np.sqrt(0.5))


def about(axis: FloatArray, angle_rad: float) -> FloatArray:
    """Rotation (3, 3) about a unit axis."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle_rad) * k + (1.0 - np.cos(angle_rad)) * k @ k)
