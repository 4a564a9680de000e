"""How the simulated patient can stand: stances as aims for arms, legs, spine and head."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from devices.simulator.body import BodyModel, minimal_rotation, rotation_about

FloatArray = NDArray[np.float64]

LEFT_RIGHT = (("L", 1.0), ("R", -1.0))
_SPINE = ("spine05", "spine04", "spine03", "spine02", "spine01")
_NECK = ("neck01", "neck02", "head")
_CLAVICLE_FOLLOWS_DEG = 18.0


def _limb_frame(direction: FloatArray, hint: FloatArray) -> FloatArray:
    d = direction / np.linalg.norm(direction)
    f = hint - d * (hint @ d)
    f = f / np.linalg.norm(f)
    return np.stack([d, f, np.cross(d, f)], axis=1)


class Posture:
    """Collects bone rotations. Directions are in the body frame (x left, y back, z up).

    Parameters
    ----------
    model : BodyModel
    rng : Generator, optional
        With it nobody stands twice the same: every aim is turned by a small random rotation.
    jitter_deg : float
        Its standard deviation per axis.
    twist_deg : float
        Standard deviation of an extra turn of the upper arm about its own axis and of the forearm.
    """

    def __init__(
        self,
        model: BodyModel,
        rng: np.random.Generator | None = None,
        jitter_deg: float = 0.0,
        twist_deg: float = 0.0,
    ) -> None:
        self.model = model
        self.local: dict[str, FloatArray] = {}
        self._rng = rng
        self._jitter = np.deg2rad(jitter_deg)
        self._twist = twist_deg

    def _aim(self, direction: ArrayLike) -> FloatArray:
        d = np.asarray(direction, float)
        if self._rng is not None and self._jitter > 0:
            turn = self._rng.normal(0.0, self._jitter, 3)
            angle = float(np.linalg.norm(turn))
            if angle > 0:
                d = rotation_about(turn, angle) @ d
        return np.asarray(d / np.linalg.norm(d))

    def _random_deg(self, sd: float) -> float:
        return float(self._rng.normal(0.0, sd)) if self._rng is not None and sd > 0 else 0.0

    def _world(self, bone: str) -> FloatArray:
        """Accumulated rotation of a bone."""
        chain, k = [], self.model.bone_index[bone]
        while k >= 0:
            chain.append(self.model.bones[k])
            k = int(self.model.parents[k])
        rotation = np.eye(3)
        for name in reversed(chain):
            rotation = rotation @ self.local.get(name, np.eye(3))
        return rotation

    def _world_of_parent(self, bone: str) -> FloatArray:
        parent = int(self.model.parents[self.model.bone_index[bone]])
        return self._world(self.model.bones[parent]) if parent >= 0 else np.eye(3)

    def _set_world(self, bone: str, rotation: FloatArray) -> None:
        self.local[bone] = self._world_of_parent(bone).T @ rotation

    def arm(self, side: str, upper: ArrayLike, fore: ArrayLike, flexion: ArrayLike | None = None) -> None:
        """Aim upper arm and forearm.

        ``flexion`` tells toward where the elbow would bend when the arm is (almost) straight; otherwise the
        forearm itself tells. This fixes the humeral twist, which is shared by the two upper-arm bones.
        """
        m = self.model
        rest_upper = m.bone_direction(f"upperarm01.{side}", f"lowerarm01.{side}")
        rest_fore = m.bone_direction(f"lowerarm01.{side}", f"wrist.{side}")
        upper, fore = self._aim(upper), self._aim(fore)
        across = fore - upper * (fore @ upper)
        if np.linalg.norm(across) <= 0.2 and flexion is not None:
            across = np.asarray(flexion, float)
        twisted = _limb_frame(upper, across) @ _limb_frame(rest_upper, rest_fore).T
        sign = 1.0 if side == "L" else -1.0
        lift = np.deg2rad(max(0.0, upper[2] - rest_upper[2]) * _CLAVICLE_FOLLOWS_DEG * 0.6)
        for bone in ("clavicle", "shoulder01"):
            self.local[f"{bone}.{side}"] = rotation_about((0.0, -sign, 0.0), float(lift))
        parent = self._world_of_parent(f"upperarm01.{side}")
        swing = minimal_rotation(parent @ rest_upper, upper) @ parent
        rest = swing.T @ twisted
        skew = np.array([rest[2, 1] - rest[1, 2], rest[0, 2] - rest[2, 0], rest[1, 0] - rest[0, 1]]) / 2.0
        twist = float(np.arctan2(skew @ rest_upper, (np.trace(rest) - 1.0) / 2.0))
        twist += np.deg2rad(self._random_deg(self._twist))
        self._set_world(f"upperarm01.{side}", swing @ rotation_about(rest_upper, 0.5 * twist))
        self._set_world(f"upperarm02.{side}", swing @ rotation_about(rest_upper, twist))
        elbow = self._world(f"upperarm02.{side}")
        self._set_world(f"lowerarm01.{side}", minimal_rotation(elbow @ rest_fore, fore) @ elbow)
        self.pronate(side, self._random_deg(1.5 * self._twist))

    def pronate(self, side: str, degrees: float) -> None:
        """Turn the forearm about its own axis, half in the forearm and half in the wrist."""
        axis = self.model.bone_direction(f"lowerarm01.{side}", f"wrist.{side}")
        for bone in (f"lowerarm02.{side}", f"wrist.{side}"):
            turn = rotation_about(axis, np.deg2rad(degrees) / 2.0)
            self.local[bone] = self.local.get(bone, np.eye(3)) @ turn

    def leg(self, side: str, thigh: ArrayLike, shank: ArrayLike) -> None:
        """Aim thigh and shank; the foot stays level."""
        m = self.model
        rest_thigh = m.bone_direction(f"upperleg01.{side}", f"lowerleg01.{side}")
        rest_shank = m.bone_direction(f"lowerleg01.{side}", f"foot.{side}")
        self._set_world(f"upperleg01.{side}", minimal_rotation(rest_thigh, self._aim(thigh)))
        knee = self._world(f"upperleg01.{side}")
        shin = minimal_rotation(knee @ rest_shank, self._aim(shank)) @ knee
        self._set_world(f"lowerleg01.{side}", shin)
        self._set_world(f"foot.{side}", np.eye(3))

    def spine(self, twist_deg: float = 0.0, bend_deg: float = 0.0, side_deg: float = 0.0) -> None:
        """Twist, bend forward and bend sideways, spread over five vertebral bones."""
        share = len(_SPINE)
        for bone in _SPINE:
            self.local[bone] = (
                rotation_about((0, 0, 1), np.deg2rad(twist_deg) / share)
                @ rotation_about((1, 0, 0), np.deg2rad(bend_deg) / share)
                @ rotation_about((0, 1, 0), np.deg2rad(side_deg) / share)
            )

    def head(self, yaw_deg: float = 0.0, pitch_deg: float = 0.0) -> None:
        """Turn and nod the head."""
        for bone in _NECK:
            self.local[bone] = rotation_about((0, 0, 1), np.deg2rad(yaw_deg) / 3) @ rotation_about(
                (1, 0, 0), np.deg2rad(pitch_deg) / 3
            )


def _a(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.75, 0, -0.66), (x * 0.75, -0.08, -0.66), flexion=(0, -1, 0))


def _t(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x, 0, 0), (x, -0.05, 0), flexion=(0, -1, 0))


def _psi(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x, 0, 0), (x * 0.05, -0.05, 1))


def _down(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.22, 0.05, -1), (x * 0.18, -0.15, -1), flexion=(0, -1, 0))


def _forward(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.12, -1, 0), (x * 0.05, -1, 0), flexion=(-x * 0.7, 0, 0.7))


def _up(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.3, -0.05, 1), (x * 0.1, -0.1, 1), flexion=(-x * 0.7, -0.7, 0))


def _knee(p: Posture) -> None:
    _a(p)
    p.leg("L", (0.12, -0.85, -0.5), (0.1, 0.15, -1))


def _twist(p: Posture) -> None:
    p.spine(twist_deg=35)
    turn = rotation_about((0, 0, 1), np.deg2rad(35))
    for side, x in LEFT_RIGHT:
        p.arm(side, turn @ (x * 0.7, 0, -0.7), turn @ (x * 0.6, -0.35, -0.7), flexion=(0, -1, 0))


def _sidebend(p: Posture) -> None:
    p.spine(side_deg=20)
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.8, 0, -0.6), (x * 0.7, -0.2, -0.6), flexion=(0, -1, 0))


def _hip_hands(p: Posture) -> None:
    for side, x in LEFT_RIGHT:
        p.arm(side, (x * 0.75, 0.2, -0.6), (-x * 0.55, -0.3, -0.6))


def _reference(p: Posture) -> None:
    """Leave every bone as the body model has it."""


_STANCES: dict[str, Callable[[Posture], None]] = {
    "A": _a,
    "T": _t,
    "psi": _psi,
    "down": _down,
    "forward": _forward,
    "up": _up,
    "knee": _knee,
    "twist": _twist,
    "sidebend": _sidebend,
    "hip_hands": _hip_hands,
    "reference": _reference,
}

STANCES = tuple(name for name in _STANCES if name != "reference")
"""Names of the stances a patient is asked to take."""


def take_stance(posture: Posture, name: str) -> dict[str, FloatArray]:
    """Bone rotations (for `pose_body`) of a stance.

    Raises
    ------
    InputError
        If there is no stance of this name.
    """
    if name not in _STANCES:
        raise InputError(f"There is no stance called '{name}'.", f"Choose one of: {', '.join(STANCES)}.")
    _STANCES[name](posture)
    if posture._rng is not None and posture._jitter > 0:
        posture.head(posture._random_deg(4.0), posture._random_deg(3.0))
    return posture.local
