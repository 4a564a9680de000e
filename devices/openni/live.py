"""A connected OpenNI2 camera as a live device of the application."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection
from typing import Any

import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    STALLED_AFTER_S,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)
from devices.openni.calibration import NOMINAL_WARNING, check_profile_sizes, nominal_rig
from devices.openni.identity import identity_of
from devices.openni.process import RuntimeProcess
from devices.openni.ring import FrameRing
from devices.openni.session import OpenedDevice, StartedStreams
from devices.openni.settings import REGISTRATION
from devices.openni.streams import Mode, StreamInfo

HUNG_AFTER_S = 6.0
"""The runtime's process gives a sign of life many times a second; without one for this long it hangs."""

REGISTERED_WARNING = (
    "The camera's own registration of depth and colour is switched on: it follows the factory's geometry, "
    "and clicks on the picture may miss the skin by about a centimetre. Switch it off and calibrate instead."
)
_POLL_S = 0.002
_VGA = StreamInfo(640, 480, None, 0.001, False)


class OpenNICamera(OpenedByWith):
    """A connected camera (Kinect class) through the OpenNI2 runtime.

    The runtime works in a process of its own, which streams into shared memory; `latest` copies from there.
    After the camera is gone (unplugged, runtime crashed or hung) `latest` and `capture` say so once; opening
    it again (which `capture` does by itself) is the way back, with the modes and settings that were chosen.

    Parameters
    ----------
    uri : str
        As the runtime lists it.
    name : str
        For people.
    """

    def __init__(self, uri: str, name: str = "Depth camera") -> None:
        self._info = DeviceInfo(f"openni:{uri}", name, "openni", True)
        self._uri = uri
        self._runtime = RuntimeProcess("camera")
        self._lock = threading.Lock()  # of the ring, the failure and what is started
        self._ring: FrameRing | None = None
        self._started: StartedStreams | None = None
        self._device: OpenedDevice | None = None
        self._failure: WorkError | None = None
        self._profile: CalibrationProfile | None = None
        self._chosen: dict[StreamKind, StreamMode] = {}
        self._set: dict[str, float] = {}
        self._last_number = 0
        self._switching = False  # the streams are being started anew: no frame now, but nothing is wrong

    # --- what it is

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        return self._info

    @property
    def identity(self) -> CameraIdentity:
        """Which rig this is; before it was opened, only by its address."""
        return identity_of(self._device, self._uri, self._info.name)

    @property
    def runtime_pid(self) -> int | None:
        """Process in which the runtime works for this camera."""
        return self._runtime.pid

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration; None goes back to nominal geometry.

        Raises
        ------
        InputError
            If it belongs to other serial numbers or other image sizes.
        """
        if profile is not None:
            mine = self.identity
            if not profile.fits(mine.depth_serial, mine.color_serial):
                raise InputError(
                    f"The calibration belongs to camera {profile.depth_serial}, not to {mine.depth_serial}.",
                    "Calibrate this camera.",
                )
            check_profile_sizes(profile, *self._sizes())
        self._profile = profile

    @property
    def rig(self) -> CameraRig:
        """Geometry in force. With the device's registration on, depth is in the colour camera's frame."""
        infos = self._infos()
        depth = infos.get("depth") or infos.get("infrared") or _VGA
        rig = self._profile.rig if self._profile else nominal_rig(depth, infos.get("color"))
        color = rig.color
        if not self._registered or color is None:
            return rig
        if (color.width, color.height) != (depth.width, depth.height):
            raise WorkError(
                "The camera's own registration needs depth and colour pictures of one size.",
                "Choose modes of the same size, or switch the registration off.",
            )
        return CameraRig(color, color, RigidTransform())

    @property
    def _registered(self) -> bool:
        return bool(self._set.get(REGISTRATION, 0.0))

    def _infos(self) -> dict[StreamKind, StreamInfo]:
        started = self._started
        return {} if started is None else dict(started.infos)

    def _sizes(self) -> tuple[tuple[int, int] | None, tuple[int, int] | None]:
        infos = self._infos()
        depth, color = infos.get("depth") or infos.get("infrared"), infos.get("color")
        return (
            None if depth is None else (depth.width, depth.height),
            None if color is None else (color.width, color.height),
        )

    # --- opening and closing

    def open(self) -> None:
        """Start the runtime's process and the default streams.

        Raises
        ------
        WorkError
            If the camera or its driver is not there, with what to do.
        """
        if self.state in (LiveState.STREAMING, LiveState.STALLED):
            return
        self.close()
        try:
            self._device = self._runtime.request("open", address=self._uri, is_file=False)
            self._begin([kind for kind in DEFAULT_STREAMS if kind in self._device.kinds])
            for name, value in self._set.items():
                self._runtime.request("set_control", name=name, value=value)
        except BaseException:
            self.close()
            raise
        self._drop_unfitting_profile()

    def close(self) -> None:
        """Release the camera and end its process."""
        self._let_go(None)
        self._runtime.stop()

    def _let_go(self, failure: WorkError | None) -> None:
        with self._lock:
            ring, self._ring = self._ring, None
            if ring is not None:
                self._last_number = max(self._last_number, ring.newest)
                ring.close()
            if failure is None or self._failure is None:
                self._failure = failure

    # --- streams

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds from now on.

        Raises
        ------
        WorkError
            If the camera has no such stream, or cannot run them together. What ran before runs on.
        """
        if self._ring is None:
            self.open()
        before = list(self._infos())
        try:
            self._begin(streams)
        except WorkError:
            if self._runtime.alive:
                self._begin(before)
            raise

    def _begin(self, streams: Collection[StreamKind]) -> None:
        chosen = {
            kind: Mode(kind, mode.width, mode.height, mode.fps, mode.pixel_format)
            for kind, mode in self._chosen.items()
        }
        self._switching = True
        try:
            self._let_go(None)
            started: StartedStreams = self._runtime.request(
                "start", kinds=tuple(streams), modes=chosen, before=self._last_number
            )
            with self._lock:
                self._ring = FrameRing.attach(started.layout, started.ring)
                self._started = started
        finally:
            self._switching = False
        if self._registered:  # it must be set after the streams start
            self._runtime.request("set_control", name=REGISTRATION, value=1.0)

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes that can be chosen."""
        return () if self._device is None else tuple(StreamMode(*mode) for mode in self._device.modes)

    def choose_mode(self, mode: StreamMode) -> None:
        """Run one stream in another mode; a profile for other image sizes is dropped.

        Raises
        ------
        InputError
            If the camera has no such mode.
        """
        if mode not in self.modes():
            raise InputError(
                f"The camera has no mode {mode.width} x {mode.height} at {mode.fps}/s, {mode.pixel_format}.",
                "Choose one of those that `geoderm devices --modes` shows.",
            )
        earlier = dict(self._chosen)
        self._chosen[mode.kind] = mode
        try:
            self._begin(list(self._infos()))
        except WorkError:
            self._chosen = earlier
            if self._runtime.alive:
                self._begin(list(self._infos()))
            raise
        self._drop_unfitting_profile()

    def _drop_unfitting_profile(self) -> None:
        if self._profile is not None:
            try:
                self.use_profile(self._profile)
            except InputError:
                self._profile = None

    def controls(self) -> tuple[CameraControl, ...]:
        """What can be set, with its present value."""
        return tuple(CameraControl(*found) for found in self._request("controls"))

    def set_control(self, name: str, value: float) -> None:
        """Set a control; raise `InputError` if there is none of that name or the value is out of range."""
        self._request("set_control", name=name, value=value)
        self._set[name] = value

    def _request(self, operation: str, **arguments: Any) -> Any:
        if self._ring is None:
            raise self._failure or WorkError("The camera is closed.", "Open it first.")
        try:
            return self._runtime.request(operation, **arguments)
        except WorkError as error:
            if not self._runtime.alive:
                self._let_go(error)
            raise

    # --- frames

    @property
    def state(self) -> LiveState:
        """How the camera is now."""
        if self._failure is None:
            try:
                self._check()
            except WorkError:
                return LiveState.GONE
        with self._lock:
            if self._ring is None:
                if self._switching:
                    return LiveState.STREAMING
                return LiveState.CLOSED if self._failure is None else LiveState.GONE
            silent_s = time.monotonic() - self._ring.arrived_s
        return LiveState.STALLED if silent_s > STALLED_AFTER_S else LiveState.STREAMING

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame if its number is greater than ``after``; waits at most ``timeout_s`` for one.

        Raises
        ------
        WorkError
            If the camera is gone or closed.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            self._check()
            with self._lock:
                ring, switching = self._ring, self._switching
                if ring is None and not switching:
                    raise self._failure or WorkError("The camera is closed.", "Open it first.")
                frame = None if ring is None else ring.read(after)
            if frame is not None:
                return frame
            remaining = deadline - time.monotonic()
            if remaining <= 0:
                return None
            time.sleep(min(_POLL_S, remaining))

    def _check(self) -> None:
        """Raise and clear up if the camera is gone."""
        with self._lock:
            if self._ring is None:
                return
            unplugged = self._ring.gone
            silent_s = time.monotonic() - self._ring.heartbeat_s
        if unplugged:
            failure = WorkError(
                "The camera was unplugged; what was saved is safe.", "Plug it in again and reconnect."
            )
        elif not self._runtime.alive:
            failure = self._runtime.crashed()
        elif silent_s > HUNG_AFTER_S and not self._runtime.busy:
            failure = self._runtime.hung(silent_s)
        else:
            return
        self._let_go(failure)
        # A healthy process completes a recording that was going on.
        self._runtime.stop(patience_s=3.0 if unplugged else 0.2)
        raise failure

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames from now on and the colour picture nearest to their middle."""
        if self._ring is None:
            self.open()
        burst = collect_burst(self.latest, frames, progress)
        warnings = (NOMINAL_WARNING,) if self._profile is None else ()
        if self._registered:
            warnings = (*warnings, REGISTERED_WARNING)
        return assemble_capture(
            burst, self.rig, sensor=self.identity.sensor, profile=self._profile, warnings=warnings
        )

    def preview(self) -> PreviewFrame | None:
        """Newest frame, at a quarter of the size."""
        frame = self.latest()
        if frame is None:
            return None
        depth = frame.depth
        return PreviewFrame(
            None if depth is None else (depth[::2, ::2] * frame.depth_unit_m).astype(np.float32),
            None if frame.rgb is None else frame.rgb[::2, ::2],
        )

    # --- the runtime's own recorder

    def record_oni(self, path: str, lossy_color: bool = False) -> None:
        """Let the runtime record the running streams into a file until `stop_recording`."""
        self._request("record", path=path, lossy=lossy_color)

    def stop_recording(self) -> None:
        """Complete the file."""
        self._request("stop_recording")
