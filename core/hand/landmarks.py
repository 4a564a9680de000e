"""Landmarks that a detector finds on a picture of a hand: the contract of every such detector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LANDMARKS = 21
"""Wrist, then four a finger from its base to its tip, thumb first."""


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
        0 to 1.
    """

    pixels: FloatArray
    relative_depth: FloatArray
    side: Literal["L", "R"]
    score: float


class HandDetector(Protocol):
    """Finds a hand's landmarks on a picture."""

    def detect(self, rgb: NDArray[np.uint8]) -> HandLandmarks | None:
        """Landmarks of the most prominent hand of a picture (h, w, 3), or None."""

    def close(self) -> None:
        """Release what it holds."""
