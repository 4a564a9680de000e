"""The psi stance while the patient still moves: what to ask for, from a live skeleton, in steady words."""

from __future__ import annotations

from typing import Final

import numpy as np

from core.anchors.live_pose import LivePose
from core.anchors.names import JOINT_NAMES
from core.anchors.psi import PsiReport, check_psi
from core.anchors.skeleton import VISIBLE, Joint, Skeleton

SETTLE_S: Final = 0.4
"""A correction is said, and taken back, only after it has held for so long."""

_TRUNK_M: Final = 0.5
_FACING: Final = ("left_shoulder", "right_shoulder")
_NARROW: Final = 0.35
_SHORT: Final = 0.3
_TRUNK: Final = ("neck", "left_hip", "right_hip")


def check_psi_live(pose: LivePose, *, whole_body: bool = True) -> PsiReport:
    """Compare a live skeleton with the psi stance; the words are those of `check_psi`.

    With depth the joints in space are judged. Without, the picture is: shoulders that look narrow mean a
    turned patient, an upper arm that looks short one that points at the camera.

    Parameters
    ----------
    pose : LivePose
    whole_body : bool
        False: the feet need not be seen.
    """
    skeleton = live_skeleton_in_space(pose)
    if skeleton is not None:
        return check_psi(skeleton, whole_body=whole_body)
    flat, trunk = _flat(pose)
    report = check_psi(flat, whole_body=whole_body)
    return report if trunk is None else _with_depth_guessed(report, flat, trunk)


def live_skeleton_in_space(pose: LivePose) -> Skeleton | None:
    """The seen joints as a `Skeleton`; None unless all of them have a place in space."""
    names = [name for name in JOINT_NAMES if name in pose.joints]
    joints = {}
    for name in names:
        live = pose.joints[name]
        if live.point_m is None:
            if live.visibility >= VISIBLE:
                return None
            continue
        joints[name] = Joint(name, live.point_m, live.pixel, live.visibility, pose.source)
    return Skeleton(joints, source=pose.source) if joints else None


def _flat(pose: LivePose) -> tuple[Skeleton, float | None]:
    """The skeleton in the picture plane, scaled to a trunk of half a metre; the trunk in metres if seen."""
    scale, trunk = 1e-3, None
    if pose.sees(*_TRUNK):
        hips = (pose.joints["left_hip"].pixel + pose.joints["right_hip"].pixel) / 2
        length = float(np.linalg.norm(pose.joints["neck"].pixel - hips))
        if length > 1.0:
            scale, trunk = _TRUNK_M / length, _TRUNK_M
    joints = {
        name: Joint(
            name,
            np.array([*(live.pixel * scale), 0.0]),
            live.pixel,
            live.visibility,
            pose.source,
        )
        for name, live in pose.joints.items()
        if name in JOINT_NAMES
    }
    return Skeleton(joints, source=pose.source), trunk


def _with_depth_guessed(report: PsiReport, flat: Skeleton, trunk: float) -> PsiReport:
    """The report with what foreshortening tells of the depth that is missing."""
    say = list(report.corrections)
    turn = "Turn to face the camera."
    if flat.sees(*_FACING) and turn not in say:
        across = float(np.linalg.norm(flat.point(_FACING[0]) - flat.point(_FACING[1])))
        if across < _NARROW * trunk:
            return PsiReport(False, (turn, *say))
    for side in ("left", "right"):
        elbow = f"{side}_elbow"
        if flat.sees(elbow, f"{side}_shoulder"):
            upper = float(np.linalg.norm(flat.point(elbow) - flat.point(f"{side}_shoulder")))
            if upper < _SHORT * trunk:  # its direction in the picture then means nothing
                say = [words for words in say if f"{side} elbow" not in words]
                say.append(f"Move the {side} elbow out to the side.")
    return PsiReport(not say, tuple(say))


class PsiCoach:
    """Corrections that neither flicker nor lag: each holds for a moment before it is said or taken back."""

    def __init__(self, *, whole_body: bool = True, settle_s: float = SETTLE_S) -> None:
        self._whole_body, self._settle_s = whole_body, settle_s
        self._since: dict[str, float] = {}
        self._until: dict[str, float] = {}
        self._said: list[str] = []
        self._time = -np.inf
        self._start: float | None = None

    def update(self, pose: LivePose) -> PsiReport:
        """The corrections to show now.

        ``ok`` is True when none is shown and none has begun; in the first moments it is False.
        """
        now = pose.time_s
        if self._start is None or now < self._time:
            self._start = now
            self._since.clear()
            self._until.clear()
        self._time = now
        wanted = check_psi_live(pose, whole_body=self._whole_body).corrections
        for words in wanted:
            self._since.setdefault(words, now)
            self._until[words] = now
        for words in list(self._since):
            quiet = now - self._until[words]
            if words not in wanted and (quiet >= self._settle_s or words not in self._said):
                del self._since[words], self._until[words]
        held = {w for w, since in self._since.items() if w in self._said or now - since >= self._settle_s}
        self._said = [w for w in wanted if w in held] + [
            w for w in self._said if w in held and w not in wanted
        ]
        settled = now - self._start >= self._settle_s
        return PsiReport(settled and not self._said and not wanted, tuple(self._said))
