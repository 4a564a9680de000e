"""How hands move: where a hand is and what it does at any moment, without jumps.

Every motion is a function of time alone, made of a seed. Nothing here knows how hands are tracked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.capture.transform import RigidTransform
from core.hand.names import FINGERS
from devices.simulator.body import rotation_about
from devices.simulator.hands.model import CONFIGURATIONS, FingerAngles, HandPose
from devices.simulator.hands.scene import Thing

FloatArray = NDArray[np.float64]

EXPOSURE_S = 0.006
"""How long a picture is exposed in a well-lit room."""

_TOWARD_CAMERA = np.diag([1.0, -1.0, -1.0])
_THUMB_WAITS = 0.3


@dataclass(frozen=True, eq=False)
class HandMoment:
    """A hand at one moment.

    Attributes
    ----------
    configuration : str or None
        What it does; None between two configurations.
    pose : HandPose
    depth_from_hand : RigidTransform
    things : tuple of Thing
        What else is there, depth-camera frame.
    exposure_s : float
        Of the colour picture.
    remark : str
        What is done to the hand in this frame, in words; empty in most.
    """

    configuration: str | None
    pose: HandPose
    depth_from_hand: RigidTransform
    things: tuple[Thing, ...] = ()
    exposure_s: float = EXPOSURE_S
    remark: str = ""


class HandMotion(Protocol):
    """What a hand does, from time 0 on."""

    def at(self, time_s: float) -> HandMoment:
        """The hand at a moment."""


def eased(share: float) -> float:
    """0 to 1 without jerk at the ends; constant outside."""
    s = min(max(share, 0.0), 1.0)
    return s * s * s * (s * (6.0 * s - 15.0) + 10.0)


def facing(roll_rad: float, tilt_rad: float, turn_rad: float) -> FloatArray:
    """Rotation (3, 3) of a hand whose back looks at the camera, fingers up, turned about z, x and y."""
    return np.asarray(
        rotation_about((0, 0, 1), roll_rad)
        @ rotation_about((1, 0, 0), tilt_rad)
        @ rotation_about((0, 1, 0), turn_rad)
        @ _TOWARD_CAMERA
    )


class Wander:
    """Smooth noise of unit variance: three sines each, of seeded frequency and phase.

    Parameters
    ----------
    rng : Generator
    count : int
        Values.
    period_s : tuple of float
        Shortest and longest period.
    """

    def __init__(
        self, rng: np.random.Generator, count: int, period_s: tuple[float, float] = (1.2, 4.0)
    ) -> None:
        self._omega = 2 * np.pi / rng.uniform(*period_s, (3, count))
        self._phase = rng.uniform(0.0, 2 * np.pi, (3, count))

    def at(self, time_s: float) -> FloatArray:
        """Values (count,)."""
        waves = np.sin(self._omega * time_s + self._phase)
        return np.asarray(np.sqrt(2.0 / 3.0) * waves.sum(axis=0))


class LivingPose:
    """A pose as a living hand keeps it: every joint drifts a little and slowly.

    Parameters
    ----------
    rng : Generator
    joint_deg, spread_deg : float
        Standard deviations over time.
    """

    def __init__(self, rng: np.random.Generator, joint_deg: float, spread_deg: float) -> None:
        self._wander = Wander(rng, 3 * len(FINGERS))
        self._scale = np.array([joint_deg, joint_deg, spread_deg])

    def at(self, pose: HandPose, time_s: float) -> dict[str, FingerAngles]:
        """The pose at a moment."""
        drift = self._wander.at(time_s).reshape(-1, 3) * self._scale
        out = {}
        for (base, bend, spread), finger in zip(drift, FINGERS, strict=True):
            a = pose[finger]
            out[finger] = FingerAngles(a.base + base, a.middle + bend, a.end + 0.6 * bend, a.spread + spread)
        return out


def blended(start: HandPose, end: HandPose, share: float) -> dict[str, FingerAngles]:
    """Pose between two; a thumb that closes comes last, one that opens goes first."""
    closing = end["thumb"].middle - start["thumb"].middle
    first, last = share / (1.0 - _THUMB_WAITS), (share - _THUMB_WAITS) / (1.0 - _THUMB_WAITS)
    out = {}
    for finger in FINGERS:
        part = share
        if closing > 1.0:
            part = last if finger == "thumb" else first
        elif closing < -1.0:
            part = first if finger == "thumb" else last
        s, a, b = eased(part), start[finger], end[finger]
        out[finger] = FingerAngles(
            a.base + s * (b.base - a.base),
            a.middle + s * (b.middle - a.middle),
            a.end + s * (b.end - a.end),
            a.spread + s * (b.spread - a.spread),
        )
    return out


@dataclass(frozen=True)
class Programme:
    """Which configuration when: each is held, then blends into the next, round and round.

    Attributes
    ----------
    names : sequence of str
    hold_s, blend_s : float
    """

    names: Sequence[str]
    hold_s: float
    blend_s: float = 0.4

    def at(self, time_s: float) -> tuple[str | None, dict[str, FingerAngles]]:
        """Configuration (None while it changes) and pose."""
        period = self.hold_s + self.blend_s
        k = int(time_s // period)
        start = self.names[k % len(self.names)]
        end = self.names[(k + 1) % len(self.names)]
        share = (time_s - k * period - self.hold_s) / self.blend_s
        if share <= 0.0 or start == end:
            return start, dict(CONFIGURATIONS[start])
        return None, blended(CONFIGURATIONS[start], CONFIGURATIONS[end], share)


@dataclass(frozen=True)
class Room:
    """Where a hand may go before the camera.

    Attributes
    ----------
    half_view : tuple of float
        Half of the view at 1 m distance, across and along, metres.
    reach_m : float
        How far hand and fingers reach from the middle of the back of the hand.
    """

    half_view: tuple[float, float] = (0.60, 0.45)
    reach_m: float = 0.125

    def place(self, share: FloatArray, z_m: float) -> FloatArray:
        """Place (3,) at a distance; ``share`` (2,) of -1 to 1 goes through all of the view."""
        free = np.maximum(np.array(self.half_view) * z_m - self.reach_m, 0.0)
        return np.array([*(np.clip(share, -1.0, 1.0) * free), z_m])


class _Pendulum:
    """Values that swing through -1 to 1 and back, never twice alike."""

    def __init__(self, rng: np.random.Generator, periods_s: Sequence[tuple[float, float]]) -> None:
        slow = np.array([rng.uniform(*p) for p in periods_s])
        self._omega = 2 * np.pi / np.stack([slow, slow / rng.uniform(1.6, 1.9, len(slow))])
        self._phase = rng.uniform(0.0, 2 * np.pi, self._omega.shape)

    def at(self, time_s: float) -> FloatArray:
        waves = np.sin(self._omega * time_s + self._phase)
        return np.asarray(0.72 * waves[0] + 0.28 * waves[1])


@dataclass(eq=False)
class LargeDisplacements:
    """The hand goes quickly through the whole view, 0.5 to 1 m deep, and turns (thesis, figure 16)."""

    programme: Programme
    rng: np.random.Generator
    joint_deg: float = 4.0
    spread_deg: float = 2.5
    room: Room = field(default_factory=Room)
    distance_m: tuple[float, float] = (0.5, 1.0)
    roll_deg: float = 45.0
    tilt_deg: float = 25.0

    def __post_init__(self) -> None:
        self._living = LivingPose(self.rng, self.joint_deg, self.spread_deg)
        periods = [(2.4, 3.2), (2.0, 2.8), (3.6, 4.8), (2.6, 3.6), (2.4, 3.6), (2.4, 3.6)]
        self._swing = _Pendulum(self.rng, periods)

    def at(self, time_s: float) -> HandMoment:
        """The hand at a moment."""
        name, pose = self.programme.at(time_s)
        x, y, depth, roll, tilt, turn = self._swing.at(time_s)
        near, far = self.distance_m
        place = self.room.place(np.array([x, y]), 0.5 * (near + far) + 0.5 * (far - near) * depth)
        rotation = facing(
            np.deg2rad(self.roll_deg * roll),
            np.deg2rad(self.tilt_deg * tilt),
            np.deg2rad(self.tilt_deg * turn),
        )
        return HandMoment(name, self._living.at(pose, time_s), RigidTransform(rotation, place))


@dataclass(eq=False)
class Hovering:
    """A hand held before the camera, never quite still, while its configurations follow a programme."""

    programme: Programme
    rng: np.random.Generator
    joint_deg: float = 4.0
    spread_deg: float = 2.5
    distance_m: tuple[float, float] = (0.55, 0.85)
    aside_m: float = 0.02
    roll_deg: float = 12.0
    tilt_deg: float = 9.0
    drift_s: tuple[float, float] = (2.0, 6.0)

    def __post_init__(self) -> None:
        rng = self.rng
        self._living = LivingPose(rng, self.joint_deg, self.spread_deg)
        self._drift = Wander(rng, 6, self.drift_s)
        self._place = np.array([*rng.uniform(-0.04, 0.04, 2), rng.uniform(*self.distance_m)])
        self._angles = np.deg2rad(rng.uniform(-1.0, 1.0, 3) * (20.0, 10.0, 10.0))

    @property
    def base(self) -> RigidTransform:
        """Where the hand is without its drift."""
        return RigidTransform(facing(*(float(a) for a in self._angles)), self._place)

    def at(self, time_s: float) -> HandMoment:
        """The hand at a moment."""
        name, pose = self.programme.at(time_s)
        drift = self._drift.at(time_s)
        place = self._place + drift[:3] * (self.aside_m, self.aside_m, self.aside_m)
        turned = self._angles + 0.5 * np.deg2rad(drift[3:] * (self.roll_deg, self.tilt_deg, self.tilt_deg))
        transform = RigidTransform(facing(*(float(a) for a in turned)), place)
        return HandMoment(name, self._living.at(pose, time_s), transform)
