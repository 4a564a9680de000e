"""What every depth camera looks like to the application: live, recorded or simulated."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.progress import Progress, no_progress

DeviceKind = Literal["simulator", "openni", "realsense", "rig", "recording", "folder"]

DEFAULT_FRAMES = 30
"""Depth frames that are fused into one capture, unless told otherwise."""


@dataclass(frozen=True)
class DeviceInfo:
    """A camera that can be opened.

    Attributes
    ----------
    id : str
        ``kind:address``, what `devices.registry.open_device` takes: ``simulator:m_young_avg``,
        ``folder:/path/to/capture``.
    name : str
        For people.
    kind : {"simulator", "openni", "realsense", "rig", "recording", "folder"}
        ``rig`` is a depth camera with an auxiliary colour camera beside it.
    live : bool
        True if the camera sees the present: it can be previewed and asked for any number of frames.
    """

    id: str
    name: str
    kind: DeviceKind
    live: bool


@dataclass(frozen=True, eq=False)
class PreviewFrame:
    """One small frame for the viewfinder; not for measuring.

    Attributes
    ----------
    depth_m : ndarray (h, w) float32 or None
        Metres, 0 where there is no measurement.
    rgb : ndarray (h', w', 3) uint8 or None
    """

    depth_m: NDArray[np.float32] | None
    rgb: NDArray[np.uint8] | None


@runtime_checkable
class DepthCamera(Protocol):
    """A depth camera with or without a colour camera beside it. A context manager: opens, then closes."""

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""

    def open(self) -> None:
        """Get ready to deliver frames. Opening an open camera does nothing.

        Raises
        ------
        WorkError
            If the camera, its driver or its file is not there, with what to do.
        """

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Hold still: ``frames`` depth frames and one colour picture of the same moment.

        Raises
        ------
        WorkError
            If frames stop coming.
        Cancelled
            Through ``progress``.
        """

    def preview(self) -> PreviewFrame | None:
        """Return the newest small frame at once, or None if the camera has none to show."""

    def close(self) -> None:
        """Release the camera. Closing a closed camera does nothing."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...


class OpenedByWith(ABC):
    """Makes a camera a context manager: opens, then closes."""

    @abstractmethod
    def open(self) -> None:
        """See `DepthCamera.open`."""

    @abstractmethod
    def close(self) -> None:
        """See `DepthCamera.close`."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()
