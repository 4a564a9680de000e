"""Is the patient's left really the patient's left? Doubt is said, never resolved behind the doctor's back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np

from core.anchors.names import opposite
from core.anchors.skeleton import Joint, Skeleton
from core.surface import BodySurface

_FACING: Final = {"front": 1.0, "back": -1.0}
_PROFILE: Final = {"left": "left_shoulder", "right": "right_shoulder"}
_PAIRS: Final = ("shoulder", "elbow", "hip", "knee")
_NARROW_M: Final = 0.10
_TOES_M: Final = 0.075
_HEELS_M: Final = 0.035


class Sides(Enum):
    """What the evidence says about left and right."""

    AGREE = "agree"
    UNSURE = "unsure"
    EXCHANGED = "exchanged"


@dataclass(frozen=True)
class LeftRightReport:
    """Outcome of the guard.

    Attributes
    ----------
    sides : Sides
    warnings : tuple of str
        Empty if everything agrees.
    """

    sides: Sides
    warnings: tuple[str, ...] = ()


def guard_left_right(
    skeleton: Skeleton, view: str, second: Skeleton | None = None, surface: BodySurface | None = None
) -> LeftRightReport:
    """Compare the skeleton's sides with the chosen view, a second opinion, and the way the feet point.

    Parameters
    ----------
    skeleton : Skeleton
    view : str
        The view the user chose: front, back, left (the patient's left side faces the camera) or right; other
        texts say nothing.
    second : Skeleton or None
        The same person from the other source (relief against colour).
    surface : BodySurface or None
        The skin, for `toes_m`.

    Returns
    -------
    LeftRightReport
        The skeleton itself is never changed.
    """
    warnings: list[str] = []
    exchanged = unsure = False
    facing = shoulder_order_m(skeleton)
    if view in _FACING:
        if facing is None:
            unsure = True
            warnings.append("Left and right could not be checked: both shoulders must be seen.")
        elif abs(facing) < _NARROW_M:
            unsure = True
            warnings.append(
                f"The view is '{view}', but the patient stands sideways: check left and right, "
                "or turn the patient."
            )
        elif facing * _FACING[view] < 0:
            exchanged = True
            seen = "back" if view == "front" else "front"
            warnings.append(
                f"Left and right do not fit the view '{view}': the joints look like a {seen} view. "
                "Check the view; nothing was exchanged."
            )
    elif view in _PROFILE and skeleton.sees(_PROFILE[view], opposite(_PROFILE[view])):
        nearer = skeleton.point(_PROFILE[view])[2] - skeleton.point(opposite(_PROFILE[view]))[2]
        if nearer > 0.05:
            exchanged = True
            warnings.append(
                f"The view is '{view}', but the patient's other side is nearer to the camera. "
                "Check the view; nothing was exchanged."
            )
    if second is not None and not same_sides(skeleton, second):
        unsure = True
        warnings.append(
            "The colour picture and the depth image disagree about left and right: "
            "check the joints before going on."
        )
    toes = None if surface is None else toes_m(skeleton, surface)
    if toes is not None and facing is not None and abs(facing) >= _NARROW_M:
        away = toes < _HEELS_M and facing > 0
        towards = toes > _TOES_M and facing < 0
        if away or towards:
            unsure = True
            warnings.append(
                f"The feet point {'away from' if away else 'towards'} the camera, which does not fit "
                "left and right of the joints: check them before going on."
            )
    sides = Sides.EXCHANGED if exchanged else Sides.UNSURE if unsure else Sides.AGREE
    return LeftRightReport(sides, tuple(warnings))


def shoulder_order_m(skeleton: Skeleton) -> float | None:
    """How far the left shoulder is to the right of the right one, seen by the camera; > 0 facing it.

    The median over shoulders, elbows, hips and knees that are seen on both sides; None without the shoulders.
    """
    if not skeleton.sees("left_shoulder", "right_shoulder"):
        return None
    across = [
        float((skeleton.point("left_" + p) - skeleton.point("right_" + p))[0])
        for p in _PAIRS
        if skeleton.sees("left_" + p, "right_" + p)
    ]
    shoulders = across[0]
    middle = float(np.median(across))
    return middle if middle * shoulders > 0 else shoulders


def toes_m(skeleton: Skeleton, surface: BodySurface) -> float | None:
    """How far the feet reach out of the shins towards the camera: toes do, heels hardly.

    Mean of both feet, metres: about 0.12 facing the camera and 0.00-0.02 turned away on standing adults; None
    unless both feet are seen.
    """
    if not skeleton.sees("left_foot", "right_foot"):
        return None
    reach = []
    for side in ("left_", "right_"):
        dx, dy, depth = (surface.vertices - skeleton.point(side + "foot")).T
        foot = depth[(abs(dx) < 0.12) & (dy > -0.02) & (abs(depth) < 0.35)]
        shin = depth[(abs(dx) < 0.08) & (dy < -0.05) & (dy > -0.15) & (abs(depth) < 0.35)]
        if len(foot) < 20 or len(shin) < 20:
            return None
        reach.append(float(np.median(shin) - np.percentile(foot, 3)))
    return float(np.mean(reach))


def same_sides(one: Skeleton, other: Skeleton) -> bool:
    """Whether two skeletons of one capture agree about left and right, as far as they can be compared."""
    agreement = _agreement(one, other)
    return agreement is None or agreement >= 0


def exchange_sides(skeleton: Skeleton) -> Skeleton:
    """The skeleton with left and right exchanged, for a user who has decided so."""
    joints = {opposite(n): _renamed(j) for n, j in skeleton.joints.items()}
    extras = {opposite(n): _renamed(j) for n, j in skeleton.landmarks.items()}
    return Skeleton(joints, extras, skeleton.source, skeleton.warnings)


def _renamed(joint: Joint) -> Joint:
    return replace(joint, name=opposite(joint.name))


def _agreement(one: Skeleton, other: Skeleton) -> float | None:
    """Median over paired joints of distance to the opposite - distance to the same; < 0 means exchanged."""
    both = [n for n in one.visible() if opposite(n) != n and other.sees(n, opposite(n))]
    if len(both) < 2:
        return None
    gains = [
        float(
            np.linalg.norm(one.point(n) - other.point(opposite(n)))
            - np.linalg.norm(one.point(n) - other.point(n))
        )
        for n in both
    ]
    return float(np.median(gains))
