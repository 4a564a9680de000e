"""Recordings as cameras: any file, or folder of captures, that a person names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from core.capture.folder import CAPTURE_FILE
from core.errors import InputError
from devices.camera import DepthCamera, DeviceInfo
from devices.folders import FOLDERS
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
        path = Path(address)
        if not address.endswith(LIVE_SUFFIX) or path.exists():
            if (path / CAPTURE_FILE).is_file():
                return FOLDERS.create(address)
            if path.is_dir():
                raise InputError(
                    f"{path}: holds no capture itself.",
                    f"Write folder: and one capture folder in it, or recording:{path}{LIVE_SUFFIX}.",
                )
            return OniRecording(path)
        from devices.recordings.played import PlayedCamera

        return PlayedCamera(Path(address.removesuffix(LIVE_SUFFIX)))


RECORDINGS = _Recordings()
