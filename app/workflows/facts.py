"""What is already on record of a visit: the only thing a state is resumed from."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Fact(StrEnum):
    """A yes-or-no statement that the state tables ask about."""

    HAS_STANCE = "the stance capture is stored"
    HAS_CAPTURE = "a working capture is stored"
    NONE_PENDING = "every known lesion was looked for on the captures of this visit"
    ALL_DECIDED = "no proposed place waits for the doctor"


@dataclass(frozen=True)
class VisitFacts:
    """What the records say about one visit.

    Attributes
    ----------
    has_stance, has_capture : bool
        A psi capture, at least one working capture.
    pending : int
        Known lesions still to be found on the captures of this visit.
    lesions : int
        Lesions with an observation in this visit.
    undecided : int
        Observations still "proposed".
    closed : bool
    """

    has_stance: bool = False
    has_capture: bool = False
    pending: int = 0
    lesions: int = 0
    undecided: int = 0
    closed: bool = False

    def has(self, fact: Fact) -> bool:
        """Whether ``fact`` holds."""
        return {
            Fact.HAS_STANCE: self.has_stance,
            Fact.HAS_CAPTURE: self.has_capture,
            Fact.NONE_PENDING: self.pending == 0,
            Fact.ALL_DECIDED: self.undecided == 0,
        }[fact]
