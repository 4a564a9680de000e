"""A hand that takes a bottle from a table, lifts it, tilts it as if to pour, and puts it back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.capture.transform import RigidTransform
from devices.simulator.body import rotation_about
from devices.simulator.hands.model import CONFIGURATIONS, HandModel
from devices.simulator.hands.motions import HandMoment, LivingPose, Wander, blended, eased
from devices.simulator.hands.things import bottle, placed, table, upright

FloatArray = NDArray[np.float64]

_USUAL_LENGTH_M, _USUAL_RADIUS_M = 0.2026, 0.029
_TOUCH_M = 0.001
_HEIGHT_M, _GRASP_SHARE = 0.23, 0.42
_LIFT_M, _POUR_DEG = 0.08, 38.0
_CAMERA_DOWN_DEG = 22.0
_CYCLE_S = 8.0

# shares of a cycle at which each thing happens: from, to
_REACH, _CLOSE, _LIFT = (0.02, 0.16), (0.13, 0.24), (0.28, 0.40)
_POUR, _BACK, _LOWER = (0.42, 0.54), (0.60, 0.71), (0.73, 0.84)
_OPEN, _LEAVE = (0.86, 0.95), (0.90, 1.0)


@dataclass(frozen=True)
class Grasp:
    """How a bottle lies in a gripping hand: its axis is the hand's x.

    Attributes
    ----------
    radius_m : float
    y_m, z_m : float
        Of its axis in the hand frame.
    """

    radius_m: float
    y_m: float
    z_m: float


@lru_cache(maxsize=16)
def grasp_of(model: HandModel) -> Grasp:
    """The place deepest in the hand where a bottle that suits its size touches palm and fingers."""
    radius = _USUAL_RADIUS_M * model.length_m / _USUAL_LENGTH_M
    scale = model.length_m / _USUAL_LENGTH_M
    skin = model.posed(CONFIGURATIONS["grip"])
    skin = skin[skin[:, 1] > -0.03 * scale][:, 1:]
    y, z = np.meshgrid(np.linspace(-0.02, 0.05, 71) * scale, np.linspace(-0.09, -0.02, 71) * scale)
    places = np.stack([y.ravel(), z.ravel()], axis=1)
    gap = np.asarray(cKDTree(skin).query(places)[0])
    slack = _TOUCH_M
    while not (gap > radius - slack).any():
        slack += _TOUCH_M
    free = places[gap > radius - slack]
    best = free[np.argmax(free.sum(axis=1))]
    return Grasp(radius, float(best[0]), float(best[1]))


@dataclass(eq=False)
class Bottle:
    """The motion; one cycle takes about 8 s, or all the time there is if that is less.

    Parameters
    ----------
    model : HandModel
    rng : Generator
    duration_s : float
        Of the sequence: a whole number of cycles fits into it.
    """

    model: HandModel
    rng: np.random.Generator
    duration_s: float = _CYCLE_S
    joint_deg: float = 2.0
    spread_deg: float = 1.5

    def __post_init__(self) -> None:
        rng = self.rng
        self._cycle_s = self.duration_s / max(1, round(self.duration_s / _CYCLE_S))
        self._living = LivingPose(rng, self.joint_deg, self.spread_deg)
        self._sway = Wander(rng, 6, (1.0, 3.0))
        self._side = 1.0 if self.model.side == "R" else -1.0
        down = np.deg2rad(_CAMERA_DOWN_DEG + rng.uniform(-4.0, 4.0))
        self._up = np.array([0.0, -np.cos(down), -np.sin(down)])
        scale = self.model.length_m / _USUAL_LENGTH_M
        self._height = _HEIGHT_M * scale
        self._foot = np.array([self._side * rng.uniform(0.0, 0.05), 0.11, rng.uniform(0.66, 0.80)])
        self._pour = self._side * np.deg2rad(_POUR_DEG + rng.uniform(-8.0, 8.0))
        self._grasp = grasp_of(self.model)
        self._bottle = bottle(self._grasp.radius_m, self._height)
        self._table = table(self._up, self._foot)
        self._held = self._held_transform()

    def _held_transform(self) -> RigidTransform:
        """Depth camera from hand, closed round the standing bottle: thumb up, back to the camera."""
        x = -self._side * self._up
        toward = np.array([0.0, 0.0, -1.0])
        z = toward - x * (toward @ x)
        z /= np.linalg.norm(z)
        rotation = np.stack([x, np.cross(z, x), z], axis=1)
        axis_at = np.array([0.0, self._grasp.y_m, self._grasp.z_m])
        middle = self._foot + _GRASP_SHARE * self._height * self._up
        return RigidTransform(rotation, middle - rotation @ axis_at)

    def at(self, time_s: float) -> HandMoment:
        """Hand, bottle and table at a moment."""
        s = (time_s % self._cycle_s) / self._cycle_s

        def done(span: tuple[float, float]) -> float:
            return eased((s - span[0]) / (span[1] - span[0]))

        away = 1.0 - done(_REACH) + done(_LEAVE)
        grip = (s - _CLOSE[0]) / (_CLOSE[1] - _CLOSE[0])
        free = (s - _OPEN[0]) / (_OPEN[1] - _OPEN[0])
        share = float(np.clip(grip, 0, 1) - np.clip(free, 0, 1))
        name = "grip" if share >= 1.0 else "open" if share <= 0.0 else None
        pose = blended(CONFIGURATIONS["open"], CONFIGURATIONS["grip"], share)
        lift = _LIFT_M * (done(_LIFT) - done(_LOWER))
        turn = rotation_about((0, 0, 1), self._pour * (done(_POUR) - done(_BACK)))
        carried = 1.0 if _LIFT[0] <= s <= _LOWER[1] else 0.0
        centre = self._held.translation
        moved = RigidTransform(turn, centre - turn @ centre + lift * self._up)
        tremble = carried * min(lift / _LIFT_M, 1.0)
        sway = self._sway.at(time_s)
        moved = RigidTransform(moved.rotation, moved.translation + 0.004 * tremble * sway[:3])
        held = self._held
        back = away * (held.rotation @ np.array([0.0, -0.07, 0.05]))
        hand = RigidTransform(held.rotation, held.translation + back + 0.003 * away * sway[3:])
        standing = placed(self._bottle, upright(self._up, self._foot))
        things = (placed(standing, moved), self._table)
        return replace(
            HandMoment(name, self._living.at(pose, time_s), moved @ hand, things),
            remark="holds the bottle" if name == "grip" else "",
        )
