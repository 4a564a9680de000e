"""A capture folder as a depth camera: what was recorded or exported is seen again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from core.capture import RgbdCapture, read_capture
from core.errors import InputError
from core.progress import Progress, no_progress
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame


class FolderCamera(OpenedByWith):
    """Delivers the capture of one capture folder (``geoderm-capture/1``).

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._capture: RgbdCapture | None = None

    @property
    def info(self) -> DeviceInfo:
        """Which folder this is."""
        return DeviceInfo(f"folder:{self._folder}", self._folder.name, "folder", False)

    def open(self) -> None:
        """Read the folder; raise `InputError` if it cannot be used."""
        if self._capture is None:
            self._capture = read_capture(self._folder)

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Return the folder's capture with every frame it has: a stored capture is not cut short."""
        progress(0.0, "Reading the capture folder")
        self.open()
        assert self._capture is not None
        progress(1.0, "Reading the capture folder")
        return self._capture

    def preview(self) -> PreviewFrame | None:
        """First depth frame and the picture, at a quarter of the size."""
        self.open()
        assert self._capture is not None
        depth = self._capture.depth_frames[0][::2, ::2].astype(np.float32) * self._capture.depth_unit_m
        color = self._capture.color
        return PreviewFrame(depth.astype(np.float32), None if color is None else color[::2, ::2])

    def close(self) -> None:
        """Forget the capture."""
        self._capture = None


class _Folders:
    """Factory of folder cameras: any folder a person names."""

    def devices(self) -> Sequence[DeviceInfo]:
        """None by themselves."""
        return []

    def create(self, address: str) -> FolderCamera:
        """Camera of the folder at a path."""
        folder = Path(address)
        if not folder.is_dir():
            raise InputError(f"{folder}: there is no such capture folder.")
        return FolderCamera(folder)


FOLDERS = _Folders()
