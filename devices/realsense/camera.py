"""Intel RealSense cameras as live depth cameras of the application."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.auxiliary.profiles import check_profile, fits_sizes
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.camera_process.host import CameraProcess
from devices.live import (
    DEFAULT_STREAMS,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)
from devices.realsense import library
from devices.realsense.frames import FORMATS
from devices.realsense.geometry import camera_of, transform_of

if TYPE_CHECKING:
    from devices.realsense.source import RealSenseSource

SENSOR = "realsense-d4xx"
FACTORY_WARNING = (
    "The factory calibration of the camera was used; calibrate the rig to know how well colour and depth fit."
)
_ADVICE = "Unplug and reconnect the RealSense camera, then choose it again."
_PREVIEW_WIDTH = 320
_CLOSED = WorkError("The RealSense camera is closed.", "Open it first.")


class RealSenseCamera(OpenedByWith):
    """A RealSense camera; the library works in a process of its own.

    Parameters
    ----------
    serial : str
        Empty for the first one found.
    name : str
        For people, before the camera has told its own.
    source : RealSenseSource, optional
        What the process reads; the camera with this serial number unless given.
    """

    def __init__(
        self, serial: str = "", name: str = "RealSense camera", source: RealSenseSource | None = None
    ) -> None:
        if source is None:
            from devices.realsense.source import RealSenseSource

            source = RealSenseSource(serial)
        self._serial, self._name = serial, name
        self._process = CameraProcess(source, "The RealSense camera", _ADVICE)
        self._identity: CameraIdentity | None = None
        self._factory: CameraRig | None = None
        self._lens_warnings: tuple[str, ...] = ()
        self._profile: CalibrationProfile | None = None

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        return DeviceInfo(f"realsense:{self._serial}", self._name, "realsense", True)

    @property
    def identity(self) -> CameraIdentity:
        """Model and serial number."""
        if self._identity is None:
            raise _CLOSED
        return self._identity

    @property
    def rig(self) -> CameraRig:
        """Geometry in force: the profile's, or the factory's."""
        if self._factory is None:
            raise _CLOSED
        return self._factory if self._profile is None else self._profile.rig

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration of this camera in its present modes; None for the factory's."""
        if profile is not None:
            if self._factory is None:
                raise _CLOSED
            check_profile(profile, self.identity, self._factory)
        self._profile = profile

    @property
    def state(self) -> LiveState:
        """How the camera is now."""
        return self._process.state

    @property
    def pid(self) -> int | None:
        """Process in which the library works, for diagnosis."""
        return self._process.pid

    def open(self) -> None:
        """Start the library's process, depth and colour."""
        if self.state in (LiveState.STREAMING, LiveState.STALLED):
            return
        facts = self._process.open()
        self._name = facts["name"]
        serial = facts["serial"] or "unknown"
        self._learn(facts)
        color = serial if self._factory is not None and self._factory.has_color else ""
        self._identity = CameraIdentity(self._name, serial, color, SENSOR, bool(facts["serial"]))

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds from now on; all three can run together."""
        self._learn(self._process.request("start", kinds=list(streams)))

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame with a number greater than ``after``."""
        found = self._process.latest(after, timeout_s)
        if found is None:
            return None
        number, packet = found
        times, arrays = packet.facts["times"], packet.arrays
        leading = next(k for k in FORMATS if k in times)
        return LiveFrame(
            number,
            times[leading],
            arrays.get("depth"),
            packet.facts["unit_m"],
            arrays.get("color"),
            times.get("color", 0.0),
            arrays.get("infrared"),
        )

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames and the colour picture nearest to their middle."""
        burst = collect_burst(self.latest, frames, progress)
        warnings = () if self._profile is not None else (FACTORY_WARNING, *self._lens_warnings)
        return assemble_capture(burst, self.rig, sensor=SENSOR, profile=self._profile, warnings=warnings)

    def preview(self) -> PreviewFrame | None:
        """Newest small frame."""
        frame = self.latest()
        if frame is None or frame.depth is None:
            return None
        step = max(1, frame.depth.shape[1] // _PREVIEW_WIDTH)
        depth = frame.depth[::step, ::step].astype(np.float32) * np.float32(frame.depth_unit_m)
        rgb = frame.rgb
        small = None if rgb is None else rgb[:: (k := max(1, rgb.shape[1] // _PREVIEW_WIDTH)), ::k]
        return PreviewFrame(depth, small)

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes that the camera offers."""
        return tuple(
            StreamMode(kind, width, height, fps, FORMATS[kind])
            for kind, width, height, fps in self._process.request("modes")
        )

    def choose_mode(self, mode: StreamMode) -> None:
        """Run one stream in another mode; a calibration of other image sizes is dropped."""
        wanted = (mode.width, mode.height, mode.fps)
        self._learn(self._process.request("choose_mode", kind=mode.kind, mode=wanted))

    def controls(self) -> tuple[CameraControl, ...]:
        """What can be set. Names with ``depth_`` are of the depth sensor, the others of the colour camera."""
        return tuple(CameraControl(*c) for c in self._process.request("controls"))

    def set_control(self, name: str, value: float) -> None:
        """Set a control; a value by hand switches its automatic off."""
        known = {c.name: c for c in self.controls()}
        control = known.get(name)
        if control is None:
            raise InputError(f"The RealSense camera has no setting '{name}'.", f"It has {', '.join(known)}.")
        if not control.minimum <= value <= control.maximum:
            raise InputError(
                f"The setting '{name}' must be between {control.minimum:g} and {control.maximum:g}."
            )
        self._process.request("set_control", control=name, value=value)

    def close(self) -> None:
        """End the library's process."""
        self._process.close()

    def _learn(self, facts: Mapping[str, Any]) -> None:
        self._factory, self._lens_warnings = factory_rig(facts)
        if self._profile is not None and not fits_sizes(self._profile, self._factory):
            self._profile = None


def factory_rig(facts: Mapping[str, Any]) -> tuple[CameraRig, tuple[str, ...]]:
    """Rig of the library's own calibration, and warnings about its lenses."""
    depth, warnings = camera_of(facts["depth"])
    if facts["color"] is None:
        return CameraRig(depth), warnings
    color, more = camera_of(facts["color"])
    return CameraRig(depth, color, transform_of(facts["rotation"], facts["translation"])), warnings + more


class _RealSenseCameras:
    """Factory of ``realsense:SERIAL``."""

    def devices(self) -> Sequence[DeviceInfo]:
        """Connected cameras; none without the library."""
        if not library.is_installed() or not library.may_be_connected():
            return []
        from devices.realsense.source import RealSenseList

        process = CameraProcess(RealSenseList(), "The RealSense library", _ADVICE)
        try:
            found = process.open(10.0)["found"]
        except WorkError:
            return []
        finally:
            process.close()
        return [DeviceInfo(f"realsense:{serial}", name, "realsense", True) for serial, name in found]

    def create(self, address: str) -> RealSenseCamera:
        """Camera with a serial number."""
        return RealSenseCamera(address)


REALSENSE_CAMERAS = _RealSenseCameras()
