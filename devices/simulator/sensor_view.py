"""What a depth sensor has before it while a capture is taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

FAR_M = np.float32(20.0)
"""Stands for nothing at all."""


@dataclass(frozen=True, eq=False)
class SensorView:
    """What is the same in every frame of a capture.

    Attributes
    ----------
    depth_m : ndarray (h, w)
        True depth with the patient in the middle of the sway; the noise is set by it.
    cosine : ndarray (h, w)
        Of the angle between the surface normal and the line of sight.
    shadow : ndarray (h, w) bool
        Seen by the camera but not by the projector or the second camera.
    skin : ndarray (h, w) bool, optional
        Where people are.
    """

    depth_m: Image
    cosine: Image
    shadow: BoolArray
    skin: BoolArray | None = None
