"""A body of ellipsoids before a wall, moving as a test says; a depth and a colour camera that see it."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.calibration.profile import CalibrationProfile
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.auxiliary.camera import ColorCameraInfo, ColorIdentity, TimedPicture
from devices.auxiliary.profiles import check_profile
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)

CAMERA = PinholeCamera(320, 240, 287.9, 287.9, 159.5, 119.5)
UNIT_M = 0.001

# Centre and half axes in metres: trunk, head, arms, legs.
_PARTS = (
    ((0.0, -0.1, 2.3), (0.19, 0.38, 0.12)),
    ((0.0, -0.62, 2.3), (0.08, 0.12, 0.1)),
    ((-0.3, -0.2, 2.28), (0.12, 0.05, 0.05)),
    ((0.3, -0.2, 2.28), (0.12, 0.05, 0.05)),
    ((-0.1, 0.6, 2.3), (0.08, 0.4, 0.08)),
    ((0.1, 0.6, 2.3), (0.08, 0.4, 0.08)),
)

Path3 = Callable[[float], tuple[float, float, float]]


def depth_of_body(
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    turn: float = 0.0,
    arm: float = 0.0,
    noise: np.random.Generator | None = None,
    camera: PinholeCamera = CAMERA,
) -> NDArray[np.uint16]:
    """Raw depth, with a Kinect's noise and steps if ``noise`` is given; ``arm`` brings one arm forward."""
    z = _geometry(tuple(shift), turn, arm, camera)
    if noise is not None:
        z = z + noise.normal(0.0, 0.0012 * z**2)
        step = 0.0028 * z**2
        z = np.rint(z / step) * step
    return np.rint(z / UNIT_M).astype(np.uint16)


@lru_cache(maxsize=32)
def _geometry(
    shift: tuple[float, float, float], turn: float, arm: float, camera: PinholeCamera
) -> NDArray[np.float64]:
    rays = camera.pixel_rays.reshape(-1, 3)
    z = np.full(len(rays), 3.2)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    about = np.array([0, 0, 2.3])
    for k, (center, axes) in enumerate(_PARTS):
        at = rotation @ (np.array(center) - about - [0, 0, arm * (k == 2)]) + about + shift
        shape = np.diag(1 / np.array(axes)) @ rotation.T
        d, o = rays @ shape.T, -(shape @ at)
        a, b, e = (d * d).sum(1), 2 * d @ o, o @ o - 1
        q = b * b - 4 * a * e
        z = np.minimum(z, np.where(q > 0, (-b - np.sqrt(np.maximum(q, 0))) / (2 * a), np.inf))
    return z.reshape(camera.height, camera.width)


