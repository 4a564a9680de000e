"""Hands held before the camera as people hold them: no two frames alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.capture.transform import RigidTransform
from core.errors import InputError
from core.hand.marker import dictionaries
from devices.simulator.body import SHAPES, rotation_about
from devices.simulator.hands.model import CONFIGURATIONS, FingerAngles, HandPose, load_hand
from devices.simulator.hands.scene import HandFrame, HandView, MarkerSheet, Thing, take_frame
from devices.simulator.room import SimulatedRig, make_rig

FloatArray = NDArray[np.float64]

_MARKER_M = (0.01, 0.08)
_TOWARD_CAMERA = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class HandVariation:
    """What differs from frame to frame.

    Attributes
    ----------
    joint_deg : float
        Standard deviation of every finger joint's flexion.
    spread_deg : float
        Of the spread between fingers.
    tilt_deg : float
        Largest tilt of the back of the hand away from the camera, each way.
    roll_deg : float
        Largest turn in the picture, each way.
    distance_m : tuple of float
        Nearest and farthest.
    aside_m : float
        Largest way from the middle of the picture, across and along.
    """

    joint_deg: float = 4.0
    spread_deg: float = 2.5
    tilt_deg: float = 22.0
    roll_deg: float = 35.0
    distance_m: tuple[float, float] = (0.55, 0.85)
    aside_m: float = 0.05


@dataclass(frozen=True)
class Holder:
    """Whose hand it is, and how the marker sits on it for a whole session.

    Attributes
    ----------
    shape, side : str
    seed : int
        Of skin tone and of the marker's place: up to 4 mm and 6 degrees off, never twice the same.
    marker_m : float
        Side of the marker; 0 for a hand without one.
    dictionary : str
        Of the marker, name in cv2.aruco.
    """

    shape: str = "m_young_avg"
    side: str = "R"
    seed: int = 0
    marker_m: float = 0.036
    dictionary: str = "DICT_4X4_50"

    def sheet(self) -> tuple[MarkerSheet, ...]:
        """The marker as it was stuck on."""
        if self.marker_m <= 0:
            return ()
        rng = np.random.default_rng((0x4A2D, self.seed))
        shift = rng.uniform(-0.004, 0.004, 2)
        turn = float(rng.uniform(-6.0, 6.0))
        size = load_hand(self.shape, self.side).length_m / load_hand("m_young_avg", self.side).length_m
        return (
            MarkerSheet(
                self.marker_m,
                dictionary=self.dictionary,
                turn_deg=turn,
                shift_m=(float(shift[0]) * size, float(shift[1]) * size),
            ),
        )

    def tone(self) -> int:
        """Row of the skin tones."""
        return int(np.random.default_rng((0x70E, self.seed)).integers(0, 5))


def checked_holder(holder: Holder) -> Holder:
    """The holder, if there can be one like this.

    Raises
    ------
    InputError
    """
    if holder.shape not in SHAPES:
        raise InputError(
            f"There is no simulated body called '{holder.shape}'.", f"Choose one of: {', '.join(SHAPES)}."
        )
    if holder.side not in ("R", "L"):
        raise InputError("A hand is R or L.")
    if not 0 <= holder.seed < 2**31:
        raise InputError("The seed of a simulated hand is 0 to 2147483647.")
    if holder.marker_m != 0 and not _MARKER_M[0] <= holder.marker_m <= _MARKER_M[1]:
        raise InputError(
            f"A simulated hand's marker has a side of {_MARKER_M[0]} to {_MARKER_M[1]} m.", "0 is for none."
        )
    if holder.dictionary not in dictionaries():
        raise InputError(f"There is no ArUco dictionary '{holder.dictionary}'.")
    return holder


def varied(pose: HandPose, rng: np.random.Generator, variation: HandVariation) -> dict[str, FingerAngles]:
    """The pose as a person repeats it: joints a little different each time, middle and end joint together."""
    out = {}
    for finger, angles in pose.items():
        base, bend, spread = rng.normal(0.0, (variation.joint_deg, variation.joint_deg, variation.spread_deg))
        out[finger] = FingerAngles(
            angles.base + base, angles.middle + bend, angles.end + 0.6 * bend, angles.spread + spread
        )
    return out


def hand_view(
    holder: Holder,
    configuration: str | HandPose,
    rng: np.random.Generator,
    variation: HandVariation | None = None,
    *,
    wall_m: float = 1.4,
) -> HandView:
    """One view of a hand in a configuration.

    Raises
    ------
    InputError
        If there is no such configuration.
    """
    variation = variation or HandVariation()
    if isinstance(configuration, str):
        if configuration not in CONFIGURATIONS:
            raise InputError(
                f"A simulated hand has no configuration '{configuration}'.",
                f"Choose one of: {', '.join(CONFIGURATIONS)}.",
            )
        pose: HandPose = CONFIGURATIONS[configuration]
    else:
        pose = configuration
    model = load_hand(holder.shape, holder.side)
    vertices = model.posed(varied(pose, rng, variation))
    tilt = np.deg2rad(rng.uniform(-variation.tilt_deg, variation.tilt_deg, 2))
    roll = np.deg2rad(rng.uniform(-variation.roll_deg, variation.roll_deg))
    rotation = (
        rotation_about((0, 0, 1), float(roll))
        @ rotation_about((1, 0, 0), float(tilt[0]))
        @ rotation_about((0, 1, 0), float(tilt[1]))
        @ _TOWARD_CAMERA
    )
    aside = rng.uniform(-variation.aside_m, variation.aside_m, 2)
    place = np.array([aside[0], aside[1], rng.uniform(*variation.distance_m)])
    return HandView(
        model, vertices, RigidTransform(rotation, place), holder.sheet(), wall_m=wall_m, tone=holder.tone()
    )


def shoot(
    holder: Holder,
    configuration: str,
    seed: int,
    *,
    variation: HandVariation | None = None,
    rig: SimulatedRig | None = None,
    blur_px: float = 0.0,
    things: tuple[Thing, ...] = (),
) -> HandFrame:
    """One frame; the same arguments give the same frame."""
    rng = np.random.default_rng((0x5407, seed, holder.seed))
    view = hand_view(holder, configuration, rng, variation)
    view = replace(view, blur_px=blur_px, things=things)
    frame = take_frame(view, rig or make_rig((640, 480), device_seed=holder.seed), rng)
    return replace(frame, configuration=configuration)


def shoot_nobody(
    seed: int = 0, *, rig: SimulatedRig | None = None, things: tuple[Thing, ...] = (), wall_m: float = 1.4
) -> HandFrame:
    """One frame without any hand: the wall, and the things given. It has no points."""
    hand = load_hand()
    behind = RigidTransform(np.eye(3), np.array([0.0, 0.0, -5.0]))
    view = HandView(hand, hand.reference, behind, (), things, wall_m)
    rng = np.random.default_rng((0x5408, seed))
    frame = take_frame(view, rig or make_rig((640, 480), device_seed=seed), rng)
    return replace(frame, points_m={}, visible={})
