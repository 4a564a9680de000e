"""Hands in trouble: something passes before the fingers, or the marker cannot be read for some frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.capture.transform import RigidTransform
from devices.simulator.body import rotation_about
from devices.simulator.hands.model import HandModel
from devices.simulator.hands.motions import HandMoment, Hovering, eased
from devices.simulator.hands.scene import Thing
from devices.simulator.hands.things import bar, cup, other_hand, placed

FloatArray = NDArray[np.float64]

_PASS_S, _PAUSE_S = 2.2, 0.5
_HALF_WAY_M = 0.16

_LOST_AFTER_S, _LOST_EVERY_S = 0.7, 0.5
_SHAKE_M, _SHAKE_HZ, _DARK_EXPOSURE_S = 0.026, 5.0, 0.033
_BEYOND_DEG = 78.0
_RAMP_FRAMES = 4


@dataclass(eq=False)
class Occluded:
    """Bar, another hand and a cup pass in turn before the fingers of a hand, from one side to the other.

    The bar and the other hand come from beyond the fingertips and end short of the marker; the cup passes
    across the fingers.
    """

    hand: Hovering
    model: HandModel
    rng: np.random.Generator
    tone: int = 1

    def __post_init__(self) -> None:
        rng = self.rng
        self._order = rng.permutation(3)
        self._gap_m = rng.uniform(0.06, 0.14, 8)
        self._lean_rad = np.deg2rad(rng.uniform(-12.0, 12.0, 8))
        self._way = rng.choice((-1.0, 1.0))
        other = "L" if self.model.side == "R" else "R"
        reach = self.model.length_m
        # in the frame of the hand that is hidden: y toward its fingertips, z toward the camera
        point_back = RigidTransform(np.diag([-1.0, -1.0, 1.0]), np.array([0.0, 0.85 * reach, 0.0]))
        lying = RigidTransform(rotation_about((1, 0, 0), -np.pi / 2), np.array([0.0, 0.25 * reach, 0.0]))
        begin = RigidTransform(np.eye(3), np.array([0.0, 0.24 * reach, 0.0]))
        self._passing: list[tuple[str, Thing]] = [
            ("a bar", placed(bar(), begin)),
            ("another hand", other_hand(self.model.body.shape, other, self.tone, hand=point_back)),
            ("a cup", placed(cup(), lying)),
        ]

    def at(self, time_s: float) -> HandMoment:
        """The hand and what passes before it at a moment."""
        moment = self.hand.at(time_s)
        period = _PASS_S + _PAUSE_S
        k = int(time_s // period)
        share = (time_s - k * period - _PAUSE_S) / _PASS_S
        if share <= 0.0:
            return moment
        words, thing = self._passing[self._order[k % 3]]
        way = self._way if k % 2 == 0 else -self._way
        aside = way * _HALF_WAY_M * (1.0 - 2.0 * share)
        lean = rotation_about((0, 0, 1), float(self._lean_rad[k % 8]))
        passing = self.hand.base @ RigidTransform(lean, np.array([aside, 0.0, float(self._gap_m[k % 8])]))
        return replace(moment, things=(placed(thing, passing),), remark=f"{words} passes")


@dataclass(frozen=True)
class _Loss:
    begin_s: float
    frames: int
    how: str


@dataclass(eq=False)
class MarkerLost:
    """The marker cannot be read for runs of 1 to 10 frames, and for two longer ones.

    Two causes take turns: the hand shakes in a circle while the picture is exposed long (blur), and the
    forearm turns until the back of the hand is seen almost edge-on. Whether a detector really finds nothing
    then is up to the detector: the remark of a frame says what was done, not what could be read.
    """

    hand: Hovering
    rng: np.random.Generator
    rate_hz: float = 30.0

    def __post_init__(self) -> None:
        lengths = [*self.rng.permutation(np.arange(1, 11)), 16, 24]
        self._losses: list[_Loss] = []
        begin = _LOST_AFTER_S
        for number, frames in enumerate([int(n) for n in lengths]):
            self._losses.append(_Loss(begin, frames, ("blur", "tilt")[number % 2]))
            begin += frames / self.rate_hz + _LOST_EVERY_S
        self._period_s = begin
        self._phase = float(self.rng.uniform(0.0, 2 * np.pi))
        self._sense = float(self.rng.choice((-1.0, 1.0)))

    def at(self, time_s: float) -> HandMoment:
        """The hand at a moment."""
        moment = self.hand.at(time_s)
        within = time_s % self._period_s
        for loss in self._losses:
            strength = self._strength(loss, within)
            if strength > 0.0:
                return self._troubled(moment, loss, within, strength)
        return moment

    def _strength(self, loss: _Loss, time_s: float) -> float:
        """0 to 1 over a few frames, 1 in the frames of the run, 0 again."""
        ramp = _RAMP_FRAMES / self.rate_hz
        # half a frame of room on both sides: the frames of the run lie inside
        before = loss.begin_s - 0.5 / self.rate_hz - time_s
        after = time_s - (loss.begin_s + (loss.frames - 0.5) / self.rate_hz)
        return eased(1.0 - max(before, after, 0.0) / ramp)

    def _troubled(self, moment: HandMoment, loss: _Loss, time_s: float, strength: float) -> HandMoment:
        full = strength >= 1.0
        pose = moment.depth_from_hand
        if loss.how == "blur":
            angle = 2 * np.pi * _SHAKE_HZ * (time_s - loss.begin_s) + self._phase
            shake = strength * _SHAKE_M * np.array([np.cos(angle), np.sin(angle), 0.0])
            return replace(
                moment,
                depth_from_hand=RigidTransform(pose.rotation, pose.translation + shake),
                exposure_s=_DARK_EXPOSURE_S if full else moment.exposure_s,
                remark="blurred" if full else "",
            )
        # the forearm turns about its own axis: the back of the hand looks to the side
        tilt = rotation_about((0, 1, 0), self._sense * strength * np.deg2rad(_BEYOND_DEG))
        return replace(
            moment,
            depth_from_hand=RigidTransform(pose.rotation @ tilt, pose.translation),
            remark="tilted" if full else "",
        )
