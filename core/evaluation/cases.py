"""What an evaluation is fed: pairs of analysed captures with the truth about their lesions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrueLesion:
    """A lesion whose place is known in both captures.

    Attributes
    ----------
    id : str
    pixel : (u, v)
        Where it is clicked in the first picture.
    first_m, followup_m : ndarray (3,)
        Its place in each capture's depth-camera frame.
    followup_pixel : (u, v)
        In the follow-up's picture.
    visible : bool
        Whether the follow-up's cameras see it.
    """

    id: str
    pixel: tuple[float, float]
    first_m: FloatArray
    followup_m: FloatArray
    followup_pixel: tuple[float, float]
    visible: bool


@dataclass(frozen=True, eq=False)
class EvaluationCase:
    """One pair of captures.

    Attributes
    ----------
    name : str
    body : str
        Who it is: cases of one body are not independent of each other.
    group : str
        Rows are made per group, for example "same stance" and "other stance".
    joints : str
        Where the joints came from: "tracked" or "true".
    """

    name: str
    body: str
    group: str
    joints: str
    first: AnalysedCapture
    followup: AnalysedCapture
    lesions: tuple[TrueLesion, ...]


class CaseSource(Protocol):
    """Whoever can make cases: a simulator with a tracker, or recordings with clicked truth."""

    def cases(self) -> Iterator[EvaluationCase]:
        """All cases, one at a time: a pair of captures is large."""
