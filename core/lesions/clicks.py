"""Which spot a click means."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from core.lesions.spots import SkinSpots

# A hand clicks this far beside a spot, in pixels.
_CLICK_PX = 1.5
_LEAST_CONFIDENCE = 0.05


def spot_at(spots: SkinSpots, pixel: ArrayLike, radius_px: float) -> int | None:
    """Row of the spot that a click at picture pixel (u, v) means; None if there is none near enough.

    A spot is near enough if its centre is at most ``radius_px`` away or the click lies on it. Among several,
    distance counts in standard errors of a click and a faint spot must be nearer than a clear one.
    """
    away = np.linalg.norm(spots.pixels - np.asarray(pixel, dtype=float).reshape(2), axis=1)
    near = np.flatnonzero(away <= np.maximum(radius_px, spots.radius_px))
    if len(near) == 0:
        return None
    spread = np.hypot(_CLICK_PX, 0.5 * spots.radius_px[near])
    cost = (away[near] / spread) ** 2 - 2.0 * np.log(np.maximum(spots.confidence[near], _LEAST_CONFIDENCE))
    return int(near[cost.argmin()])
