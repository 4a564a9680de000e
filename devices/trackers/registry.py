"""Which skeleton trackers there are. A new one is one file plus one `register_tracker`.

There are two kinds: those that find a person in a picture (`SkeletonTracker`), and those that follow a depth
stream by themselves (`DepthTracker`).
"""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from typing import Final

from core.anchors.skeleton import SkeletonTracker
from core.anchors.tracked import DepthTracker
from core.errors import InputError

TrackerFactory = Callable[[], SkeletonTracker]

TRACKERS: Final[dict[str, TrackerFactory]] = {}
"""Factories by name. A factory raises WorkError where its tracker cannot run on this computer."""

DepthTrackerFactory = Callable[[], DepthTracker]

DEPTH_TRACKERS: Final[dict[str, DepthTrackerFactory]] = {}
"""Factories by name of trackers that follow a depth stream. `DepthTracker.start` tells what is missing."""

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
            if name in DEPTH_TRACKERS:
                raise InputError(
                    f"The tracker '{name}' follows a depth camera; it does not read pictures.",
                    f"Trackers for pictures: {', '.join(TRACKERS)}.",
                )
            if name not in TRACKERS:
                raise InputError(f"There is no skeleton tracker '{name}'.", f"Known: {', '.join(TRACKERS)}.")
            _open[name] = TRACKERS[name]()
        return _open[name]


def register_depth_tracker(name: str, factory: DepthTrackerFactory) -> None:
    """Make a tracker that follows a depth stream known under a name."""
    DEPTH_TRACKERS[name] = factory


def depth_tracker(name: str = "nite2") -> DepthTracker:
    """A new depth tracker, not started; the caller closes it.

    Raises
    ------
    InputError
        If no depth tracker has this name.
    """
    if name not in DEPTH_TRACKERS:
        raise InputError(
            f"There is no depth tracker '{name}'.", f"Known: {', '.join(DEPTH_TRACKERS) or 'none'}."
        )
    return DEPTH_TRACKERS[name]()


def close_trackers() -> None:
    """Close every tracker that `default_tracker` has loaded."""
    with _lock:
        while _open:
            _open.popitem()[1].close()


def _mediapipe() -> SkeletonTracker:
    from devices.trackers.mediapipe_pose import MediaPipeTracker

    return MediaPipeTracker()


def _nite2() -> DepthTracker:
    from devices.trackers.nite2 import Nite2Tracker

    return Nite2Tracker()


register_tracker("mediapipe", _mediapipe)
register_depth_tracker("nite2", _nite2)
atexit.register(close_trackers)
