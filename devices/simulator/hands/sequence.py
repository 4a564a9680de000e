"""Sequences of a hand with a marker: continuous in time, the same again for the same seed, with their truth.

What is made up, and simpler than nature
----------------------------------------
The skin follows the finger bones by linear blend skinning: no tendons, no nails, no wrinkles, and bent
fingers lose some volume. The marker is printed on the skin, straight from above, and bends with it: it is not
a stiff card, and where the back of the hand slopes it is stretched by a few percent. Light
comes from one lamp and from the camera's side; nothing shades anything else and no light goes from thing to
thing. Depth and colour are taken at the same moment; motion blurs the colour picture as a whole, along the
motion of the back of the hand, and the depth frame not at all. Fingers and things are rigid where they
touch. Figures measured on these sequences compare methods; they are not those of real hands.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from devices.simulator.hands.bottle_motion import Bottle
from devices.simulator.hands.disturbed import MarkerLost, Occluded
from devices.simulator.hands.model import CONFIGURATIONS, load_hand
from devices.simulator.hands.motions import (
    HandMoment,
    HandMotion,
    Hovering,
    LargeDisplacements,
    Programme,
    Room,
)
from devices.simulator.hands.scene import HandFrame, HandView, take_frame
from devices.simulator.hands.shots import HandVariation, Holder
from devices.simulator.room import SimulatedRig, make_rig

FloatArray = NDArray[np.float64]

SEQUENCES = ("large-displacements", "configurations", "occlusion", "bottle", "marker-lost")
"""Kinds of sequences."""

USUAL_FRAMES = {
    "large-displacements": 162,
    "configurations": 240,
    "occlusion": 250,
    "bottle": 240,
    "marker-lost": 280,
}
"""Frames in which everything of a kind is shown once at 30 Hz; 162 is the thesis's figure 16."""

RATE_HZ = 30.0
_SHORTEST_HOLD_S, _LONGEST_HOLD_S, _BLEND_S = 0.25, 2.0, 0.4
_SLOW_HOLD_S = 2.5


def checked_configurations(names: Sequence[str]) -> tuple[str, ...]:
    """The names, if a simulated hand has all these configurations.

    Raises
    ------
    InputError
    """
    for name in names:
        if name not in CONFIGURATIONS:
            raise InputError(
                f"A simulated hand has no configuration '{name}'.",
                f"Choose among: {', '.join(CONFIGURATIONS)}.",
            )
    return tuple(names)


def checked_kind(kind: str) -> str:
    """The kind, if there is a sequence of this kind.

    Raises
    ------
    InputError
    """
    if kind not in SEQUENCES:
        raise InputError(
            f"There is no simulated sequence called '{kind}'.", f"Choose one of: {', '.join(SEQUENCES)}."
        )
    return kind


def hand_motion(
    kind: str,
    holder: Holder,
    duration_s: float,
    *,
    seed: int = 0,
    configurations: Sequence[str] = (),
    rate_hz: float = RATE_HZ,
    variation: HandVariation | None = None,
) -> HandMotion:
    """The motion of a kind of sequence.

    Parameters
    ----------
    kind : one of `SEQUENCES`
    holder : Holder
    duration_s : float
        How long it will be watched; "configurations" shows all of them in this time.
    seed : int
        Of everything about the motion.
    configurations : sequence of str
        Those that are shown; empty for all with "configurations", for "open" with the others. A "bottle" is
        always taken from "open" to "grip".
    rate_hz : float
        Frames per second: the runs of "marker-lost" are counted in frames.
    variation : HandVariation, optional
        Its joint angles' and spread's standard deviations over time.

    Raises
    ------
    InputError
        For a kind or configuration that does not exist.
    """
    checked_kind(kind)
    names = checked_configurations(configurations)
    usual = variation or HandVariation()
    rng = np.random.default_rng((0x5E9, SEQUENCES.index(kind), seed, holder.seed))
    model = load_hand(holder.shape, holder.side)
    if kind == "bottle":
        return Bottle(model, rng, duration_s, 0.5 * usual.joint_deg, 0.5 * usual.spread_deg)
    if kind == "configurations":
        order = [str(name) for name in rng.permutation(np.array(names or tuple(CONFIGURATIONS)))]
        hold = float(np.clip(duration_s / len(order) - _BLEND_S, _SHORTEST_HOLD_S, _LONGEST_HOLD_S))
        return Hovering(Programme(order, hold, _BLEND_S), rng, usual.joint_deg, usual.spread_deg)
    slow = Programme(names or ("open",), _SLOW_HOLD_S, 2 * _BLEND_S)
    if kind == "large-displacements":
        reach = 0.125 * model.length_m / load_hand().length_m
        return LargeDisplacements(slow, rng, usual.joint_deg, usual.spread_deg, Room(reach_m=reach))
    hovering = Hovering(slow, rng, usual.joint_deg, usual.spread_deg)
    if kind == "occlusion":
        return Occluded(
            replace(hovering, roll_deg=5.0, tilt_deg=5.0, aside_m=0.008), model, rng, holder.tone()
        )
    return MarkerLost(hovering, rng, rate_hz)


