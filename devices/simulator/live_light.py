"""Exposure of the simulated colour camera: what automatic and chosen exposure do to the picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

USUAL_EXPOSURE_S = 1.0 / 50.0
SHORTEST_S, LONGEST_S = 1.0 / 2000.0, 1.0 / 30.0


@dataclass(frozen=True)
class LightControl:
    """Light of the room and exposure of the camera.

    Attributes
    ----------
    light : float
        Of the room; 1 is the usual light, in which 1/50 s is right.
    automatic : bool
        The camera chooses the exposure, as far as it can.
    exposure_s : float
        Chosen by hand.
    """

    light: float = 1.0
    automatic: bool = True
    exposure_s: float = USUAL_EXPOSURE_S

    @property
    def exposure_in_force_s(self) -> float:
        """Exposure time of the pictures."""
        if not self.automatic:
            return self.exposure_s
        return float(np.clip(USUAL_EXPOSURE_S / max(self.light, 1e-6), SHORTEST_S, LONGEST_S))

    @property
    def table(self) -> NDArray[np.uint8] | None:
        """Grey level (256,) of each level of the well-exposed picture; None if nothing changes."""
        gain = self.light * self.exposure_in_force_s / USUAL_EXPOSURE_S
        return None if abs(gain - 1.0) < 1e-3 else _table(round(gain, 4))


@lru_cache(maxsize=8)
def _table(gain: float) -> NDArray[np.uint8]:
    linear = (np.arange(256) / 255.0) ** 2.2
    return np.asarray(np.rint(255.0 * np.clip(gain * linear, 0.0, 1.0) ** (1 / 2.2)), np.uint8)
