"""A depth camera with an auxiliary colour camera beside it, as one live camera."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.auxiliary.body_motion import reduced_depth
from devices.auxiliary.camera import ColorCamera, TimedPicture
from devices.auxiliary.grab import grab_streaming, grab_with_shutter
from devices.auxiliary.latency import Latency, Movement, find_latency, small_grey
from devices.auxiliary.pairing import DepthTrail, PairedMotion
from devices.auxiliary.profiles import check_profile
from devices.burst import assemble_capture
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    CameraControl,
    CameraIdentity,
    LiveCamera,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)

NOMINAL_WARNING = (
    "The auxiliary camera is not calibrated: its place and lens are guessed; clicks may be centimetres off."
)
_GUESSED_PLACE = RigidTransform.from_matrix(
    np.array([[1.0, 0, 0, 0], [0, 1, 0, 0.06], [0, 0, 1, 0], [0, 0, 0, 1]])
)
"""Before calibration: 6 cm above the depth camera, looking the same way."""

_BUILT_IN = frozenset(
    ("auto_exposure", "exposure_s", "gain", "auto_white_balance", "white_balance_k", "device_registration")
)
_PREVIEW_WIDTH = 320
_MEASURE_S = 6.0
_OPEN_TIMEOUT_S = 8.0
_FIRST_FRAME_S = 30.0


class RigCamera(OpenedByWith):
    """A depth camera whose pictures come from an auxiliary colour camera.

    The pictures in live frames are shared between frames and read only: one of 24 megapixels has 72 MB.

    Parameters
    ----------
    depth : LiveCamera
    color : ColorCamera
    """

    def __init__(self, depth: LiveCamera, color: ColorCamera) -> None:
        self._depth, self._color = depth, color
        self._profile: CalibrationProfile | None = None
        self._picture: TimedPicture | None = None
        self._picture_lock = threading.Lock()
        self._streams: tuple[StreamKind, ...] = DEFAULT_STREAMS
        self._trail: DepthTrail | None = None
        self._last: PairedMotion | None = None

    @property
    def info(self) -> DeviceInfo:
        """Which rig this is."""
        depth, color = self._depth.info, self._color.info
        return DeviceInfo(f"rig:{depth.id}|{color.id}", f"{depth.name} with {color.name}", "rig", True)

    @property
    def identity(self) -> CameraIdentity:
        """Both cameras; the sensor is the depth camera's."""
        depth, color = self._depth.identity, self._color.identity
        return CameraIdentity(
            f"{depth.model} with {color.model}",
            depth.depth_serial,
            color.serial,
            depth.sensor,
            depth.lasting and color.lasting,
        )

    @property
    def rig(self) -> CameraRig:
        """Geometry in force; without a profile the colour half is a guess, once a picture tells its size."""
        if self._profile is not None:
            return self._profile.rig
        depth, picture = self._depth.rig.depth, self._picture
        return CameraRig(depth) if picture is None else nominal_rig(CameraRig(depth), picture)

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration of this pair of cameras."""
        if profile is not None:
            now = self.rig
            if now.color is None:
                # No picture yet: the sizes are compared when the first one comes.
                now = CameraRig(now.depth, profile.rig.color, profile.rig.color_from_depth)
            check_profile(profile, self.identity, now)
        self._profile = profile

    @property
    def state(self) -> LiveState:
        """The worse of the two cameras' states."""
        states = {self._depth.state, self._color.state}
        order = (LiveState.GONE, LiveState.CLOSED, LiveState.STALLED, LiveState.STREAMING)
        return next(state for state in order if state in states)

    @property
    def last_pairing(self) -> PairedMotion | None:
        """Gap and movement between depth and picture of the last capture."""
        return self._last

    def open(self) -> None:
        """Open both cameras and wait until each that streams has delivered."""
        try:
            self._depth.open()
            self._color.open()
            self._trail = DepthTrail(self._depth.rig.depth)
            self.start(self._streams)
            if self._depth_frame(0, _FIRST_FRAME_S) is None:
                raise WorkError("The depth camera delivers no frames.", "Unplug and reconnect it.")
            if self._color.streams and self._picture is None:
                self._newest_picture(_OPEN_TIMEOUT_S)
                if self._picture is None:
                    raise WorkError(
                        "The auxiliary camera delivers no pictures.",
                        "Unplug and reconnect it, then try again.",
                    )
        except BaseException:
            self.close()
            raise

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds; the depth camera's own colour stays off."""
        own: list[StreamKind] = [kind for kind in streams if kind != "color"]
        self._depth.start(own or ["depth"])
        self._streams = tuple(streams)

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest depth frame with the newest auxiliary picture."""
        frame = self._depth_frame(after, timeout_s)
        if frame is None:
            return None
        picture = self._newest_picture(0.0) if "color" in self._streams else None
        if picture is None:
            return replace(frame, rgb=None, color_time_s=0.0)
        return replace(frame, rgb=picture.rgb, color_time_s=picture.time_s)

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames and the auxiliary picture nearest to their middle.

        Raises
        ------
        WorkError
            If the body moved too far between the two; if no picture came; if a camera stops.
        """
        if self._trail is None:
            raise WorkError("The rig is closed.", "Open it first.")
        grab = grab_streaming if self._color.streams else grab_with_shutter
        burst, picture = grab(self._depth_frame, self._color, frames, progress)
        self._see(picture)
        self._last = self._trail.check(burst.times_s, picture)
        warnings = [*picture.warnings, *self._last.judge()]
        rig = self.rig
        assert rig.color is not None
        if picture.rgb.shape[:2] != (rig.color.height, rig.color.width):
            raise WorkError(
                f"The auxiliary picture has {picture.rgb.shape[1]} x {picture.rgb.shape[0]} pixels, but the "
                f"calibration is for {rig.color.width} x {rig.color.height}.",
                "Set the camera to that resolution, or calibrate the rig again.",
            )
        if self._profile is None:
            warnings.append(NOMINAL_WARNING)
        burst = replace(burst, rgb=np.ascontiguousarray(picture.rgb), color_time_s=picture.time_s)
        return assemble_capture(
            burst,
            rig,
            sensor=self._depth.identity.sensor,
            profile=self._profile,
            warnings=tuple(dict.fromkeys(warnings)),
        )

    def measure_latency(self, seconds: float = _MEASURE_S, progress: Progress = no_progress) -> Latency:
        """Measure how late the colour stamps are while somebody waves an arm, and use it from now on.

        Raises
        ------
        WorkError
            If the cameras saw no common movement; if pictures do not come by themselves.
        """
        if not self._color.streams:
            raise WorkError(
                "The delay of a still camera cannot be measured in this way.",
                "Give it as latency_s: the time from the shutter to the file's appearance.",
            )
        depth, color = Movement(0.1), Movement(40.0)
        started, number, shown = time.monotonic(), 0, 0
        while (passed := time.monotonic() - started) < seconds:
            progress(passed / seconds, "Wave an arm slowly from side to side")
            frame = self._depth_frame(number, 0.2)
            if frame is not None and frame.depth is not None:
                number = frame.number
                depth.add(frame.time_s, reduced_depth(frame.depth, frame.depth_unit_m))
            picture = self._color.latest(shown, 0.0)
            if picture is not None:
                shown = picture.number
                color.add(picture.time_s, small_grey(picture.rgb))
        found = find_latency(depth, color)
        before = next((c.value for c in self._color.controls() if c.name == "latency_s"), 0.0)
        self._color.set_control("latency_s", before + found.delay_s)
        return found

    def preview(self) -> PreviewFrame | None:
        """Newest small frame."""
        frame = self.latest()
        if frame is None or frame.depth is None:
            return None
        step = max(1, frame.depth.shape[1] // _PREVIEW_WIDTH)
        depth = frame.depth[::step, ::step].astype(np.float32) * np.float32(frame.depth_unit_m)
        rgb = frame.rgb
        small = None if rgb is None else rgb[:: (k := max(1, rgb.shape[1] // _PREVIEW_WIDTH)), ::k].copy()
        return PreviewFrame(depth, small)

    def modes(self) -> tuple[StreamMode, ...]:
        """Modes of the depth camera's depth and infrared, and of the auxiliary camera."""
        own = tuple(mode for mode in self._depth.modes() if mode.kind != "color")
        return own + self._color.modes()

    def choose_mode(self, mode: StreamMode) -> None:
        """Run one stream in another mode; a calibration of other image sizes is dropped."""
        if mode.kind == "color":
            self._color.choose_mode(mode)
            self._picture = None
            chosen = None if self._profile is None else self._profile.rig.color
            if chosen is not None and (chosen.width, chosen.height) != (mode.width, mode.height):
                self._profile = None
        else:
            self._depth.choose_mode(mode)
            self._trail = DepthTrail(self._depth.rig.depth)
            depth = self._depth.rig.depth
            kept = None if self._profile is None else self._profile.rig.depth
            if kept is not None and (kept.width, kept.height) != (depth.width, depth.height):
                self._profile = None

    def controls(self) -> tuple[CameraControl, ...]:
        """The auxiliary camera's, and those of the depth camera that are not of its own colour camera."""
        color = self._color.controls()
        taken = _BUILT_IN | {c.name for c in color}
        return color + tuple(c for c in self._depth.controls() if c.name not in taken)

    def set_control(self, name: str, value: float) -> None:
        """Set a control of whichever camera has it."""
        if any(c.name == name for c in self._color.controls()):
            self._color.set_control(name, value)
        elif name not in _BUILT_IN:
            self._depth.set_control(name, value)
        else:
            raise InputError(f"The auxiliary camera has no setting '{name}'.", "Set it at the camera.")

    def close(self) -> None:
        """Close both cameras."""
        try:
            self._color.close()
        finally:
            self._depth.close()
        self._picture, self._trail = None, None

    def _depth_frame(self, after: int, timeout_s: float) -> LiveFrame | None:
        """Newest depth frame, remembered for the check of movement."""
        frame = self._depth.latest(after, timeout_s)
        trail = self._trail
        if frame is not None and frame.depth is not None and trail is not None:
            trail.add(frame.time_s, frame.depth, frame.depth_unit_m)
        return frame

    def _newest_picture(self, timeout_s: float) -> TimedPicture | None:
        with self._picture_lock:
            last = self._picture
        newer = self._color.latest(0 if last is None else last.number, timeout_s)
        return last if newer is None else self._see(newer)

    def _see(self, picture: TimedPicture) -> TimedPicture:
        picture.rgb.flags.writeable = False
        with self._picture_lock:
            if self._picture is None or picture.number >= self._picture.number:
                self._picture = picture
        return picture


def nominal_rig(depth: CameraRig, picture: TimedPicture) -> CameraRig:
    """Rig with a guessed auxiliary camera, until it is calibrated."""
    return CameraRig(depth.depth, picture.nominal_camera(), _GUESSED_PLACE)


class _Rigs:
    """Factory of ``rig:DEPTH|COLOR``: ids of a live depth camera and of a colour camera."""

    def devices(self) -> Sequence[DeviceInfo]:
        """Every connected depth camera with every connected colour camera; not the simulated ones."""
        from devices.auxiliary.registry import list_color_cameras
        from devices.registry import camera_kinds, list_devices

        colors = list_color_cameras()
        if not colors:
            return []
        kinds = [kind for kind in ("openni", "realsense") if kind in camera_kinds()]
        depths = [info for kind in kinds for info in list_devices(kind)]
        return [
            DeviceInfo(f"rig:{depth.id}|{color.id}", f"{depth.name} with {color.name}", "rig", True)
            for depth in depths
            for color in colors
        ]

    def create(self, address: str) -> RigCamera:
        """Rig of two cameras, not opened yet."""
        from devices.auxiliary.registry import create_color_camera
        from devices.registry import camera_factory

        depth_id, bar, color_id = address.partition("|")
        kind, colon, where = depth_id.partition(":")
        if not bar or not colon or kind == "rig":
            raise InputError(
                f"'{address}' is not a rig.", "Write rig:DEPTH|COLOR, such as rig:openni:URI|uvc:0."
            )
        depth = camera_factory(kind).create(where)
        if not isinstance(depth, LiveCamera):
            raise InputError(
                f"'{depth_id}' is no live depth camera.", "A rig needs a camera that sees the present."
            )
        return RigCamera(depth, create_color_camera(color_id))


RIGS = _Rigs()
