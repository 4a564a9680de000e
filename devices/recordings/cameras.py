"""Recordings as cameras: any file, or folder of captures, that a person names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from devices.camera import DepthCamera, DeviceInfo
from devices.openni.recording import OniRecording

LIVE_SUFFIX = "?live"
"""After the path of a recording: play it in real time, again and again, as a live camera."""


class _Recordings:
    """Factory of recordings: any file, or folder of captures, that a person names."""

    def devices(self) -> Sequence[DeviceInfo]:
        """None by themselves."""
        return []

    def create(self, address: str) -> DepthCamera:
        """Recording at a path; with ``?live`` behind it, a live camera that plays it in real time."""
        if not address.endswith(LIVE_SUFFIX) or Path(address).exists():
            return OniRecording(Path(address))
        from devices.recordings.played import PlayedCamera

        return PlayedCamera(Path(address.removesuffix(LIVE_SUFFIX)))


RECORDINGS = _Recordings()
