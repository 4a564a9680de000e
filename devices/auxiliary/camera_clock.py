"""When a still camera's shutter opened, on our clock: from when its files arrive and what its clock says."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

_REMEMBERED = 50
_LONGEST_TRANSFER_S = 10.0
_EXIF_SIGMA_S = 0.05


@dataclass(frozen=True)
class Moment:
    """Seconds of `time.monotonic`, and their standard deviation."""

    time_s: float
    sigma_s: float


class CameraClock:
    """Maps the camera's clock to ours.

    A file arrives some time after the exposure: at least the shortest transfer, at most some seconds. The
    smallest difference between arrival and the camera's clock over the session is therefore the offset of the
    clocks plus the shortest transfer, the `latency_s`.

    Parameters
    ----------
    latency_s : float
        Shortest time from exposure to the file's arrival.
    arrival_sigma_s : float
        How well the exposure is known when only the arrival is.
    """

    def __init__(self, latency_s: float, arrival_sigma_s: float) -> None:
        self.latency_s, self._arrival_sigma_s = latency_s, arrival_sigma_s
        self._differences: deque[float] = deque(maxlen=_REMEMBERED)

    def exposed(self, arrived_s: float, exposed_at: float | None) -> Moment:
        """Moment of the exposure of a file that began to arrive at ``arrived_s``.

        Parameters
        ----------
        exposed_at : float or None
            What the camera's clock said, to a fraction of a second. It is trusted from the second picture on,
            as long as it agrees with the arrivals within a transfer; a clock that was set anew starts again.
        """
        by_arrival = Moment(arrived_s - self.latency_s, self._arrival_sigma_s)
        if exposed_at is None:
            return by_arrival
        difference = arrived_s - exposed_at
        known = list(self._differences)
        if known and abs(difference - min(known)) > _LONGEST_TRANSFER_S:
            self._differences.clear()
            known = []
        self._differences.append(difference)
        if not known:
            return by_arrival
        return Moment(exposed_at + min(*known, difference) - self.latency_s, _EXIF_SIGMA_S)
