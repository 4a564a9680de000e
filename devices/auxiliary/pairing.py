"""Putting a picture of one camera and the depth of another together: which picture, and did the body move."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError
from devices.auxiliary.body_motion import body_motion, reduced_camera, reduced_depth
from devices.auxiliary.camera import TimedPicture

WARN_M = 0.004
"""A body that moved farther than this between depth and picture is told; 4 mm is a small mole."""

REFUSE_M = 0.015
"""Farther than this, a click in the picture would land on other skin: the capture is refused."""

WARN_BURST_M = 0.010
"""Within the depth frames: more than the sway and breath of a standing person, 4 to 6 mm in a second."""

_REMEMBERED_S = 20.0
_AROUND_S = 0.12
_SHORT_GAP_S = 0.15
_UNCHECKED_S = 0.3
_SHORTEST_BURST_S = 0.2


@dataclass(frozen=True)
class PairedMotion:
    """What is known about the movement between depth and picture.

    Attributes
    ----------
    gap_s : float
        From the middle of the depth frames to the picture; positive if the picture is later.
    moved_m : float or None
        How far the body moved in that time; None if it could not be measured.
    burst_moved_m : float or None
        How far it moved within the depth frames themselves.
    """

    gap_s: float
    moved_m: float | None
    burst_moved_m: float | None

    def judge(self) -> tuple[str, ...]:
        """Warnings.

        Raises
        ------
        WorkError
            If the body moved so far that picture and depth do not belong together.
        """
        if self.moved_m is not None and self.moved_m > REFUSE_M:
            raise WorkError(
                f"The body moved by {1000 * self.moved_m:.0f} mm between depth and picture "
                f"({abs(self.gap_s):.2f} s).",
                "Ask the patient to hold still and take it again.",
            )
        found = []
        if self.moved_m is None and abs(self.gap_s) > _UNCHECKED_S:
            found.append(
                f"The picture was taken {abs(self.gap_s):.1f} s from the depth; whether the body moved "
                "meanwhile could not be checked."
            )
        elif self.moved_m is not None and self.moved_m > WARN_M:
            found.append(
                f"The body moved by {1000 * self.moved_m:.0f} mm between depth and picture "
                f"({abs(self.gap_s):.2f} s)."
            )
        if self.burst_moved_m is not None and self.burst_moved_m > WARN_BURST_M:
            found.append(f"The body moved by {1000 * self.burst_moved_m:.0f} mm while depth was taken.")
        return tuple(found)


class DepthTrail:
    """The depth of the last seconds, reduced, so that movement can be measured afterwards.

    Parameters
    ----------
    camera : PinholeCamera
        The depth camera.
    """

    def __init__(self, camera: PinholeCamera) -> None:
        self._camera = reduced_camera(camera)
        self._frames: deque[tuple[float, NDArray[np.float32]]] = deque()

    def add(self, time_s: float, frame: NDArray[np.uint16], unit_m: float) -> None:
        """Remember a depth frame; frames that come twice are remembered once."""
        if self._frames and time_s <= self._frames[-1][0]:
            return
        self._frames.append((time_s, reduced_depth(frame, unit_m)))
        while time_s - self._frames[0][0] > _REMEMBERED_S:
            self._frames.popleft()

    def at(self, time_s: float, within_s: float = _AROUND_S) -> NDArray[np.float32] | None:
        """Mean depth around a moment; None if nothing was seen then."""
        chosen = [depth for t, depth in list(self._frames) if abs(t - time_s) <= within_s]
        if not chosen:
            return None
        stack = np.stack(chosen)
        count = np.isfinite(stack).sum(axis=0)
        mean = np.nansum(stack, axis=0) / np.maximum(count, 1)
        return np.where(2 * count >= len(chosen), mean, np.nan).astype(np.float32)

    def moved_m(self, from_s: float, to_s: float, within_s: float = _AROUND_S) -> float | None:
        """How far the body moved from one moment to another; None if it cannot be told."""
        before, after = self.at(from_s, within_s), self.at(to_s, within_s)
        if before is None or after is None:
            return None
        motion = body_motion(before, after, self._camera)
        return None if motion is None else motion.moved_m

    def check(self, times_s: NDArray[np.float64], picture: TimedPicture) -> PairedMotion:
        """Movement between the depth frames of a burst and a picture.

        A short gap is judged by the speed within the burst; a longer one by the depth seen at its ends. If
        the moment of the picture is not well known, the worst of the moments it may be is taken.
        """
        first, last = float(times_s[0]), float(times_s[-1])
        middle = 0.5 * (first + last)
        gap = picture.time_s - middle
        third = (last - first) / 3.0
        within = None
        if last - first >= _SHORTEST_BURST_S:
            within = self.moved_m(first + third / 2, last - third / 2, min(_AROUND_S, third / 2))
        if abs(gap) + 2 * picture.time_sigma_s <= _SHORT_GAP_S:
            reach = abs(gap) + picture.time_sigma_s
            speed = None if within is None else within / (2.0 * third)
            return PairedMotion(gap, None if speed is None else speed * reach, within)
        doubt = 2 * picture.time_sigma_s if picture.time_sigma_s > _SHORT_GAP_S / 2 else 0.0
        moments = {picture.time_s - doubt, picture.time_s, picture.time_s + doubt}
        measured = [m for t in moments if (m := self.moved_m(middle, t)) is not None]
        return PairedMotion(gap, max(measured, default=None), within)


def nearest_picture(pictures: list[TimedPicture], time_s: float) -> TimedPicture:
    """The picture whose exposure was nearest to a moment."""
    return min(pictures, key=lambda p: abs(p.time_s - time_s))


def still_possible(pictures: list[TimedPicture], middle_s: float) -> list[TimedPicture]:
    """Those that can still be nearest to the middle of a burst that goes on: the middle only moves onward."""
    before = [p for p in pictures if p.time_s <= middle_s]
    after = [p for p in pictures if p.time_s > middle_s]
    return ([max(before, key=lambda p: p.time_s)] if before else []) + after
