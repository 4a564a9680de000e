"""Skeleton trackers: what finds the joints of a person in a picture."""

from devices.trackers.live import close_live_skeletons, open_live_skeleton
from devices.trackers.registry import (
    DEPTH_TRACKERS,
    TRACKERS,
    close_trackers,
    default_tracker,
    depth_tracker,
    register_depth_tracker,
    register_tracker,
)

__all__ = [
    "DEPTH_TRACKERS",
    "TRACKERS",
    "close_live_skeletons",
    "close_trackers",
    "default_tracker",
    "depth_tracker",
    "open_live_skeleton",
    "register_depth_tracker",
    "register_tracker",
]
