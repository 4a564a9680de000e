"""From a camera's own clock to this computer's."""

from __future__ import annotations

from collections import deque

_RESTARTED_S = 0.5


class DeviceClock:
    """Maps device time stamps to `time.monotonic` by the frames that came through with the least delay.

    A frame arrives some time after it was made, never before: the smallest difference of arrival and time
    stamp in a window is the offset of the clocks plus the shortest way. The window lets the offset follow
    the clocks' drift. What is constant on the way (exposure, transfer) stays in the result: it cannot be seen
    from here.

    Parameters
    ----------
    window : int
        Frames that are looked back on.
    """

    def __init__(self, window: int = 300) -> None:
        self._offsets: deque[float] = deque(maxlen=window)
        self._last_s = float("-inf")

    def at(self, device_s: float, arrived_s: float) -> float:
        """Time of a frame on `time.monotonic`.

        Parameters
        ----------
        device_s : float
            The frame's time stamp.
        arrived_s : float
            `time.monotonic` when it came.
        """
        offset = arrived_s - device_s
        jumped = bool(self._offsets) and abs(offset - self._offsets[-1]) > _RESTARTED_S
        if device_s < self._last_s or (jumped and offset < min(self._offsets)):
            # A time stamp that goes back, or a frame from the future, is a clock set anew.
            self._offsets.clear()
        self._last_s = device_s
        self._offsets.append(offset)
        return device_s + min(self._offsets)
