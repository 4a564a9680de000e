"""What was tracked so far, frame by frame, for the chart and the table of distances. No Qt."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.workflows.hand_rows import HandShot
from core.hand.answer import HandAnswer
from core.hand.names import PAIRS, POINT_NAMES

FloatArray = NDArray[np.float64]

MOST_LIVE_FRAMES = 900
"""Half a minute at 30 frames/s; older live frames are forgotten."""

_SHORT = {"tip": "nail", "ip": "end", "pip": "middle", "mcp": "knuckle"}


@dataclass(frozen=True, eq=False)
class Logged:
    """One tracked frame."""

    number: int
    name: str
    time_s: float
    answer: HandAnswer


@dataclass(frozen=True, eq=False)
class PairSeries:
    """A distance over time.

    Attributes
    ----------
    time_s : ndarray (n,)
    measured_m, expected_m : ndarray (n,)
        NaN where a point was not told; the model's of the configuration found.
    """

    time_s: FloatArray
    measured_m: FloatArray
    expected_m: FloatArray


def pair_name(pair: int) -> str:
    """A pair of points for a table: "index nail - index knuckle"."""
    return " - ".join(short_name(POINT_NAMES[k]) for k in PAIRS[pair])


def short_name(name: str) -> str:
    """A point in two words: "index nail"."""
    finger, part = name.split("_")
    return f"{finger} {_SHORT[part]}"


class TrackLog:
    """Answers by frame; written by the tracking thread, read by the window.

    Parameters
    ----------
    most : int or None
        How many frames are kept; None keeps all.
    """

    def __init__(self, most: int | None = None) -> None:
        self._lock = threading.Lock()
        self._frames: dict[int, Logged] = {}
        self._most = most

    def add(self, shot: HandShot, answer: HandAnswer) -> None:
        """Keep an answer, without its surface; one of the same frame is replaced."""
        logged = Logged(shot.number, shot.name, shot.time_s, replace(answer, surface=None))
        with self._lock:
            self._frames[shot.number] = logged
            while self._most is not None and len(self._frames) > self._most:
                del self._frames[next(iter(self._frames))]

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._frames.clear()

    def frames(self) -> list[Logged]:
        """In order of time."""
        with self._lock:
            return sorted(self._frames.values(), key=lambda logged: logged.number)

    def __len__(self) -> int:
        return len(self._frames)

    def series(self, pair: int) -> PairSeries:
        """One distance over all tracked frames."""
        frames = self.frames()
        return PairSeries(
            np.array([f.time_s for f in frames]),
            np.array([f.answer.pair_m[pair] for f in frames]),
            np.array([f.answer.expected_pair_m[pair] for f in frames]),
        )
