"""Cases for the evaluation, made by the simulated patient and the skeleton tracker."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.errors import InputError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.evaluation import EvaluationCase, TrueLesion
    from devices.simulator import SimulatedCapture, SimulatedPatient

Joints = Literal["tracked", "true"]
CLICK_ERROR_PX = 1.5
"""Standard deviation of a click on the 2560 x 1920 picture."""


@dataclass(frozen=True)
class SimulatedPair:
    """What to simulate: one patient in two stances."""

    shape: str
    seed: int
    first: str
    followup: str
    turn_deg: float = 0.0

    @property
    def group(self) -> str:
        """Rows of the ladder."""
        return "same stance" if self.first == self.followup else "other stance"


TUNING_PAIRS: tuple[SimulatedPair, ...] = (
    SimulatedPair("m_young_avg", 1, "psi", "psi"),
    SimulatedPair("f_old_heavy", 2, "A", "A"),
    SimulatedPair("child10", 3, "psi", "psi"),
    SimulatedPair("m_young_avg", 4, "A", "A"),
    SimulatedPair("f_old_heavy", 5, "psi", "A"),
    SimulatedPair("child10", 6, "A", "psi"),
    SimulatedPair("m_young_avg", 7, "psi", "T"),
    SimulatedPair("f_old_heavy", 8, "psi", "down"),
    SimulatedPair("child10", 9, "A", "twist"),
    SimulatedPair("m_young_avg", 10, "psi", "hip_hands", 10.0),
)
"""Bodies, stances and seeds that radii and thresholds were chosen on."""

TEST_PAIRS: tuple[SimulatedPair, ...] = (
    SimulatedPair("m_tall_thin", 11, "psi", "psi"),
    SimulatedPair("f_young_avg", 12, "A", "A"),
    SimulatedPair("m_tall_thin", 13, "A", "A"),
    SimulatedPair("f_young_avg", 14, "psi", "psi"),
    SimulatedPair("m_tall_thin", 15, "psi", "A"),
    SimulatedPair("f_young_avg", 16, "A", "psi", 10.0),
    SimulatedPair("m_tall_thin", 17, "psi", "T"),
    SimulatedPair("f_young_avg", 18, "psi", "down"),
    SimulatedPair("m_tall_thin", 19, "A", "twist"),
    SimulatedPair("f_young_avg", 20, "psi", "hip_hands"),
)
"""Bodies and seeds that no parameter was tuned on."""


class SimulatedCases:
    """Renders, tracks and scores pairs one at a time (`core.evaluation.CaseSource`).

    Parameters
    ----------
    pairs : sequence of SimulatedPair
    frames : int
        Depth frames of each capture.
    joints : sequence of "tracked" and "true"
        Kinds of joints; every pair gives one case for each. Truth is only ever used for "true".
    moles : int
        Marked lesions and distractors together.
    lesions : int
    """

    def __init__(
        self,
        pairs: Sequence[SimulatedPair] = TEST_PAIRS,
        *,
        frames: int = 30,
        joints: Sequence[Joints] = ("tracked",),
        moles: int = 180,
        lesions: int = 40,
    ) -> None:
        if not pairs:
            raise InputError("An evaluation needs at least one pair.")
        self._pairs, self._frames, self._joints = tuple(pairs), frames, tuple(joints)
        self._moles, self._lesions = moles, lesions

    def cases(self) -> Iterator[EvaluationCase]:
        """All cases, one at a time."""
        from core.evaluation import EvaluationCase
        from devices.simulator import SimulatedPatient

        for pair in self._pairs:
            patient = SimulatedPatient(pair.shape, pair.seed, self._moles, lesions=self._lesions)
            one = patient.capture(pair.first, visit=1, frames=self._frames, seed=100 * pair.seed + 1)
            two = patient.capture(
                pair.followup, visit=2, frames=self._frames, seed=100 * pair.seed + 2, turn_deg=pair.turn_deg
            )
            lesions = _true_lesions(patient, one, two, pair.seed)
            for joints in self._joints:
                yield EvaluationCase(
                    name=f"{pair.shape} {pair.seed}: {pair.first} to {pair.followup}",
                    body=f"{pair.shape} {pair.seed}",
                    group=pair.group,
                    joints=joints,
                    first=_analysed(one, joints),
                    followup=_analysed(two, joints),
                    lesions=lesions,
                )


def _analysed(simulated: SimulatedCapture, joints: Joints) -> AnalysedCapture:
    from core.anchors import analyse_capture
    from devices.trackers import default_tracker

    truth = dict(simulated.truth.joints_m) if joints == "true" else None
    return analyse_capture(
        simulated.capture.with_joints(truth), default_tracker(), use_recorded=joints == "true"
    )


def _true_lesions(
    patient: SimulatedPatient, one: SimulatedCapture, two: SimulatedCapture, seed: int
) -> tuple[TrueLesion, ...]:
    """Lesions that the first capture shows, clicked with an error, and where they truly are."""
    from core.evaluation import TrueLesion

    rng = np.random.default_rng(seed)
    out = []
    for name in patient.lesion_ids:
        i, j = one.truth.mole_row[name], two.truth.mole_row[name]
        error = rng.normal(0.0, CLICK_ERROR_PX, 2)
        if not one.truth.mole_visible[i]:
            continue
        click = one.truth.mole_pixels[i] + error
        pixel2 = two.capture.rig.project_to_picture(two.truth.mole_points_m[j])[0]
        out.append(
            TrueLesion(
                id=name,
                pixel=(float(click[0]), float(click[1])),
                first_m=one.truth.mole_points_m[i],
                followup_m=two.truth.mole_points_m[j],
                followup_pixel=(float(pixel2[0]), float(pixel2[1])),
                visible=bool(two.truth.mole_visible[j]),
            )
        )
    return tuple(out)
