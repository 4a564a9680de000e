"""One OpenNI2 stream inside the runtime's process, and what of it is told to the application."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError
from devices.openni.binding import binding_part

if TYPE_CHECKING:
    from devices.live import StreamKind

DEPTH_UNITS_M = {100: 1e-3, 101: 1e-4}
_RGB888 = 200
_FORMATS: dict[StreamKind, dict[int, str]] = {
    "depth": {100: "DEPTH_1_MM", 101: "DEPTH_100_UM"},
    "color": {_RGB888: "RGB888"},
    "infrared": {203: "GRAY16", 202: "GRAY8"},
}
_PREFERRED = (640, 480, 30)
_PLAUSIBLE_FOV_RAD = (0.2, 2.6)
_MAX_SIDE = 8192


class Mode(NamedTuple):
    """`devices.live.StreamMode` as it travels between the processes."""

    kind: StreamKind
    width: int
    height: int
    fps: int
    pixel_format: str


@dataclass(frozen=True)
class StreamInfo:
    """What a stream delivers.

    Attributes
    ----------
    width, height : int
    fov_rad : float or None
        Horizontal field of view; None when the device does not tell a plausible one.
    unit_m : float
        Metres per depth step; 0 for colour and infrared.
    mirrored : bool
        Whether the pictures are mirror images.
    pixel_format : str
    fps : int
    frames : int
        Number of frames of a recording, 0 of a camera.
    """

    width: int
    height: int
    fov_rad: float | None
    unit_m: float
    mirrored: bool
    pixel_format: str = ""
    fps: int = 0
    frames: int = 0


def told(getter: Callable[[], Any]) -> Any:
    """Value of a property, or None where the driver does not know it: one without mirroring mirrors not."""
    refusal: type[Exception] = binding_part("utils").OpenNIError
    try:
        return getter()
    except refusal:
        return None


class OpenedStream:
    """A stream of a device or a recording, started or not."""

    def __init__(self, kind: StreamKind, stream: Any, is_file: bool) -> None:
        self.kind, self.stream, self.is_file = kind, stream, is_file
        self.running = False
        self._layout: tuple[tuple[int, ...], str] = ((0, 0), "uint16")
        if not is_file:
            # PS1080 mirrors by default, and a mirrored patient is a left/right error. A file keeps the flag
            # it was recorded with.
            if told(stream.get_mirroring_enabled):
                told(lambda: stream.set_mirroring_enabled(False))
            self._choose_default()
        self.flips = not is_file and bool(told(stream.get_mirroring_enabled))

    def modes(self) -> list[Mode]:
        """Modes whose pixels the application reads, without repetition."""
        formats = _FORMATS[self.kind]
        found = [
            Mode(
                self.kind,
                int(m.resolutionX),
                int(m.resolutionY),
                int(m.fps),
                formats[_number(m.pixelFormat)],
            )
            for m in self.stream.get_sensor_info().videoModes
            if _number(m.pixelFormat) in formats and m.fps > 0
        ]
        return list(dict.fromkeys(found))

    def mode(self) -> Mode | None:
        """The present mode; None if its pixels are of a kind the application does not read."""
        m = self.stream.get_video_mode()
        name = _FORMATS[self.kind].get(_number(m.pixelFormat))
        if name is None:
            return None
        return Mode(self.kind, int(m.resolutionX), int(m.resolutionY), int(m.fps), name)

    def choose(self, mode: Mode) -> None:
        """Change the mode of a stopped stream."""
        number = next(n for n, name in _FORMATS[self.kind].items() if name == mode.pixel_format)
        self.stream.configure_mode(mode.width, mode.height, mode.fps, number)

    def _choose_default(self) -> None:
        offered = self.modes()
        usual = [m for m in offered if (m.width, m.height, m.fps) == _PREFERRED]
        present = self.mode()
        wanted = usual[0] if usual else present or (offered[0] if offered else None)
        if wanted is not None and wanted != present:
            self.choose(wanted)

    def start(self) -> None:
        """Start delivering."""
        if not self.running:
            self._layout = self.image_layout()
            self.stream.start()
            self.running = True

    def stop(self) -> None:
        """Stop delivering."""
        if self.running:
            self.running = False
            self.stream.stop()

    def info(self) -> StreamInfo:
        """Describe the stream; raise if its pixels are of a kind the application does not read."""
        mode = self.mode()
        if mode is None:
            raise WorkError(
                {
                    "depth": "The depth stream is not in millimetres.",
                    "color": "The colour stream is not RGB.",
                    "infrared": "The infrared stream is not in shades of grey.",
                }[self.kind],
                f"Choose one of the modes {', '.join(_FORMATS[self.kind].values())} of the camera.",
            )
        if not (0 < mode.width <= _MAX_SIDE and 0 < mode.height <= _MAX_SIDE):
            raise WorkError(f"The {self.kind} pictures have an impossible size.", "Choose another recording.")
        # A device without the property leaves garbage behind instead of an error.
        fov = float(told(self.stream.get_horizontal_fov) or 0.0)
        low, high = _PLAUSIBLE_FOV_RAD
        number = _number(self.stream.get_video_mode().pixelFormat)
        return StreamInfo(
            width=mode.width,
            height=mode.height,
            fov_rad=fov if np.isfinite(fov) and low < fov < high else None,
            unit_m=DEPTH_UNITS_M.get(number, 0.0) if self.kind == "depth" else 0.0,
            mirrored=self.is_file and bool(told(self.stream.get_mirroring_enabled)),
            pixel_format=mode.pixel_format,
            fps=mode.fps,
            frames=max(int(told(self.stream.get_number_of_frames) or 0), 0) if self.is_file else 0,
        )

    def image_layout(self) -> tuple[tuple[int, ...], str]:
        """Shape and type of one image."""
        info = self.info()
        shape: tuple[int, ...] = (info.height, info.width)
        if self.kind == "color":
            return (*shape, 3), "uint8"
        return shape, "uint8" if info.pixel_format == "GRAY8" else "uint16"

    def read(self, use: Callable[[NDArray[Any], float], None]) -> None:
        """Hand the frame that is ready to ``use`` (image, time stamp in seconds) and give it back.

        The image is valid only during the call: the runtime reuses its memory at once. A frame whose size is
        not that of the mode (a driver in the middle of a change) is left out.
        """
        shape, dtype_name = self._layout
        dtype = np.dtype(dtype_name)
        frame = self.stream.read_frame()
        try:
            row = shape[1] * int(np.prod(shape[2:], dtype=int)) * dtype.itemsize
            stride = frame.stride if frame.stride >= row else row
            if (frame.height, frame.width) != shape[:2] or frame.dataSize < stride * (shape[0] - 1) + row:
                return
            raw: Any = (ctypes.c_uint8 * int(frame.dataSize)).from_address(frame.data)
            inner = (shape[2] * dtype.itemsize, dtype.itemsize) if len(shape) == 3 else (dtype.itemsize,)
            image: NDArray[Any] = np.ndarray(shape, dtype, raw, 0, (stride, *inner))
            use(image[:, ::-1] if self.flips else image, frame.timestamp * 1e-6)
        finally:
            frame.close()


def _number(pixel_format: Any) -> int:
    return int(getattr(pixel_format, "value", pixel_format))
