"""How late a colour camera's time stamps are against the depth camera's: both watch the same waving arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError

FloatArray = NDArray[np.float64]

_GRID_S = 0.005
_MOST_LAG_S = 1.0
_LEAST_LIKENESS = 0.6
_LEAST_SECONDS = 2.0
_FLOOR_S = 0.003
_NEAR_S = 0.15
_MOST_SIGMA_S = 0.06


@dataclass(frozen=True)
class Latency:
    """Delay of the colour camera's stamps against the depth camera's.

    Attributes
    ----------
    delay_s : float
        To be subtracted from the colour stamps.
    sigma_s : float
        From the agreement of the two halves of the recording.
    likeness : float
        Correlation of the two movements at this delay, 0..1.
    """

    delay_s: float
    sigma_s: float
    likeness: float


class Movement:
    """How much a picture changes from moment to moment.

    Parameters
    ----------
    most : float
        Changes of a pixel beyond this count as this: an edge that passes is no more than a movement.
    """

    def __init__(self, most: float) -> None:
        self._most = most
        self._last: tuple[float, NDArray[np.float32]] | None = None
        self.times: list[float] = []
        self.values: list[float] = []

    def add(self, time_s: float, small: NDArray[np.float32]) -> None:
        """A small picture; NaN where it says nothing."""
        last, self._last = self._last, (time_s, small)
        if last is None or time_s <= last[0]:
            return
        change = np.abs(small - last[1])
        change = change[np.isfinite(change)]
        if change.size:
            speed = float(np.minimum(change, self._most).mean()) / (time_s - last[0])
            self.times.append(0.5 * (time_s + last[0]))
            self.values.append(speed)


def small_grey(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Brightness at about 80 pixels across, averaged."""
    step = max(1, rgb.shape[1] // 160)
    green = rgb[::step, ::step, 1].astype(np.float32)
    h, w = (side // 2 * 2 for side in green.shape)
    return np.asarray(green[:h, :w].reshape(h // 2, 2, w // 2, 2).mean(axis=(1, 3)), dtype=np.float32)


def find_latency(depth: Movement, color: Movement) -> Latency:
    """The delay at which the two movements are most alike.

    Raises
    ------
    WorkError
        If nothing moved, or the two saw different things.
    """
    both = (depth.times, color.times)
    if not all(both) or min(t[-1] for t in both) - max(t[0] for t in both) < _LEAST_SECONDS:
        raise WorkError(
            "Too few pictures came to measure the delay.", "Check both cameras, then measure again."
        )
    start, end = max(t[0] for t in both), min(t[-1] for t in both)
    whole = _lag(depth, color, start, end)
    middle = 0.5 * (start + end)
    delay, likeness = whole
    halves = [_lag(depth, color, *part, delay)[0] for part in ((start, middle), (middle, end))]
    if likeness < _LEAST_LIKENESS:
        raise WorkError(
            "The delay between the cameras could not be measured: they saw no common movement.",
            "Wave an arm slowly from side to side in front of both cameras, and nothing else.",
        )
    sigma = float(np.hypot(_FLOOR_S, 0.5 * abs(halves[0] - halves[1])))
    if sigma > _MOST_SIGMA_S:
        raise WorkError(
            "The delay between the cameras could not be measured: two halves of the recording disagree.",
            "Wave an arm irregularly, now slowly, now fast, and measure again.",
        )
    return Latency(delay, sigma, likeness)


def _lag(
    depth: Movement, color: Movement, start: float, end: float, near_s: float | None = None
) -> tuple[float, float]:
    """Delay and likeness in a span of time, anywhere or near a delay that is known roughly."""
    grid = np.arange(start, end, _GRID_S)
    a, b = (_normed(np.interp(grid, m.times, m.values)) for m in (depth, color))
    most = min(round(_MOST_LAG_S / _GRID_S), len(grid) // 2)
    lags = range(-most, most + 1)
    # Shorter overlaps are normed by their own length.
    likeness = np.array(
        [
            float(np.dot(a[max(0, -k) : len(a) - max(0, k)], b[max(0, k) : len(b) + min(0, k)]))
            / (len(a) - abs(k))
            for k in lags
        ]
    )
    if near_s is not None:
        likeness[np.abs(np.array(lags) * _GRID_S - near_s) > _NEAR_S] = -np.inf
    best = int(likeness.argmax())
    shift = 0.0
    if 0 < best < len(lags) - 1:
        left, top, right = likeness[best - 1 : best + 2]
        bend = left - 2 * top + right
        shift = 0.5 * (left - right) / bend if np.isfinite(bend) and bend < 0 else 0.0
    return float((lags[best] + shift) * _GRID_S), float(likeness[best])


def _normed(values: FloatArray) -> FloatArray:
    spread = float(values.std())
    return np.asarray((values - values.mean()) / spread) if spread > 0 else np.zeros_like(values)
