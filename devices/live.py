"""What a running camera shows from moment to moment: the contract of every live device."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig
from devices.camera import DepthCamera

StreamKind = Literal["depth", "color", "infrared"]

DEFAULT_STREAMS: tuple[StreamKind, ...] = ("depth", "color")

STALLED_AFTER_S = 2.0
"""A stream that has brought nothing for this long is called stalled."""


class LiveState(Enum):
    """How a live camera is."""

    CLOSED = "closed"
    STREAMING = "streaming"
    STALLED = "stalled"
    GONE = "gone"


@dataclass(frozen=True)
class CameraIdentity:
    """Which rig this is; a calibration profile is bound to it.

    Attributes
    ----------
    model : str
        Of the depth camera, for people.
    depth_serial : str
        Serial number, or the most lasting name the driver tells (then `lasting` is False).
    color_serial : str
        Of the colour camera that takes the pictures; equal to `depth_serial` where it is built in, empty
        without colour.
    sensor : str
        Name of the sensor's noise model (`core.capture.sensors`), empty if unknown.
    lasting : bool
        False if the driver tells no serial number, so that two cameras of a model cannot be told apart.
    """

    model: str
    depth_serial: str
    color_serial: str
    sensor: str
    lasting: bool = True


@dataclass(frozen=True)
class StreamMode:
    """One way a stream can run."""

    kind: StreamKind
    width: int
    height: int
    fps: int
    pixel_format: str


@dataclass(frozen=True)
class CameraControl:
    """Something about the picture that can be set: exposure, white balance.

    Attributes
    ----------
    name : str
        ``auto_exposure``, ``exposure_s``, ``gain``, ``auto_white_balance``, ``white_balance_k``,
        ``device_registration``.
    value, minimum, maximum : float
        Switches are 0 and 1.
    """

    name: str
    value: float
    minimum: float = 0.0
    maximum: float = 1.0


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """One moment, in full stream resolution, never mirrored. The arrays belong to the receiver.

    Attributes
    ----------
    number : int
        Counts the frames of the camera since it was started, from 1; gaps are frames nobody took.
    time_s : float
        Middle of the depth exposure on the clock of `time.monotonic`, as well as it is known.
    depth : ndarray (h, w) uint16 or None
        Raw depth; 0 means no measurement.
    depth_unit_m : float
    rgb : ndarray (h', w', 3) uint8 or None
    color_time_s : float
        As `time_s`, of the colour picture.
    infrared : ndarray (h, w) uint8 or uint16, or None
    """

    number: int
    time_s: float
    depth: NDArray[np.uint16] | None
    depth_unit_m: float = 0.001
    rgb: NDArray[np.uint8] | None = None
    color_time_s: float = 0.0
    infrared: NDArray[Any] | None = None


@runtime_checkable
class LiveCamera(DepthCamera, Protocol):
    """A depth camera that sees the present.

    `open` starts the default streams. `latest` and `capture` may be called from different threads at the same
    time: a burst does not stop the viewfinder.
    """

    @property
    def identity(self) -> CameraIdentity:
        """Which rig this is (open)."""

    @property
    def rig(self) -> CameraRig:
        """Geometry in force: the profile's, or nominal (open)."""

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use; None means nominal geometry, and captures carry a warning."""

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration.

        Raises
        ------
        InputError
            If it belongs to other serial numbers or other image sizes.
        """

    @property
    def state(self) -> LiveState:
        """How the camera is now; cheap."""

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds from now on (`open` does it with the defaults).

        Raises
        ------
        WorkError
            If the camera has no such stream or cannot run them together (Kinect: infrared and colour).
        """

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame if its number is greater than ``after``; waits at most ``timeout_s`` for one.

        Returns None if none came in time; `state` then tells whether the camera has stalled.

        Raises
        ------
        WorkError
            If the camera is gone (unplugged, its driver crashed), with what to do. Opening it again is the
            way back.
        """

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes that can be chosen."""

    def choose_mode(self, mode: StreamMode) -> None:
        """Run one stream in another mode. The profile in use must still fit, or it is dropped."""

    def controls(self) -> tuple[CameraControl, ...]:
        """What can be set, with its present value."""

    def set_control(self, name: str, value: float) -> None:
        """Set a control; raise `InputError` if there is none of that name or the value is out of range."""
