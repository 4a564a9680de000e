"""Landmarks that a detector finds on a picture of a hand: the contract of every such detector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LANDMARKS = 21
"""Wrist, then four a finger from its base to its tip, thumb first."""

WRIST = 0


def landmark(finger: int, part: int) -> int:
    """Row of a landmark: finger 0 (thumb) to 4 (little), part 0 (nearest to the wrist) to 3 (tip)."""
    return 1 + 4 * finger + part


@dataclass(frozen=True, eq=False)
class HandLandmarks:
    """One hand on a picture.

    Attributes
    ----------
    pixels : ndarray (21, 2)
        Picture coordinates.
    relative_depth : ndarray (21,)
        Toward the camera negative, in picture widths, 0 at the wrist; a guess of the detector.
    side : {"L", "R"}
        The person's own.
    score : float
        0 to 1: how sure the detector is that it is this hand and not the other.
    shape_m : ndarray (21, 3) or None
        The hand in space as the detector guesses it, of its usual size and not the measured one: metres, axes
        of the camera, origin somewhere in the hand.
    """

    pixels: FloatArray
    relative_depth: FloatArray
    side: Literal["L", "R"]
    score: float
    shape_m: FloatArray | None = None


class HandDetector(Protocol):
    """Finds a hand's landmarks on a picture."""

    def detect(self, rgb: NDArray[np.uint8]) -> HandLandmarks | None:
        """Landmarks of the most prominent hand of a picture (h, w, 3), or None."""

    def close(self) -> None:
        """Release what it holds."""
