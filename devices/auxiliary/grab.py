"""Grabbing depth and one picture of the same moment from two cameras that know nothing of each other."""

from __future__ import annotations

import time
from collections import deque

import numpy as np

from core.errors import WorkError
from core.progress import Progress, ScaledProgress
from devices.auxiliary.camera import ColorCamera, TimedPicture
from devices.auxiliary.pairing import nearest_picture, still_possible
from devices.burst import FRAME_TIMEOUT_S, Burst, LatestFrame, collect_burst
from devices.live import LiveFrame

SHUTTER_WAIT_S = 30.0
"""How long somebody has time to press the shutter of a still camera."""

_PICTURE_WAIT_S = 3.0
_RING_BYTES = 150_000_000
_STILL_COMING_S = 1.5


def grab_streaming(
    latest: LatestFrame, color: ColorCamera, frames: int, progress: Progress
) -> tuple[Burst, TimedPicture]:
    """A burst of depth, and of the pictures that came meanwhile the one nearest to its middle.

    Raises
    ------
    WorkError
        If depth or pictures stop coming.
    """
    pictures: list[TimedPicture] = []
    seen, started = 0, 0.0

    def depth_only(after: int, timeout_s: float) -> LiveFrame | None:
        nonlocal seen, started, pictures
        frame = latest(after, timeout_s)
        picture = color.latest(seen, 0.0)
        if picture is not None:
            seen = picture.number
            pictures.append(picture)
        if frame is not None:
            started = started or frame.time_s
            pictures = still_possible(pictures, 0.5 * (started + frame.time_s))
        return None if frame is None else _without_color(frame)

    burst = collect_burst(depth_only, frames, progress)
    # A slow camera's next picture may be the nearer one: it is waited for as long as it can be.
    deadline = time.monotonic() + _PICTURE_WAIT_S
    while not pictures or pictures[-1].time_s < burst.middle_s:
        picture = color.latest(seen, 0.05)
        if picture is not None:
            seen = picture.number
            pictures.append(picture)
        elif time.monotonic() > deadline:
            break
        latest(0, 0.0)
    if not pictures:
        raise WorkError("The auxiliary camera delivers no pictures.", "Unplug and reconnect it.")
    return burst, nearest_picture(pictures, burst.middle_s)


def grab_with_shutter(
    latest: LatestFrame, color: ColorCamera, frames: int, progress: Progress
) -> tuple[Burst, TimedPicture]:
    """Depth of the seconds around the moment at which somebody presses the shutter of a still camera.

    Depth frames are kept in a ring until the picture has arrived; those around its exposure are the burst.

    Raises
    ------
    WorkError
        If depth stops coming, or no picture comes within `SHUTTER_WAIT_S`.
    """
    first = latest(0, FRAME_TIMEOUT_S)
    if first is None or first.depth is None:
        raise WorkError("The camera has stopped delivering frames.", "Check its cable, then try again.")
    ring: deque[LiveFrame] = deque(maxlen=max(frames, _RING_BYTES // first.depth.nbytes))
    before = color.latest(0, 0.0)
    seen, number, picture = 0 if before is None else before.number, first.number, None
    started = last_s = time.monotonic()
    waiting = ScaledProgress(progress, 0.0, 0.9)
    while picture is None or not _enough(ring, frames, picture):
        now = time.monotonic()
        waiting((now - started) / SHUTTER_WAIT_S, "Press the shutter of the still camera")
        frame = latest(number, 0.1)
        if frame is not None:
            number, last_s = frame.number, now
            if frame.depth is not None:
                ring.append(_without_color(frame))
        elif now - last_s > FRAME_TIMEOUT_S:
            raise WorkError("The camera has stopped delivering frames.", "Check its cable, then try again.")
        if picture is None:
            picture = color.latest(seen, 0.0)
        if picture is None and now - started > SHUTTER_WAIT_S:
            raise WorkError(
                f"No picture came from the still camera within {SHUTTER_WAIT_S:.0f} seconds.",
                "Press its shutter; check that it saves into the watched folder.",
            )
    progress(1.0, "Picture and depth taken")
    return _around(list(ring), frames, picture.time_s), picture


def _enough(ring: deque[LiveFrame], frames: int, picture: TimedPicture) -> bool:
    """Whether as many frames lie after the picture as before it, or more will not help."""
    if len(ring) < frames:
        return False
    after = sum(1 for frame in ring if frame.time_s > picture.time_s)
    return after >= frames // 2 or ring[-1].time_s - picture.time_s > _STILL_COMING_S


def _around(ring: list[LiveFrame], frames: int, time_s: float) -> Burst:
    """The run of frames whose middle is nearest to a moment."""
    times = np.array([frame.time_s for frame in ring])
    middles = 0.5 * (times[: len(ring) - frames + 1] + times[frames - 1 :])
    start = int(np.abs(middles - time_s).argmin())
    chosen = ring[start : start + frames]
    return Burst(
        np.stack([frame.depth for frame in chosen if frame.depth is not None]),
        chosen[0].depth_unit_m,
        times[start : start + frames],
        None,
        0.0,
    )


def _without_color(frame: LiveFrame) -> LiveFrame:
    return LiveFrame(frame.number, frame.time_s, frame.depth, frame.depth_unit_m)
