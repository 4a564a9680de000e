"""The psi stance: upright, facing the camera, upper arms level to the sides, forearms raised.

The thesis calibrates the skeleton in it. The check answers with what to say to the patient, sides being the
patient's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.left_right import shoulder_order_m
from core.anchors.names import spoken
from core.anchors.skeleton import VISIBLE, Skeleton

FloatArray = NDArray[np.float64]

UPPER_ARM_DEG: Final = 30.0
"""How far an upper arm may be from level."""

FOREARM_DEG: Final = 35.0
"""How far a forearm may be from upright."""

FORWARD_DEG: Final = 40.0
"""How far an upper arm may point towards or away from the camera."""

TURN_DEG: Final = 25.0
"""How far the shoulders may be turned out of the picture plane."""

LEAN_DEG: Final = 15.0


@dataclass(frozen=True)
class PsiReport:
    """Outcome of the stance check.

    Attributes
    ----------
    ok : bool
    corrections : tuple of str
        What to ask of the patient, most important first; empty if ok.
    """

    ok: bool
    corrections: tuple[str, ...] = ()


def check_psi(skeleton: Skeleton, *, whole_body: bool = True) -> PsiReport:
    """Compare a skeleton with the psi stance.

    Parameters
    ----------
    skeleton : Skeleton
    whole_body : bool
        False: captures of the upper body alone are wanted, the feet need not be seen.
    """
    say = [*_framing(skeleton, whole_body=whole_body)]
    say += _facing(skeleton)
    up = _up(skeleton)
    for side in ("left", "right"):
        say += _arm(skeleton, side, up)
    return PsiReport(not say, tuple(say))


def _framing(skeleton: Skeleton, *, whole_body: bool) -> list[str]:
    say = []
    if not skeleton.sees("head"):
        say.append("Step back or lower the camera's view: the head is not in the picture.")
    if whole_body and not skeleton.sees("left_foot", "right_foot"):
        missing = [s for s in ("left", "right") if not skeleton.sees(s + "_foot")]
        say.append(
            "Step back: the feet are not in the picture."
            if len(missing) == 2
            else f"Step back: the {missing[0]} foot is not in the picture."
        )
    return say


def _facing(skeleton: Skeleton) -> list[str]:
    if not skeleton.sees("left_shoulder", "right_shoulder"):
        return ["Turn to face the camera: both shoulders must be seen."]
    across = skeleton.point("left_shoulder") - skeleton.point("right_shoulder")
    turn = np.degrees(np.arctan2(across[2], abs(across[0])))
    order = shoulder_order_m(skeleton)
    if (order is not None and order < 0) or abs(turn) > TURN_DEG:
        return ["Turn to face the camera."]
    lean = np.degrees(np.arctan2(across[1], np.hypot(across[0], across[2])))
    if abs(lean) > LEAN_DEG:
        return ["Stand upright: the shoulders are not level."]
    return []


def _up(skeleton: Skeleton) -> FloatArray:
    """Upward along the trunk within the picture plane (the camera may be tilted or rolled a little)."""
    up = np.array([0.0, -1.0, 0.0])
    if skeleton.sees("neck", "torso"):
        trunk = (skeleton.point("neck") - skeleton.point("torso")) * (1.0, 1.0, 0.0)
        trunk = trunk / max(float(np.linalg.norm(trunk)), 1e-9)
        if trunk @ up > np.cos(np.radians(20.0)):
            return np.asarray(trunk)
    return up


def _arm(skeleton: Skeleton, side: str, up: FloatArray) -> list[str]:
    shoulder, elbow, hand = (f"{side}_{part}" for part in ("shoulder", "elbow", "hand"))
    hidden = [n for n in (elbow, hand) if n not in skeleton.joints or skeleton.joints[n].visibility < VISIBLE]
    if hidden:
        return [f"Bring the {spoken(hidden[0])} into the picture, away from the body."]
    if not skeleton.sees(shoulder):
        return []
    say = []
    upper = skeleton.point(elbow) - skeleton.point(shoulder)
    rise = np.degrees(np.arcsin(np.clip(upper @ up / max(float(np.linalg.norm(upper)), 1e-9), -1, 1)))
    outward = 1.0 if side == "left" else -1.0
    level = upper - (upper @ up) * up
    aside = np.degrees(np.arctan2(abs(level[2]), outward * level[0]))
    if rise < -UPPER_ARM_DEG:
        say.append(f"Bring the {side} elbow up to shoulder height.")
    elif rise > UPPER_ARM_DEG:
        say.append(f"Bring the {side} elbow down to shoulder height.")
    elif aside > FORWARD_DEG:
        say.append(f"Move the {side} elbow out to the side.")
    fore = skeleton.point(hand) - skeleton.point(elbow)
    off = np.degrees(np.arccos(np.clip(fore @ up / max(float(np.linalg.norm(fore)), 1e-9), -1, 1)))
    if off > FOREARM_DEG:
        if fore[2] < -0.7 * np.linalg.norm(fore):
            say.append(f"Raise the {side} forearm: it points at the camera.")
        elif off < 60 and outward * fore[0] < 0:
            say.append(f"Move the {side} hand out until the forearm is upright.")
        else:
            say.append(f"Raise the {side} forearm.")
    return say
