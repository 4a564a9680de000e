"""Where the person stands: distance, and what of the body leaves the picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.live_pose import LivePose
from core.capture.sensors import sensor_model, sensor_names
from core.guidance.moment import Moment
from core.guidance.person import Person
from core.guidance.readings import Reading, State, unknown

BoolArray = NDArray[np.bool_]

FRAMED_SHARE: Final = 0.55
"""A standing person should fill at least this share of the picture's height."""

_GOOD_SIGMA_M: Final = 0.015
_SIGMA_M: Final = 0.022
_FARTHEST_GOOD_M: Final = 3.5
_EDGE_SHARE: Final = 0.06
_EDGE_M: Final = 0.025
_UPRIGHT_M: Final = 1.2


@dataclass(frozen=True)
class Reach:
    """Distances at which a sensor measures skin, metres.

    Attributes
    ----------
    near_m, far_m : float
        Beyond them it measures nothing, or too little.
    good_near_m, good_far_m : float
        Between them it measures well.
    """

    near_m: float = 0.8
    good_near_m: float = 1.2
    good_far_m: float = 3.0
    far_m: float = 3.6

    @classmethod
    def of_sensor(cls, name: str) -> Reach:
        """Of a sensor by the name of its noise model; the defaults (a Kinect's) for one that is not known.

        Far is where a single measurement of skin gets too uncertain for thirty of them to make up for it.
        """
        if name not in sensor_names():
            return cls()
        model = sensor_model(name)
        z = np.linspace(model.near_m, model.far_m, 256)
        sigma = np.asarray(model.axial_sigma(z))
        good, far = (float(z[sigma <= most].max(initial=model.near_m)) for most in (_GOOD_SIGMA_M, _SIGMA_M))
        near = max(model.near_m, 0.5)
        good_near = max(near + 0.4, 1.0)
        good = max(min(good, _FARTHEST_GOOD_M), good_near + 0.5)
        return cls(near, good_near, good, max(min(far, _FARTHEST_GOOD_M + 0.5), good + 0.3))


def distance_reading(person: Person, moment: Moment, reach: Reach) -> Reading:
    """Distance of the person, and whether it suits sensor and picture."""
    z = person.distance_m
    state: State = "good"
    say = ""
    standing = person.high_m[1] - person.low_m[1] > _UPRIGHT_M
    rows = np.flatnonzero(person.mask.any(axis=1))
    filled = (rows[-1] - rows[0] + 1) / person.mask.shape[0]
    if z < reach.near_m or z > reach.far_m:
        state = "bad"
    elif not reach.good_near_m <= z <= reach.good_far_m:
        state = "fair"
    if z < reach.good_near_m:
        say = "Step back: you are too near to be measured well."
    elif z > reach.good_far_m:
        say = "Come closer: depth gets uncertain so far away."
    elif standing and filled < FRAMED_SHARE:
        state, say = "fair", "Come closer: you fill only a part of the picture."
    return Reading("distance", z, "m", state, say)


def cut_sides(person: BoolArray, measured: BoolArray, pixels_per_m: float) -> list[str]:
    """Edges of the image ("top", "bottom", "left", "right") at which the person leaves it.

    Parameters
    ----------
    person, measured : ndarray (h, w) bool
        Pixels of the person, and all that carry a measurement: the edge is where those end, for depth cameras
        leave a blind rim.
    pixels_per_m : float
        At the person.
    """
    sides = []
    need = max(2, round(_EDGE_M * pixels_per_m))
    for name, body, seen in (
        ("top", person, measured),
        ("bottom", person[::-1], measured[::-1]),
        ("left", person.T, measured.T),
        ("right", person.T[::-1], measured.T[::-1]),
    ):
        first = int(seen.any(axis=1).argmax())
        if first <= _EDGE_SHARE * len(seen) and int(body[first].sum()) >= need:
            sides.append(name)
    return sides


def frame_reading(person: Person, moment: Moment, *, whole_body: bool = True) -> Reading:
    """Whether the whole body is in the picture, and what is not.

    The value is the number of sides at which it leaves the picture.
    """
    pixels_per_m = moment.camera.fx / person.distance_m
    cut = cut_sides(person.mask, moment.depth_m > 0, pixels_per_m)
    if not whole_body:
        cut = [side for side in cut if side != "bottom"]
    if cut:
        return Reading("frame", float(len(cut)), "", "bad", _say(cut, moment.pose))
    hidden = _unseen(moment, whole_body=whole_body)
    if hidden:
        return Reading("frame", 0.0, "", "fair", f"Not seen: {hidden}. Step back or tilt the camera.")
    return Reading("frame", 0.0, "", "good")


def faces_camera(pose: LivePose | None) -> bool | None:
    """Whether a person faces the camera (front or back view); None from the side or without joints."""
    if pose is None or not pose.sees("left_shoulder", "right_shoulder", "neck", "torso"):
        return None
    at = {name: pose.joints[name].pixel for name in ("left_shoulder", "right_shoulder", "neck", "torso")}
    across = float(at["left_shoulder"][0] - at["right_shoulder"][0])
    trunk = abs(float(at["torso"][1] - at["neck"][1]))
    return None if abs(across) < 0.5 * trunk else across > 0


def _say(cut: list[str], pose: LivePose | None) -> str:
    if "top" in cut and "bottom" in cut:
        return "Step back: head and feet are cut off."
    if "left" in cut and "right" in cut:
        return "Step back: both sides of the body are cut off."
    if "top" in cut:
        return "Step back or raise the camera: the head is cut off."
    if "bottom" in cut:
        return "Step back or lower the camera: the feet are cut off."
    side = cut[0]
    facing = faces_camera(pose)
    if facing is None:
        return f"Move towards the middle: the body is cut off at the {side} edge of the picture."
    # the picture is not a mirror: who faces the camera moves to its right edge by stepping to the own left
    towards = "left" if (side == "left") == facing else "right"
    return f"Take a step to your {towards}: the body is cut off at the edge of the picture."


def _unseen(moment: Moment, *, whole_body: bool) -> str:
    """Head and feet that the skeleton places outside the picture."""
    pose = moment.pose
    if pose is None:
        return ""
    width, height = pose.size
    out = []
    for said, name in (("head", "head"), ("left foot", "left_foot"), ("right foot", "right_foot")):
        joint = pose.joints.get(name)
        if joint is None or (not whole_body and "foot" in said):
            continue
        u, v = joint.pixel
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            out.append(said)
    return " and ".join(out)


def nobody(moment: Moment) -> Reading:
    """What to say if nobody is found: too near, or not there."""
    h, w = moment.depth_m.shape
    middle = moment.depth_m[h // 4 : -(h // 4), w // 3 : -(w // 3)]
    if float((middle <= 0).mean()) > 0.4:
        return unknown(
            "distance", "Nothing is measured in the middle: step back, or take away what covers the camera."
        )
    return unknown("distance", "Nobody is in view: stand in the middle, 2 to 3 m from the camera.")
