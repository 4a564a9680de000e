"""One open OpenNI2 stream, and what of it travels between the processes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError
from devices.openni.binding import binding_part

_DEPTH_UNITS_M = {100: 1e-3, 101: 1e-4}
_RGB888 = 200
_PLAUSIBLE_FOV_RAD = (0.2, 2.6)


@dataclass(frozen=True)
class StreamInfo:
    """What a stream delivers.

    Attributes
    ----------
    width, height : int
    fov_rad : float or None
        Horizontal field of view; None when the device does not tell a plausible one.
    unit_m : float
        Metres per depth step; 0 for colour.
    mirrored : bool
        Whether the pictures are mirror images.
    """

    width: int
    height: int
    fov_rad: float | None
    unit_m: float
    mirrored: bool


@dataclass(frozen=True)
class StreamBatch:
    """Consecutive frames of a device.

    Attributes
    ----------
    depth : list of ndarray (h, w) uint16
    color : list of ndarray (h, w, 3) uint8
    ended : bool
        True if frames stopped coming: the end of a file, or a stalled device.
    """

    depth: list[NDArray[np.uint16]]
    color: list[NDArray[np.uint8]]
    ended: bool


def _told(getter: Callable[[], Any]) -> Any:
    """Value of a property, or None where the driver does not know it: one without mirroring mirrors not."""
    refusal: type[Exception] = binding_part("utils").OpenNIError
    try:
        return getter()
    except refusal:
        return None


class OpenedStream:
    """A started stream inside the runtime's process."""

    def __init__(self, kind: str, stream: Any, is_file: bool) -> None:
        self.kind, self.stream = kind, stream
        if not is_file:
            # PS1080 mirrors by default, and a mirrored patient is a left/right error. A file keeps the flag
            # it was recorded with.
            if _told(stream.get_mirroring_enabled) is not None:
                stream.set_mirroring_enabled(False)
            if kind == "color":
                self._choose_rgb()

    def _choose_rgb(self) -> None:
        mode = self.stream.get_video_mode()
        if int(mode.pixelFormat) != _RGB888:
            self.stream.configure_mode(mode.resolutionX, mode.resolutionY, mode.fps, _RGB888)

    def start(self) -> None:
        """Start delivering."""
        self.stream.start()

    def info(self) -> StreamInfo:
        """Describe the stream; raise if its pixels are of a kind the application does not read."""
        mode = self.stream.get_video_mode()
        pixel_format = int(mode.pixelFormat)
        if self.kind == "depth" and pixel_format not in _DEPTH_UNITS_M:
            raise WorkError(
                "The depth stream is not in millimetres.",
                "Choose the 1 mm or 0.1 mm depth mode of the camera.",
            )
        if self.kind == "color" and pixel_format != _RGB888:
            raise WorkError("The colour stream is not RGB.", "Choose the RGB888 mode of the camera.")
        # A device without the property leaves garbage behind instead of an error.
        fov = float(_told(self.stream.get_horizontal_fov) or 0.0)
        low, high = _PLAUSIBLE_FOV_RAD
        return StreamInfo(
            width=int(mode.resolutionX),
            height=int(mode.resolutionY),
            fov_rad=fov if np.isfinite(fov) and low < fov < high else None,
            unit_m=_DEPTH_UNITS_M.get(pixel_format, 0.0),
            mirrored=bool(_told(self.stream.get_mirroring_enabled)),
        )

    def read(self) -> NDArray[Any]:
        """Copy of the frame that is ready; the runtime reuses its buffer at once."""
        frame = self.stream.read_frame()
        try:
            if self.kind == "depth":
                data = np.frombuffer(frame.get_buffer_as_uint16(), np.uint16)
                return data.reshape(frame.height, frame.width).copy()
            data8 = np.frombuffer(frame.get_buffer_as_uint8(), np.uint8)
            return data8.reshape(frame.height, frame.width, 3).copy()
        finally:
            frame.close()
