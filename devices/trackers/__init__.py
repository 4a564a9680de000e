"""Skeleton trackers: what finds the joints of a person in a picture."""

from devices.trackers.live import close_live_skeletons, open_live_skeleton
from devices.trackers.registry import TRACKERS, close_trackers, default_tracker, register_tracker

__all__ = [
    "TRACKERS",
    "close_live_skeletons",
    "close_trackers",
    "default_tracker",
    "open_live_skeleton",
    "register_tracker",
]
