"""Skeleton trackers: what finds the joints of a person in a picture."""

from devices.trackers.registry import TRACKERS, close_trackers, default_tracker, register_tracker

__all__ = ["TRACKERS", "close_trackers", "default_tracker", "register_tracker"]
