"""What an evaluation is fed: pairs of analysed captures with the truth about their lesions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture

FloatArray = NDArray[np.float64]

Joints = Literal["tracked", "true"]
"""Joints by the application's own tracker, or the recorded (in a simulation: true) ones."""

SAME, OTHER = "same stance", "other stance"
"""Stance classes: rows of the tables."""


@dataclass(frozen=True, eq=False)
class TrueLesion:
    """A lesion, or a place where one was, that is known in both captures.

    Attributes
    ----------
    id : str
    pixel : (u, v)
        Where it is clicked in the first picture.
    first_m, followup_m : ndarray (3,)
        Its place in each capture's depth-camera frame; NaN where a hidden one's place is not known.
    followup_pixel : (u, v)
        In the follow-up's picture.
    visible : bool
        Whether the follow-up's cameras see it.
    healed : bool
        The follow-up shows only skin there.
    """

    id: str
    pixel: tuple[float, float]
    first_m: FloatArray
    followup_m: FloatArray
    followup_pixel: tuple[float, float]
    visible: bool
    healed: bool = False


@dataclass(frozen=True, eq=False)
class TrueSpots:
    """Moles that came or went between the visits, where both visits show the skin.

    Attributes
    ----------
    new_m : ndarray (n, 3)
        In the follow-up's depth-camera frame.
    vanished_m : ndarray (m, 3)
        In the first capture's.
    """

    new_m: FloatArray
    vanished_m: FloatArray


@dataclass(frozen=True, eq=False)
class EvaluationCase:
    """One pair of captures, analysed, with everything that is true about it.

    Attributes
    ----------
    lesions : tuple of TrueLesion
    mole_ids, moles_m : tuple of str, ndarray (k, 3)
        Every mole of the follow-up, lesions included, in its depth-camera frame: what an answer can be
        mistaken for.
    first_joints_m, followup_joints_m : mapping of str to ndarray (3,)
        The best known joints, for the names of body parts only; never handed to a method.
    spots : TrueSpots or None
        None where nobody knows.
    analysis_seconds : float
        From both captures to surfaces, joints and anchors.
    """

    first: AnalysedCapture
    followup: AnalysedCapture
    lesions: tuple[TrueLesion, ...]
    mole_ids: tuple[str, ...]
    moles_m: FloatArray
    first_joints_m: Mapping[str, FloatArray]
    followup_joints_m: Mapping[str, FloatArray]
    spots: TrueSpots | None = None
    analysis_seconds: float = field(default=0.0)


@dataclass(frozen=True)
class CaseName:
    """Which pair of captures.

    Attributes
    ----------
    case : str
        Unique.
    body : str
        Whose: cases of one body are not independent of each other.
    first_stance, followup_stance : str
    """

    case: str
    body: str
    first_stance: str
    followup_stance: str

    @property
    def group(self) -> str:
        """The stance class. A stance that nobody has written down counts as another."""
        return SAME if self.first_stance and self.first_stance == self.followup_stance else OTHER

    @property
    def stances(self) -> str:
        """Both stances in words."""
        return f"{self.first_stance or 'not stated'} to {self.followup_stance or 'not stated'}"


class PendingCase(Protocol):
    """A pair that is loaded (or simulated) only when somebody measures on it."""

    @property
    def name(self) -> CaseName:
        """Which pair."""

    def load(self, joints: Joints, frames: int) -> EvaluationCase:
        """Analyse the captures with these joints and with ``frames`` depth frames (0: all there are).

        Raises
        ------
        InputError, WorkError
            If the captures cannot be used.
        """


class CaseSource(Protocol):
    """Whoever can make cases: a simulator with a tracker, or recordings with clicked truth."""

    def __len__(self) -> int:
        """How many pairs there are."""

    def cases(self) -> Iterator[PendingCase]:
        """All pairs, one at a time: what a pair has loaded is dropped with it."""
