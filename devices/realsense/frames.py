"""Frames of the library as arrays with times on our clock."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.realsense import library

KINDS = ("depth", "color", "infrared")
FORMATS = {"depth": "z16", "color": "rgb8", "infrared": "y8"}
_OLDEST_S = 2.0
_REMEMBERED = 90


def kind_of(profile: Any) -> str | None:
    """Which of our streams a profile of the library is: depth, color, the first infrared; None of none."""
    rs = library.load()
    names = {rs.stream.depth: "depth", rs.stream.color: "color", rs.stream.infrared: "infrared"}
    kind: str | None = names.get(profile.stream_type())
    if kind is None or profile.format() != getattr(rs.format, FORMATS[kind]):
        return None
    # D4xx have two infrared cameras; the first is the one whose geometry depth has.
    return None if kind == "infrared" and profile.stream_index() > 1 else kind


def pixels_of(frame: Any) -> NDArray[Any]:
    """A copy of a frame's pixels: the library uses its buffers again."""
    return np.array(np.asanyarray(frame.get_data()), copy=True)


class FrameClock:
    """Puts the library's time stamps on the clock of `time.monotonic`.

    Stamps of the host's clock ("global" and "system" time) are moved by the difference of the two clocks.
    Stamps of the camera's own clock are placed so that the quickest frame of late arrived at once.
    """

    def __init__(self) -> None:
        self._differences: dict[str, deque[float]] = {}

    def time_s(self, frame: Any, kind: str) -> float:
        """When the frame was exposed."""
        rs = library.load()
        now, stamp_s = time.monotonic(), float(frame.get_timestamp()) / 1000.0
        domains = (rs.timestamp_domain.global_time, rs.timestamp_domain.system_time)
        if frame.get_frame_timestamp_domain() in domains:
            moment = stamp_s - (time.time() - now)
            if -0.02 < now - moment < _OLDEST_S:
                return moment
        known = self._differences.setdefault(kind, deque(maxlen=_REMEMBERED))
        known.append(now - stamp_s)
        return stamp_s + min(known)