def hold_still(time_s: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


class BodyDepthCamera:
    """A live depth camera at 30 frames/s; ``path`` moves the body sideways, by whole pixels."""

    def __init__(self, path: Path3 = hold_still, serial: str = "D1") -> None:
        self.path, self._serial = path, serial
        self._started: float | None = None
        self._profile: CalibrationProfile | None = None
        self.started_with: tuple[StreamKind, ...] = ()
        self.gone = False

    info = DeviceInfo("body:1", "Body", "openni", True)

    @property
    def identity(self) -> CameraIdentity:
        return CameraIdentity("Body", self._serial, self._serial, "kinect-v1")

    @property
    def rig(self) -> CameraRig:
        return CameraRig(CAMERA)

    @property
    def profile(self) -> CalibrationProfile | None:
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        if profile is not None:
            check_profile(profile, self.identity, self.rig)
        self._profile = profile

    @property
    def state(self) -> LiveState:
        if self.gone:
            return LiveState.GONE
        return LiveState.CLOSED if self._started is None else LiveState.STREAMING

    def open(self) -> None:
        depth_of_body()
        self._started = self._started or time.monotonic()

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        self.started_with = tuple(streams)

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        if self.gone:
            raise WorkError("The camera is gone.")
        assert self._started is not None
        due = self._started + (after + 1) / 30.0
        if due - time.monotonic() > timeout_s:
            return None
        time.sleep(max(0.0, due - time.monotonic()))
        number = int((time.monotonic() - self._started) * 30.0)
        if number <= after:
            return None
        time_s = self._started + number / 30.0
        pixels = round(CAMERA.fx * self.path(time_s)[0] / 2.3)
        return LiveFrame(number, time_s, np.roll(depth_of_body(), pixels, axis=1), UNIT_M)

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        return assemble_capture(collect_burst(self.latest, frames, progress), self.rig, sensor="kinect-v1")

    def preview(self) -> PreviewFrame | None:
        return None

    def modes(self) -> tuple[StreamMode, ...]:
        return (StreamMode("depth", 320, 240, 30, "depth"), StreamMode("color", 640, 480, 30, "rgb8"))

    def choose_mode(self, mode: StreamMode) -> None:
        raise InputError("There is one mode.")

    def controls(self) -> tuple[CameraControl, ...]:
        return (CameraControl("emitter", 1.0), CameraControl("auto_exposure", 1.0))

    def set_control(self, name: str, value: float) -> None:
        if name != "emitter":
            raise InputError(f"no {name}")

    def close(self) -> None:
        self._started = None

    def __enter__(self) -> BodyDepthCamera:
        self.open()
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class BodyColorCamera:
    """A colour camera that sees the same body as a bright bar, with its own rate and late time stamps.

    Parameters
    ----------
    late_s : float
        By how much the stamps are later than the exposures: what a measurement has to find.
    """

    def __init__(
        self, path: Path3 = hold_still, *, fps: float = 30.0, late_s: float = 0.0, sigma_s: float = 0.01
    ) -> None:
        self.path, self._fps, self._late_s, self._sigma_s = path, fps, late_s, sigma_s
        self.latency_s = 0.0
        self.size = (160, 120)
        self.info = ColorCameraInfo("uvc:9", "Bar", "uvc")
        self.identity = ColorIdentity("Bar", "C1", True)
        self.streams = True
        self._started: float | None = None
        self._pictures: list[TimedPicture] = []

    @property
    def state(self) -> LiveState:
        return LiveState.CLOSED if self._started is None else LiveState.STREAMING

    def open(self) -> None:
        self._started = self._started or time.monotonic()

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> TimedPicture | None:
        assert self._started is not None
        due = self._started + (after + 1) / self._fps
        if due - time.monotonic() > timeout_s:
            return None
        time.sleep(max(0.0, due - time.monotonic()))
        number = int((time.monotonic() - self._started) * self._fps)
        if number <= after:
            return None
        exposed_s = self._started + number / self._fps
        width, height = self.size
        rgb = np.zeros((height, width, 3), np.uint8)
        x = width / 2 + 287.9 / 2 * self.path(exposed_s)[0] / 2.3 * (width / 160)
        edge = np.clip(np.arange(width) - x + 20, 0, 1) * np.clip(x + 20 - np.arange(width), 0, 1)
        rgb[:] = (250 * edge).astype(np.uint8)[None, :, None]
        stamp_s = exposed_s + self._late_s - self.latency_s
        return TimedPicture(number, stamp_s, rgb, self._sigma_s)

    def still(self, timeout_s: float = 10.0) -> TimedPicture:
        picture = self.latest(0, timeout_s)
        assert picture is not None
        return picture

    @property
    def mode(self) -> StreamMode | None:
        return StreamMode("color", *self.size, 30, "rgb8")

    def modes(self) -> tuple[StreamMode, ...]:
        return (StreamMode("color", 160, 120, 30, "rgb8"), StreamMode("color", 320, 240, 30, "rgb8"))

    def choose_mode(self, mode: StreamMode) -> None:
        self.size = (mode.width, mode.height)

    def controls(self) -> tuple[CameraControl, ...]:
        return (
            CameraControl("exposure_lock", 0.0),
            CameraControl("latency_s", self.latency_s, -1.0, 5.0),
        )

    def set_control(self, name: str, value: float) -> None:
        assert name == "latency_s"
        self.latency_s = value

    def close(self) -> None:
        self._started = None
