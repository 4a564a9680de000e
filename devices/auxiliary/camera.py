"""What every auxiliary colour camera looks like: a webcam, or a still camera that drops files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from devices.live import CameraControl, LiveState, StreamMode

ColorCameraKind = Literal["uvc", "folder-watch"]

MOST_PIXELS = 25_000_000
"""Largest picture that is taken: 24 megapixels, with the odd rows that cameras add."""

TYPICAL_FIELD_OF_VIEW = math.radians(62.0)
"""Horizontal field of view that is assumed of a lens nobody has said anything about."""


@dataclass(frozen=True)
class ColorCameraInfo:
    """A colour camera that can be opened.

    Attributes
    ----------
    id : str
        ``kind:address``: ``uvc:0``, ``folder-watch:/path``.
    name : str
        For people.
    """

    id: str
    name: str
    kind: ColorCameraKind


@dataclass(frozen=True)
class ColorIdentity:
    """Which camera this is; the colour half of a calibration profile is bound to `serial`.

    Attributes
    ----------
    model : str
    serial : str
        Serial number, or the most lasting name that can be had (then `lasting` is False).
    lasting : bool
    """

    model: str
    serial: str
    lasting: bool


@dataclass(frozen=True, eq=False)
class TimedPicture:
    """One picture and when it was exposed. The array may be shared with others: read only.

    Attributes
    ----------
    number : int
        Counts the pictures since the camera was opened, from 1; gaps are pictures nobody took.
    time_s : float
        Middle of the exposure on the clock of `time.monotonic`, as well as it is known.
    rgb : ndarray (h, w, 3) uint8
    time_sigma_s : float
        How well `time_s` is known, standard deviation.
    focal_px : float or None
        Focal length that the picture itself tells (EXIF); a guess, not a calibration.
    warnings : tuple of str
    """

    number: int
    time_s: float
    rgb: NDArray[np.uint8]
    time_sigma_s: float = 0.02
    focal_px: float | None = None
    warnings: tuple[str, ...] = ()

    def nominal_camera(self) -> PinholeCamera:
        """Geometry to use before the camera is calibrated: what the picture tells, or a usual lens."""
        height, width = self.rgb.shape[:2]
        focal = self.focal_px or 0.5 * width / math.tan(0.5 * TYPICAL_FIELD_OF_VIEW)
        return PinholeCamera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


@runtime_checkable
class ColorCamera(Protocol):
    """A colour camera beside the depth camera."""

    @property
    def info(self) -> ColorCameraInfo:
        """Which camera this is."""

    @property
    def identity(self) -> ColorIdentity:
        """Model and serial number (open)."""

    @property
    def state(self) -> LiveState:
        """How the camera is now; cheap. A camera that only takes single pictures never stalls."""

    @property
    def streams(self) -> bool:
        """True if pictures come by themselves; False if somebody presses a shutter."""

    def open(self) -> None:
        """Start delivering pictures. Opening an open camera does nothing.

        Raises
        ------
        WorkError
            If the camera is not there or cannot be used, with what to do.
        """

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> TimedPicture | None:
        """The newest picture if its number is greater than ``after``; waits at most ``timeout_s`` for one.

        Raises
        ------
        WorkError
            If the camera is gone, with what to do.
        """

    def still(self, timeout_s: float = 10.0) -> TimedPicture:
        """A picture exposed from now on, at the camera's best resolution.

        Raises
        ------
        WorkError
            If none came in ``timeout_s``, or the camera is gone.
        """

    @property
    def mode(self) -> StreamMode | None:
        """Mode of the pictures; None before the first picture of a camera that only takes single ones."""

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes that can be chosen, the best resolution last; empty if the camera decides."""

    def choose_mode(self, mode: StreamMode) -> None:
        """Run in another mode.

        Raises
        ------
        InputError
            If there is no such mode.
        """

    def controls(self) -> tuple[CameraControl, ...]:
        """What can be set, with its present value.

        ``exposure_lock`` (1 keeps exposure and gain as they are now), ``auto_exposure``, ``exposure_s``,
        ``focus_lock``, ``auto_white_balance``, ``white_balance_k``.
        """

    def set_control(self, name: str, value: float) -> None:
        """Set a control; raise `InputError` if there is none of that name or the value is out of range."""

    def close(self) -> None:
        """Release the camera. Closing a closed camera does nothing."""


class ColorCameraFactory(Protocol):
    """Finds and makes the colour cameras of one kind."""

    def cameras(self) -> Sequence[ColorCameraInfo]:
        """Cameras of this kind that are there now. Without hardware: none, and no error."""

    def create(self, address: str) -> ColorCamera:
        """The camera at ``address``, not opened yet; raise `InputError` if there can be none."""