def view_at(
    motion: HandMotion, time_s: float, holder: Holder, rig: SimulatedRig, *, wall_m: float = 1.4
) -> tuple[HandView, HandMoment]:
    """What the cameras see of a motion at a moment, with the blur of the motion."""
    moment = motion.at(time_s)
    model = load_hand(holder.shape, holder.side)
    view = HandView(
        model,
        model.posed(moment.pose),
        moment.depth_from_hand,
        holder.sheet(),
        moment.things,
        wall_m,
        holder.tone(),
    )
    length, turn = _blur(motion, time_s, moment, rig)
    return replace(view, blur_px=length, blur_turn_rad=turn), moment


def _blur(motion: HandMotion, time_s: float, moment: HandMoment, rig: SimulatedRig) -> tuple[float, float]:
    """Length and direction of the way that the hand's middle makes in the picture while it is exposed."""
    after = motion.at(time_s + 0.5 * moment.exposure_s).depth_from_hand.translation
    before = motion.at(max(time_s - 0.5 * moment.exposure_s, 0.0)).depth_from_hand.translation
    pixels = rig.color.project(rig.color_from_depth.apply(np.stack([before, after])))
    way = pixels[1] - pixels[0]
    return float(np.hypot(*way)), float(np.arctan2(way[1], way[0]))


def hand_sequence(
    kind: str,
    holder: Holder,
    frames: int | None = None,
    *,
    seed: int = 0,
    configurations: Sequence[str] = (),
    rate_hz: float = RATE_HZ,
    rig: SimulatedRig | None = None,
    variation: HandVariation | None = None,
    wall_m: float = 1.4,
) -> Iterator[HandFrame]:
    """Frames of a sequence one by one; the same arguments give the same frames.

    Parameters
    ----------
    frames : int, optional
        `USUAL_FRAMES` of the kind if not given.
    rig : SimulatedRig, optional
        Kinect v1 with its own colour camera if not given.
    wall_m : float
        Distance of the background; 0 for none.

    Others: see `hand_motion`.
    """
    if kind in SEQUENCES and frames is None:
        frames = USUAL_FRAMES[kind]
    count = frames or 0
    motion = hand_motion(
        kind,
        holder,
        count / rate_hz,
        seed=seed,
        configurations=configurations,
        rate_hz=rate_hz,
        variation=variation,
    )
    used = rig or make_rig((640, 480), device_seed=holder.seed)
    return _taken(motion, holder, used, count, seed, rate_hz, wall_m)


def _taken(
    motion: HandMotion,
    holder: Holder,
    rig: SimulatedRig,
    count: int,
    seed: int,
    rate_hz: float,
    wall_m: float,
) -> Iterator[HandFrame]:
    for number in range(count):
        time_s = number / rate_hz
        view, moment = view_at(motion, time_s, holder, rig, wall_m=wall_m)
        frame = take_frame(view, rig, np.random.default_rng((0x5EA, seed, holder.seed, number)))
        yield replace(frame, configuration=moment.configuration, time_s=time_s, remark=moment.remark)


def training_frames(
    holder: Holder,
    frames: int,
    *,
    seed: int = 0,
    configurations: Sequence[str] = (),
    rig: SimulatedRig | None = None,
    variation: HandVariation | None = None,
    rate_hz: float = RATE_HZ,
) -> Iterator[HandFrame]:
    """Single frames for training, no two alike: every configuration (all if none is named) in turn."""
    from devices.simulator.hands.shots import shoot

    names = checked_configurations(configurations) or tuple(CONFIGURATIONS)
    used = rig or make_rig((640, 480), device_seed=holder.seed)
    for number in range(frames):
        name = names[number % len(names)]
        frame = shoot(holder, name, seed * 100_000 + number, variation=variation, rig=used)
        yield replace(frame, configuration=name, time_s=number / rate_hz)


__all__ = [
    "RATE_HZ", "SEQUENCES", "USUAL_FRAMES", "checked_configurations", "hand_motion",
    "hand_sequence", "training_frames", "view_at",
]  # fmt: skip
