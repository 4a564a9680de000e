"""How a standing person moves from frame to frame: swaying about the ankles and breathing."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Sway = Literal["still", "calm", "restless"]

SWAYS: dict[Sway, float] = {"still": 0.0, "calm": 1.0, "restless": 5.0}
"""How many times the patient's usual sway."""

FRAME_S = 1.0 / 30.0
MOVING_M = 0.030
"""RMS of the head's sway while the patient takes another stance."""

_MEMORY_S = 0.4
_SETTLING_S = 0.25
_BREATH_S = 4.2
_LONGEST_JUMP = 120


class StandingPerson:
    """Small motions of a standing person, frame by frame, the same for the same seed.

    Sway is noise passed twice through a filter with a memory of 0.4 s, so that the velocity is smooth;
    its RMS is that of the recorded burst. Breathing is a sine of the chest's lift.

    Parameters
    ----------
    sway_m : float
        RMS of the head's sway.
    breath_m : float
        Lift of the chest from empty to full.
    stature_m : float
    seed : int
    """

    def __init__(self, sway_m: float, breath_m: float, stature_m: float, seed: int) -> None:
        self._usual, self._breath = sway_m, breath_m
        self.stature_m = stature_m
        self._rng = np.random.default_rng((0x5A1, seed))
        self._keep = float(np.exp(-FRAME_S / _MEMORY_S))
        keep2 = self._keep**2
        # variance of unit noise through (1 - a/q)^-2 is (1 + a^2) / (1 - a^2)^3
        self._drive = float(np.sqrt((1.0 - keep2) ** 3 / (1.0 + keep2)))
        self._inner, self._outer = np.zeros(2), np.zeros(2)
        self._reach = sway_m
        self._number = 0
        for _ in range(60):
            self._step(moving=False)

    def _step(self, moving: bool) -> None:
        self._inner = self._keep * self._inner + self._drive * self._rng.normal(size=2)
        self._outer = self._keep * self._outer + self._inner
        wanted = MOVING_M if moving else self._usual
        self._reach += (wanted - self._reach) * (1.0 - float(np.exp(-FRAME_S / _SETTLING_S)))

    def at(self, number: int, moving: bool = False) -> NDArray[np.float64]:
        """Amounts (3,) of the motions of `live_scene.MODES` at a frame: radians, radians, metres.

        Frames go forward. While ``moving`` the patient takes another stance and cannot be still.
        """
        for _ in range(min(number - self._number, _LONGEST_JUMP)):
            self._step(moving)
        self._number = max(self._number, number)
        angles = self._outer * self._reach / self.stature_m
        breath = 0.5 * self._breath * np.sin(2.0 * np.pi * number * FRAME_S / _BREATH_S)
        return np.array([angles[0], angles[1], breath])
