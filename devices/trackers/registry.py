"""Which skeleton trackers there are. A new one is one file plus one `register_tracker`."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from typing import Final

from core.anchors.skeleton import SkeletonTracker
from core.errors import InputError

TrackerFactory = Callable[[], SkeletonTracker]

TRACKERS: Final[dict[str, TrackerFactory]] = {}
"""Factories by name. A factory raises WorkError where its tracker cannot run on this computer."""

DEFAULT_TRACKER: Final = "mediapipe"

_open: dict[str, SkeletonTracker] = {}
_lock = threading.RLock()  # a factory may build on another tracker


def register_tracker(name: str, factory: TrackerFactory) -> None:
    """Make a tracker known under a name."""
    TRACKERS[name] = factory


def default_tracker(name: str = DEFAULT_TRACKER) -> SkeletonTracker:
    """Return the tracker of this process; loaded at the first call, closed before the interpreter ends.

    Raises
    ------
    InputError
        If no tracker has this name.
    WorkError
        If the tracker cannot run on this computer.
    """
    with _lock:
        if name not in _open:
            if name not in TRACKERS:
                raise InputError(f"There is no skeleton tracker '{name}'.", f"Known: {', '.join(TRACKERS)}.")
            _open[name] = TRACKERS[name]()
        return _open[name]


def close_trackers() -> None:
    """Close every tracker that `default_tracker` has loaded."""
    with _lock:
        while _open:
            _open.popitem()[1].close()


def _mediapipe() -> SkeletonTracker:
    from devices.trackers.mediapipe_pose import MediaPipeTracker

    return MediaPipeTracker()


register_tracker("mediapipe", _mediapipe)
atexit.register(close_trackers)
