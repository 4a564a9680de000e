"""Which body part a place on the skin belongs to, by the skeleton under it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

PARTS = ("head", "trunk", "upper arm", "forearm", "hand", "thigh", "lower leg", "foot")

_RADIUS_M = {
    "head": 0.10,
    "trunk": 0.15,
    "upper arm": 0.055,
    "forearm": 0.045,
    "hand": 0.045,
    "thigh": 0.09,
    "lower leg": 0.06,
    "foot": 0.05,
}
"""Usual radii: a place belongs to the bone nearest in these units. Only their ratios count."""

_GIRDLE_M, _GIRDLE_SHARE = 0.07, 0.8
"""From the neck toward the shoulder joint is trunk; the rounding of the shoulder is upper arm."""
_WRIST_SHARE = 0.85
"""The wrist on the way from elbow to hand: a skeleton's hand joint lies in the middle of the palm."""
_FINGER_SHARE = 1.4
_ANKLE_SHARE = 0.97
"""Skin of the lower leg's bone from here on, toes included, is foot."""

OTHER_LIMB_LEAST_M = 0.05
_MIDLINE_M = 0.03


@dataclass(frozen=True)
class BodyPlace:
    """Part of the body, and the limb it hangs on: "left arm", "right leg", "head", "trunk"."""

    part: str
    limb: str


@dataclass(frozen=True, eq=False)
class _Segment:
    start: FloatArray
    end: FloatArray
    radius_m: float
    place: BodyPlace


class BodyMap:
    """Names places by the joints of one capture.

    Parameters
    ----------
    joints_m : mapping of str to ndarray (3,)
        Any of the 15 joints, interior; bones with a missing end are left out.
    """

    def __init__(self, joints_m: Mapping[str, FloatArray]) -> None:
        self._joints = {name: np.asarray(p, float) for name, p in joints_m.items()}
        self._segments = self._trunk() + self._limbs()

    def __bool__(self) -> bool:
        return bool(self._segments)

    def place(self, point_m: FloatArray) -> BodyPlace | None:
        """The body part under a place; None without joints."""
        if not self._segments:
            return None
        best = min(self._segments, key=lambda s: _distance(point_m, s) / s.radius_m)
        if best.place.part == "lower leg":
            along = best.end - best.start
            if float((point_m - best.start) @ along / (along @ along)) > _ANKLE_SHARE:
                return BodyPlace("foot", best.place.limb)
        return best.place

    def is_wrong_limb(self, answer_m: FloatArray, truth_m: FloatArray) -> bool | None:
        """Whether an answer lies on another limb than the truth, or on the other side of the trunk.

        Near a joint two limbs meet: an answer less than 50 mm from the truth never counts as another limb.
        On the trunk both must be more than 30 mm from the median plane. None without joints.
        """
        answer, truth = self.place(answer_m), self.place(truth_m)
        if answer is None or truth is None:
            return None
        if float(np.linalg.norm(answer_m - truth_m)) < OTHER_LIMB_LEAST_M:
            return False
        if answer.limb != truth.limb:
            return True
        if truth.limb != "trunk":
            return False
        sides = self._side_m(answer_m), self._side_m(truth_m)
        return min(abs(s) for s in sides) > _MIDLINE_M and sides[0] * sides[1] < 0

    def _side_m(self, point_m: FloatArray) -> float:
        """Signed distance from the median plane; 0 without shoulders."""
        left, right = self._joints.get("left_shoulder"), self._joints.get("right_shoulder")
        if left is None or right is None:
            return 0.0
        across = (left - right) / np.linalg.norm(left - right)
        middle = self._joints.get("torso", (left + right) / 2)
        return float((point_m - middle) @ across)

    def _trunk(self) -> list[_Segment]:
        j, out = self._joints, []
        trunk = BodyPlace("trunk", "trunk")
        hips = [j[name] for name in ("left_hip", "right_hip") if name in j]
        if "neck" in j and hips:
            out.append(_Segment(j["neck"], np.mean(hips, axis=0), _RADIUS_M["trunk"], trunk))
        for side in ("left", "right"):
            if "neck" in j and f"{side}_shoulder" in j:
                inner = j["neck"] + _GIRDLE_SHARE * (j[f"{side}_shoulder"] - j["neck"])
                out.append(_Segment(j["neck"], inner, _GIRDLE_M, trunk))
        if "neck" in j and "head" in j:
            skull = j["neck"] + 0.5 * (j["head"] - j["neck"])
            out.append(_Segment(skull, j["head"], _RADIUS_M["head"], BodyPlace("head", "head")))
        return out

    def _limbs(self) -> list[_Segment]:
        j, out = self._joints, []
        for side in ("left", "right"):
            for limb, chain in (
                (f"{side} arm", (("shoulder", "elbow", "upper arm"), ("elbow", "hand", "forearm"))),
                (f"{side} leg", (("hip", "knee", "thigh"), ("knee", "foot", "lower leg"))),
            ):
                for near, far, part in chain:
                    a, b = j.get(f"{side}_{near}"), j.get(f"{side}_{far}")
                    if a is None or b is None or not np.linalg.norm(b - a) > 0:
                        continue
                    if part == "forearm":
                        wrist, tip = a + _WRIST_SHARE * (b - a), a + _FINGER_SHARE * (b - a)
                        out.append(_Segment(wrist, tip, _RADIUS_M["hand"], BodyPlace("hand", limb)))
                        b = wrist
                    out.append(_Segment(a, b, _RADIUS_M[part], BodyPlace(part, limb)))
        return out


def _distance(point_m: FloatArray, segment: _Segment) -> float:
    along = segment.end - segment.start
    square = float(along @ along)
    share = float(np.clip((point_m - segment.start) @ along / square, 0.0, 1.0)) if square > 0 else 0.0
    return float(np.linalg.norm(point_m - segment.start - share * along))
