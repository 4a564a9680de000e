"""A place on the skin, finer than a vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """A point inside a triangle of a surface.

    Attributes
    ----------
    triangle : int
        Row of the surface's triangle array.
    barycentric : ndarray (3,)
        Weights of the triangle's corners; they sum to 1.
    position_m : ndarray (3,)
        The point itself, in the frame of the surface (depth camera), metres.
    """

    triangle: int
    barycentric: FloatArray
    position_m: FloatArray
