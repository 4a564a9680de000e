"""Pairs of captures of simulated people that accuracy is measured on: who, how, what happened in between.

The pairs are frozen. Pair number i of a split follows from a rule without choice: the shapes of the split
take turns; every other pair (shifted by one each time all shapes have had their turn) asks for the same
stance twice; stance, view, turn, camera distance, weight, number of moles, new and vanished moles, clothes,
body hair, healed lesions and missing limbs each run through a list of their own, of different lengths. Where
a list's length divides the number of shapes it moves on by one each turn, so that no shape keeps its entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from devices.simulator.patient import SimulatedPatient
from devices.simulator.room import DEMANDING, SimulatedRig, VisitChange
from devices.simulator.shapes import CALIBRATION_SHAPES, TEST_SHAPES, TUNING_SHAPES
from devices.simulator.skin import Wardrobe
from devices.simulator.truth import SimulatedCapture

_T = TypeVar("_T")

_STANCES = ("psi", "A", "hip_hands", "T", "down", "forward", "twist", "up", "knee", "sidebend")
_FIRST_STANCES = ("psi", "A", "down")
_VIEWS = ("front", "front", "back")
_TURNS_DEG = (0.0, 10.0, -10.0, 0.0, 20.0, -20.0, 5.0)
_FOLLOWUP_DISTANCES_M = (None, None, 2.8, None, 1.8)
_WEIGHT_CHANGES = (0.0, 0.02, -0.02, 0.05, 0.0, -0.03, 0.03, 0.0, -0.05, 0.04, 0.0)
_MOLES = (180, 60, 300, 180, 120, 480, 180, 240, 60, 360, 180, 120, 480)
_NEW_AND_VANISHED = ((3, 2), (0, 4), (5, 0), (2, 6))
_HAIR = (0.0, 0.6, 0.0, 1.0, 0.3)
_BRIEFS_EVERY, _HEALED_EVERY, _MISSING_EVERY = 9, 8, 17
_MISSING_LIMBS = ("left_forearm", "right_lower_leg")
_HEALED = ("L02", "L03", "L05", "L06", "L08", "L09")


@dataclass(frozen=True)
class SimulatedPair:
    """Two captures of one person at two visits.

    Attributes
    ----------
    shape : str
        One of `devices.simulator.shapes.SHAPES`.
    seed : int
        Of the person and of everything that nature varies.
    first, followup : str
        Stances.
    turn_deg : float
        Turn of the patient at the follow-up, toward the patient's own left.
    distance_m, followup_distance_m : float or None
        Camera to patient; None: 2.3 m, or farther if the whole patient needs it.
    view : str
        The side that the camera sees both times.
    moles, lesions : int
        Moles in all, and how many of them are lesions of interest.
    weight_change : float
        Change of the body's volume in between, for example 0.05.
    new_moles, vanished : int
        Moles that came and went in between.
    missing : tuple of str
        Amputated limbs, see `devices.simulator.amputation.LIMBS`.
    wardrobe : Wardrobe or None
        None: shorts, and a sports top for women and girls.
    healed : tuple of str
        Lesions of interest that have healed in between and left a pale scar.
    body_hair : float
        0 for none to 1.
    """

    shape: str
    seed: int
    first: str
    followup: str
    turn_deg: float = 0.0
    distance_m: float | None = None
    followup_distance_m: float | None = None
    view: str = "front"
    moles: int = 180
    lesions: int = 40
    weight_change: float = 0.0
    new_moles: int = 3
    vanished: int = 2
    missing: tuple[str, ...] = ()
    wardrobe: Wardrobe | None = None
    healed: tuple[str, ...] = ()
    body_hair: float = 0.0

    @property
    def group(self) -> str:
        """Whether the person stands the same way both times: "same stance" or "other stance"."""
        return "same stance" if self.first == self.followup else "other stance"


def _take(values: Sequence[_T], number: int, shapes: tuple[str, ...]) -> _T:
    shift = number // len(shapes) if len(shapes) % len(values) == 0 else 0
    return values[(number + shift) % len(values)]


def _pair(shapes: tuple[str, ...], number: int, first_seed: int) -> SimulatedPair:
    """Pair of a split by the rule above."""
    shape, turn_of_all = shapes[number % len(shapes)], number // len(shapes)
    if (number + turn_of_all) % 2 == 0:
        first = followup = _STANCES[(number // 2) % len(_STANCES)]
    else:
        first = _FIRST_STANCES[number % len(_FIRST_STANCES)]
        others = [stance for stance in _STANCES if stance != first]
        followup = others[(number // 2) % len(others)]
    came, went = _take(_NEW_AND_VANISHED, number, shapes)
    hairy = shape.startswith("m_")
    return SimulatedPair(
        shape,
        first_seed + number,
        first,
        followup,
        turn_deg=_take(_TURNS_DEG, number, shapes),
        followup_distance_m=_take(_FOLLOWUP_DISTANCES_M, number, shapes),
        view=_take(_VIEWS, number, shapes),
        moles=_take(_MOLES, number, shapes),
        weight_change=_take(_WEIGHT_CHANGES, number, shapes),
        new_moles=came,
        vanished=went,
        missing=(_MISSING_LIMBS[number // _MISSING_EVERY % 2],) if number % _MISSING_EVERY == 6 else (),
        wardrobe="briefs" if shape.startswith("m_") and number % _BRIEFS_EVERY == 4 else None,
        healed=_HEALED if number % _HEALED_EVERY == 5 else (),
        body_hair=_take(_HAIR, number, shapes) if hairy else 0.0,
    )


TUNING_PAIRS = tuple(_pair(TUNING_SHAPES, k, 1000) for k in range(24))
"""Pairs on which parameters may be chosen."""

CALIBRATION_PAIRS = tuple(_pair(CALIBRATION_SHAPES, k, 2000) for k in range(40))
"""Pairs on which stated uncertainties may be calibrated."""

TEST_PAIRS = tuple(_pair(TEST_SHAPES, k, 3000) for k in range(42))
"""Pairs that only reported figures come from."""


def make_patient(pair: SimulatedPair, rig: SimulatedRig | None = None) -> SimulatedPatient:
    """The person of a pair, with what happens until the second visit."""
    change = VisitChange(
        new_moles=pair.new_moles,
        vanished=pair.vanished,
        weight_change=pair.weight_change,
        healed=pair.healed,
    )
    return SimulatedPatient(
        pair.shape,
        pair.seed,
        pair.moles,
        lesions=min(pair.lesions, pair.moles),
        wardrobe=pair.wardrobe,
        changes={2: change},
        variation=DEMANDING,
        missing=pair.missing,
        body_hair=pair.body_hair,
        rig=rig,
    )


def make_pair(
    pair: SimulatedPair, frames: int = 30, rig: SimulatedRig | None = None
) -> tuple[SimulatedPatient, SimulatedCapture, SimulatedCapture]:
    """The person of a pair and the two captures.

    Parameters
    ----------
    pair : SimulatedPair
    frames : int
        Depth frames of each capture.
    rig : SimulatedRig, optional
        Default: virtual Kinect with the 2560x1920 auxiliary camera.
    """
    patient = make_patient(pair, rig)
    first = patient.capture(
        pair.first, pair.view, 1, frames, seed=100 * pair.seed + 1, distance_m=pair.distance_m
    )
    followup = patient.capture(
        pair.followup,
        pair.view,
        2,
        frames,
        seed=100 * pair.seed + 2,
        distance_m=pair.followup_distance_m,
        turn_deg=pair.turn_deg,
    )
    return patient, first, followup
