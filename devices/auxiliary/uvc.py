"""Webcams (UVC) as auxiliary colour cameras, read through OpenCV in a process of their own."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from core.errors import InputError
from devices.auxiliary.camera import ColorCameraInfo, ColorIdentity, TimedPicture
from devices.auxiliary.usb_names import node_of_path, video_node, video_nodes
from devices.camera_process.host import CameraProcess
from devices.live import CameraControl, LiveState, StreamMode

if TYPE_CHECKING:
    from devices.auxiliary.uvc_source import UvcSource
    from devices.camera_process.packets import Packet

_ADVICE = "Unplug and reconnect the colour camera, then try again."
_LATENCY_RANGE_S = (-1.0, 5.0)
_STAMP_SIGMA_S = 0.02


class UvcCamera:
    """A webcam; or a video file that is played as if it were one.

    Parameters
    ----------
    source : UvcSource
        What is read in the camera's process.
    info : ColorCameraInfo
    identity : ColorIdentity
    """

    def __init__(self, source: UvcSource, info: ColorCameraInfo, identity: ColorIdentity) -> None:
        self._source, self._info, self._identity = source, info, identity
        self._process = CameraProcess(source, "The colour camera", _ADVICE)
        self._mode: StreamMode | None = None

    @property
    def info(self) -> ColorCameraInfo:
        """Which camera this is."""
        return self._info

    @property
    def identity(self) -> ColorIdentity:
        """Model and serial number."""
        return self._identity

    @property
    def state(self) -> LiveState:
        """How the camera is now."""
        return self._process.state

    @property
    def streams(self) -> bool:
        """Pictures come by themselves."""
        return True

    @property
    def pid(self) -> int | None:
        """Process of the camera, for diagnosis."""
        return self._process.pid

    def open(self) -> None:
        """Start the camera's process; an open camera that is well stays as it is."""
        if self.state in (LiveState.STREAMING, LiveState.STALLED):
            return
        self._mode = _mode(self._process.open()["mode"])

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> TimedPicture | None:
        """The newest picture with a number greater than ``after``."""
        found = self._process.latest(after, timeout_s)
        return None if found is None else self._picture(*found)

    def still(self, timeout_s: float = 10.0) -> TimedPicture:
        """A picture exposed from now on, in the largest mode."""
        packet = self._process.request("still", timeout_s=timeout_s + 2.0, within_s=timeout_s)
        return self._picture(0, packet)

    @property
    def mode(self) -> StreamMode | None:
        """Mode the camera agreed to."""
        return self._mode

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes that the camera takes; finding them out interrupts the stream once."""
        return tuple(_mode(m) for m in self._process.request("modes", timeout_s=30.0))

    def choose_mode(self, mode: StreamMode) -> None:
        """Run in another resolution."""
        self._mode = _mode(self._process.request("choose_mode", size=(mode.width, mode.height)))

    def controls(self) -> tuple[CameraControl, ...]:
        """What can be set; ``latency_s`` is what is subtracted from the driver's time stamps."""
        offered = tuple(CameraControl(*c) for c in self._process.request("controls"))
        return (*offered, CameraControl("latency_s", self._source.latency_s, *_LATENCY_RANGE_S))

    def set_control(self, name: str, value: float) -> None:
        """Set a control."""
        known = {c.name: c for c in self.controls()}
        control = known.get(name)
        if control is None:
            raise InputError(f"The colour camera has no setting '{name}'.", f"It has {', '.join(known)}.")
        if not control.minimum <= value <= control.maximum:
            raise InputError(
                f"The setting '{name}' must be between {control.minimum:g} and {control.maximum:g}."
            )
        if name == "latency_s":
            self._source.latency_s = value
            self._process.request("latency", value=value)
        else:
            self._process.request("set_control", control=name, value=value)

    def close(self) -> None:
        """End the camera's process."""
        self._process.close()

    def _picture(self, number: int, packet: Packet) -> TimedPicture:
        rgb = packet.arrays["rgb"]
        warnings: tuple[str, ...] = ()
        height, width = rgb.shape[:2]
        best = number == 0
        if not best and self._mode is not None and (width, height) != (self._mode.width, self._mode.height):
            warnings = (
                f"The colour camera delivers {width} x {height} pixels instead of "
                f"{self._mode.width} x {self._mode.height}.",
            )
        return TimedPicture(number, packet.facts["time_s"], rgb, _STAMP_SIGMA_S, None, warnings)


def _mode(told: Sequence[int]) -> StreamMode:
    width, height, fps = told
    return StreamMode("color", width, height, fps, "rgb8")


class _UvcCameras:
    """Factory of ``uvc:INDEX``, ``uvc:DEVICE`` or ``uvc:FILE``, with ``?mode=1920x1080&latency_s=0.08``."""

    def cameras(self) -> Sequence[ColorCameraInfo]:
        """Webcams that the kernel lists (Linux); elsewhere they are opened by their number."""
        return [ColorCameraInfo(f"uvc:{n.number}", n.model, "uvc") for n in video_nodes()]

    def create(self, address: str) -> UvcCamera:
        """Webcam by number or device path; or a video file."""
        from devices.auxiliary.uvc_source import UvcSource

        place, _, options = address.partition("?")
        size, latency_s = _options(options)
        info = ColorCameraInfo(f"uvc:{address}", f"Colour camera {place}", "uvc")
        target: int | str = int(place) if place.isdigit() else place
        number = target if isinstance(target, int) else node_of_path(Path(place))
        if number is not None:
            node = video_node(number)
            if node is not None:
                info = ColorCameraInfo(info.id, node.model, "uvc")
                identity = ColorIdentity(node.model, node.serial, node.lasting)
            else:
                identity = ColorIdentity(info.name, f"uvc-{number}", False)
        else:
            path = Path(place)
            folder = path.parent if "%" in path.name else path
            if not place or not folder.exists():
                raise InputError(f"'{place}' is neither the number of a camera nor a file.", "Write uvc:0.")
            name = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:8]
            identity = ColorIdentity(path.name, f"video-file-{name}", False)
        return UvcCamera(UvcSource(target, size, latency_s), info, identity)


def _options(text: str) -> tuple[tuple[int, int] | None, float]:
    size, latency_s = None, 0.0
    for name, value in parse_qsl(text, keep_blank_values=True):
        if name == "mode":
            width, _, height = value.partition("x")
            if not (width.isdigit() and height.isdigit()):
                raise InputError(f"'{value}' is not a mode of a colour camera.", "Write 1920x1080.")
            size = int(width), int(height)
        elif name == "latency_s":
            latency_s = latency_of(value)
        else:
            raise InputError(f"A colour camera has no option '{name}'.", "It has mode and latency_s.")
    return size, latency_s


def latency_of(text: str) -> float:
    """A latency in seconds; raise `InputError` if it is none."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not _LATENCY_RANGE_S[0] <= value <= _LATENCY_RANGE_S[1]:
        raise InputError(f"'{text}' is not a latency.", "Write seconds, such as latency_s=0.08.")
    return value


UVC_CAMERAS = _UvcCameras()
