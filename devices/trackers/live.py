"""The skeleton of the live picture, with the tracker that this computer has."""

from __future__ import annotations

import atexit
import threading
from typing import Final

from core.anchors.live import LiveSkeleton

_open: Final[set[LiveSkeleton]] = set()
_lock = threading.Lock()


def open_live_skeleton() -> LiveSkeleton:
    """A `LiveSkeleton` of its own for one viewfinder; loading takes some 0.2 s, so not in the GUI's thread.

    Close it when it is not needed any more; what was forgotten is closed before the interpreter ends.

    Raises
    ------
    WorkError
        If the tracker cannot run on this computer.
    """
    from devices.trackers.mediapipe_video import MediaPipeFollower

    live = LiveSkeleton(MediaPipeFollower())
    with _lock:
        _open.difference_update([old for old in _open if old.closed])
        _open.add(live)
    return live


def close_live_skeletons() -> None:
    """Close every live skeleton that was opened here."""
    with _lock:
        while _open:
            _open.pop().close()


atexit.register(close_live_skeletons)
