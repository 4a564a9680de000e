"""Smoothing of moving points that neither lags behind quick movements nor trembles in slow ones.

The one-euro filter (Casiez, Roussel, Vogel, CHI 2012): a first-order low pass whose cut-off frequency rises
with the speed. Every answer lies between the last answer and the new measurement: it cannot overshoot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

HOLD_S: Final = 0.5
"""A point that was not measured for longer starts anew instead of gliding to its new place."""


@dataclass(frozen=True)
class Smoothing:
    """Settings of the filter.

    Attributes
    ----------
    rest_hz : float
        Cut-off frequency at rest: lower is calmer.
    hz_per_speed : float
        How much the cut-off rises with speed; Hz per (unit of the points per second).
    speed_hz : float
        Cut-off of the low pass on the speed itself.
    """

    rest_hz: float = 2.0
    hz_per_speed: float = 12.0
    speed_hz: float = 3.0


class OneEuro:
    """The filter for a set of points, each with a clock of its own.

    Parameters
    ----------
    smoothing : Smoothing
    hold_s : float
        How long a point that is not measured keeps its place.
    """

    def __init__(self, smoothing: Smoothing | None = None, *, hold_s: float = HOLD_S) -> None:
        self._settings = smoothing or Smoothing()
        self._hold_s = hold_s
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._value = np.zeros((0, 0))
        self._speed = np.zeros((0, 0))
        self._time = np.zeros(0)

    def age_s(self, time_s: float) -> FloatArray:
        """Seconds since each point was measured (n,); infinite for points never seen."""
        return np.asarray(time_s - self._time)

    def update(self, points: FloatArray, time_s: float) -> FloatArray:
        """Smoothed points.

        Parameters
        ----------
        points : ndarray (n, d)
            A row with a NaN is a point that was not measured. n and d may not change without `reset`.
        time_s : float
            Never before that of the call before; an equal time counts as a millisecond later.

        Returns
        -------
        ndarray (n, d)
            The last place for points not measured now; NaN for those not measured for more than ``hold_s``.
        """
        points = np.asarray(points, dtype=float)
        if self._value.shape != points.shape:
            if self._value.size:
                raise ValueError("the number of points changed")
            self._value = np.full(points.shape, np.nan)
            self._speed = np.zeros(points.shape)
            self._time = np.full(len(points), -np.inf)
        measured = np.isfinite(points).all(axis=1)
        fresh = measured & (time_s - self._time > self._hold_s)
        go = measured & ~fresh
        self._value[fresh], self._speed[fresh] = points[fresh], 0.0
        if go.any():
            step = np.maximum(time_s - self._time[go], 1e-3)[:, None]
            raw = (points[go] - self._value[go]) / step
            speed = self._speed[go] + _share(self._settings.speed_hz, step) * (raw - self._speed[go])
            swift = np.linalg.norm(speed, axis=1, keepdims=True)
            cut = self._settings.rest_hz + self._settings.hz_per_speed * swift
            self._value[go] += _share(cut, step) * (points[go] - self._value[go])
            self._speed[go] = speed
        self._time[measured] = time_s
        gone = time_s - self._time > self._hold_s
        return np.where(gone[:, None], np.nan, self._value)


def _share(cut_hz: FloatArray | float, step_s: FloatArray) -> FloatArray:
    """Share of the new measurement in the low pass, 0 to 1."""
    turn = 2.0 * np.pi * cut_hz * step_s
    return np.asarray(turn / (turn + 1.0))
