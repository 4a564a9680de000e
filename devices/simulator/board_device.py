"""A calibration board held before a rig nobody has calibrated yet: a camera for training, demos and tests."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any
from urllib.parse import parse_qsl

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.calibration.profile import CalibrationProfile
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)
from devices.simulator.boards import BoardRenderer, BoardRig, good_poses, random_board_rig

FloatArray = NDArray[np.float64]

FRAMES_PER_S = 12
_DWELL_S, _MOVE_S = 0.9, 0.8
_QUICK_S = (0.45, 0.15)
_POSES = 48
_EXPOSURE_S = 1 / 60
_TREMOR_M, _TREMOR_RAD = 0.00025, 0.0006


@dataclass(frozen=True)
class BoardScene:
    """What is held before which rig.

    Attributes
    ----------
    seed : int
        Which rig, and how the board is moved.
    paper : str
        A3 or A4.
    color_size : tuple of int
        640 x 480 is the built-in colour camera, any other size an auxiliary one.
    exclusive : bool
        Infrared and colour cannot stream together, as on a Kinect.
    moved_deg, moved_mm : float
        How far the colour camera has been knocked out of place.
    free : bool
        Every frame that is asked for comes at once, on a clock of its own; otherwise in real time.
    """

    seed: int = 0
    paper: str = "A3"
    color_size: tuple[int, int] = (640, 480)
    exclusive: bool = False
    moved_deg: float = 0.0
    moved_mm: float = 0.0
    free: bool = False


class BoardMotion:
    """How a person moves the board: from pose to pose, holding each, never quite still.

    Parameters
    ----------
    poses : sequence of RigidTransform
        Depth camera from board.
    spec : BoardSpec
    seed : int
        Of the tremor.
    """

    def __init__(self, poses: Sequence[RigidTransform], spec: BoardSpec, seed: int) -> None:
        rng = np.random.default_rng((0x7E40, seed))
        self._poses, self._centre = list(poses), spec.centre_m
        self._frequency = rng.uniform(0.3, 1.2, (2, 3, 3))
        self._phase = rng.uniform(0, 2 * np.pi, (2, 3, 3))

    def at(self, time_s: float, dwell_s: float = _DWELL_S, move_s: float = _MOVE_S) -> RigidTransform:
        """Pose at a time; it goes round when all poses have been shown."""
        period = dwell_s + move_s
        k = int(time_s // period)
        share = max(time_s - k * period - dwell_s, 0.0) / move_s
        share = share * share * (3 - 2 * share)
        a, b = self._poses[k % len(self._poses)], self._poses[(k + 1) % len(self._poses)]
        wave = np.sin(2 * np.pi * self._frequency * time_s + self._phase).sum(axis=2)
        turn = np.asarray(cv2.Rodrigues(b.rotation @ a.rotation.T)[0], float).ravel() * share
        rotation = (
            np.asarray(cv2.Rodrigues(_TREMOR_RAD * wave[0])[0])
            @ np.asarray(cv2.Rodrigues(turn)[0])
            @ a.rotation
        )
        start, end = a.apply(self._centre), b.apply(self._centre)
        centre = start + share * (end - start) + _TREMOR_M * wave[1]
        return RigidTransform(np.asarray(rotation, float), centre - rotation @ self._centre)


class SimulatedBoardCamera(OpenedByWith):
    """A live camera before which a calibration board moves slowly through good poses.

    Parameters
    ----------
    scene : BoardScene
    """

    def __init__(self, scene: BoardScene | None = None) -> None:
        self._scene = scene or BoardScene()
        self._spec = BoardSpec.for_paper(self._scene.paper)
        self._truth = _knocked(random_board_rig(self._scene.seed, self._scene.color_size), self._scene)
        self._lock = threading.Lock()
        self._renderer: BoardRenderer | None = None
        self._motion: BoardMotion | None = None
        self._streams: frozenset[StreamKind] = frozenset()
        self._begun_s = 0.0
        self._number = 0
        self._last: LiveFrame | None = None
        self._profile: CalibrationProfile | None = None

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        return DeviceInfo(
            f"simulator-board:{_address(self._scene)}", "Simulated calibration board", "simulator", True
        )

    @property
    def spec(self) -> BoardSpec:
        """The board that is shown."""
        return self._spec

    @property
    def truth(self) -> BoardRig:
        """The cameras as they really are: what a calibration should find."""
        return self._truth

    @property
    def identity(self) -> CameraIdentity:
        """Serial numbers made of the seed."""
        serial = f"SIM-BOARD-{self._scene.seed}-{self._scene.color_size[0]}"
        return CameraIdentity("Simulated calibration board", serial, serial, self._truth.sensor.name)

    @property
    def rig(self) -> CameraRig:
        """Geometry in force: the profile's, or nominal."""
        if self._profile is not None:
            return self._profile.rig
        sensor = self._truth.sensor
        width, height = self._scene.color_size
        c = sensor.color_camera
        share = width / c.width
        color = PinholeCamera(width, height, c.fx * share, c.fy * share, (width - 1) / 2, (height - 1) / 2)
        return CameraRig(sensor.depth_camera, color, sensor.color_from_depth)

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration; raise `InputError` if it is not of this rig."""
        if profile is not None:
            if not profile.fits(self.identity.depth_serial, self.identity.color_serial):
                raise InputError("The calibration profile belongs to other cameras.")
            color, true = profile.rig.color, self._truth.rig.picture_camera
            depth = self._truth.rig.depth
            if (profile.rig.depth.width, profile.rig.depth.height) != (depth.width, depth.height) or (
                color is not None and (color.width, color.height) != (true.width, true.height)
            ):
                raise InputError("The calibration profile is for another image size.")
        self._profile = profile

    @property
    def state(self) -> LiveState:
        """How the camera is."""
        return LiveState.STREAMING if self._streams else LiveState.CLOSED

    def open(self) -> None:
        """Take up the board."""
        if self._renderer is None:
            poses = good_poses(self._truth, self._spec, _POSES, self._scene.seed)
            self._motion = BoardMotion(poses, self._spec, self._scene.seed)
            self._renderer = BoardRenderer(self._truth, self._spec, self._scene.seed)
        if not self._streams:
            self.start()

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds; an exclusive camera refuses infrared and colour together."""
        wanted = frozenset(streams)
        if self._scene.exclusive and {"color", "infrared"} <= wanted:
            raise WorkError(
                "This camera cannot stream infrared and colour at the same time.",
                "Start one after the other.",
            )
        if self._renderer is None:
            raise WorkError("The simulated camera is closed.", "Open it first.")
        with self._lock:
            if not self._streams:
                self._begun_s, self._number, self._last = time.monotonic(), 0, None
            self._streams = wanted
            self._last = None

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame, made when it is asked for."""
        until = time.monotonic() + timeout_s
        while True:
            with self._lock:
                if self._renderer is None or not self._streams:
                    raise WorkError("The simulated camera is closed.", "Open it first.")
                if self._scene.free:
                    self._number = max(self._number, after) + 1
                    return self._frame(self._number)
                number = int((time.monotonic() - self._begun_s) * FRAMES_PER_S) + 1
                if number > after:
                    if self._last is None or self._last.number != number:
                        self._last = self._frame(number)
                    return _copied(self._last)
                next_s = self._begun_s + number / FRAMES_PER_S
            if next_s > until:
                time.sleep(max(until - time.monotonic(), 0.0))
                return None
            time.sleep(max(next_s - time.monotonic(), 0.0))

    def _frame(self, number: int) -> LiveFrame:
        assert self._renderer is not None
        assert self._motion is not None
        t = (number - 1) / FRAMES_PER_S
        # Where streams change in between, a view takes longer; without a real clock nobody has to look.
        dwell, move = _QUICK_S if self._scene.free else (_DWELL_S, _MOVE_S)
        dwell *= 2.5 if self._scene.exclusive else 1.0
        pose = self._motion.at(t, dwell, move)
        motion = self._motion.at(t + _EXPOSURE_S, dwell, move) @ pose.inverse()
        seen = self._renderer.render(pose, self._streams, motion)
        moment = self._begun_s + t
        return LiveFrame(number, moment, seen.depth, 0.001, seen.rgb, moment, seen.infrared)

    def modes(self) -> tuple[StreamMode, ...]:
        """The one mode of each stream."""
        depth, (width, height) = self._truth.rig.depth, self._scene.color_size
        return (
            StreamMode("depth", depth.width, depth.height, FRAMES_PER_S, "1mm"),
            StreamMode("infrared", depth.width, depth.height, FRAMES_PER_S, "gray8"),
            StreamMode("color", width, height, FRAMES_PER_S, "rgb888"),
        )

    def choose_mode(self, mode: StreamMode) -> None:
        """Only what `modes` tells."""
        if mode not in self.modes():
            raise InputError("The simulated camera has no such mode.")

    def controls(self) -> tuple[CameraControl, ...]:
        """None."""
        return ()

    def set_control(self, name: str, value: float) -> None:
        """Raise: there is nothing to set."""
        raise InputError(f"The simulated camera has no control '{name}'.")

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """A burst of the board."""
        if "depth" not in self._streams:
            raise WorkError("The camera streams no depth.", "Start the depth stream, then capture.")
        burst = collect_burst(self.latest, frames, progress)
        warnings = (
            () if self._profile is not None else ("The geometry is nominal: the camera is not calibrated.",)
        )
        return assemble_capture(
            burst, self.rig, sensor=self._truth.sensor.name, profile=self._profile, warnings=warnings,
            taken_at=datetime.now(UTC),
        )  # fmt: skip

    def preview(self) -> PreviewFrame | None:
        """A quarter of the newest frame."""
        if not self._streams:
            return None
        frame = self.latest()
        if frame is None:
            return None
        depth = None if frame.depth is None else frame.depth[::2, ::2].astype(np.float32) * frame.depth_unit_m
        return PreviewFrame(depth, None if frame.rgb is None else frame.rgb[::2, ::2].copy())

    def close(self) -> None:
        """Put the board away."""
        with self._lock:
            self._streams = frozenset()
            self._renderer = self._motion = self._last = None


def _copied(frame: LiveFrame) -> LiveFrame:
    """The arrays belong to whoever asked."""
    return replace(
        frame,
        depth=None if frame.depth is None else frame.depth.copy(),
        rgb=None if frame.rgb is None else frame.rgb.copy(),
        infrared=None if frame.infrared is None else frame.infrared.copy(),
    )


def _knocked(board_rig: BoardRig, scene: BoardScene) -> BoardRig:
    """The rig with its colour camera knocked out of place."""
    if not (scene.moved_deg or scene.moved_mm):
        return board_rig
    rng = np.random.default_rng((0x4B0C, scene.seed))
    axis, way = rng.normal(size=3), rng.normal(size=3)
    turn = np.asarray(cv2.Rodrigues(np.deg2rad(scene.moved_deg) * axis / np.linalg.norm(axis))[0], float)
    knock = RigidTransform(turn, 0.001 * scene.moved_mm * way / np.linalg.norm(way))
    rig = board_rig.rig
    return replace(board_rig, rig=CameraRig(rig.depth, rig.color, knock @ rig.picture_from_depth))


def _with(scene: BoardScene, option: str, value: Any) -> BoardScene:
    return replace(scene, **{option: value})


def _address(scene: BoardScene) -> str:
    usual = BoardScene()
    parts = [
        f"{name}={int(value) if isinstance(value, bool) else value}"
        for name in ("seed", "paper", "exclusive", "moved_deg", "moved_mm", "free")
        if (value := getattr(scene, name)) != getattr(usual, name)
    ]
    if scene.color_size != usual.color_size:
        parts.append(f"color={scene.color_size[0]}x{scene.color_size[1]}")
    return "kinect" + (f"?{'&'.join(parts)}" if parts else "")


class _BoardCameras:
    """Factory for ``simulator-board:kinect``; options as in ``simulator-board:kinect?seed=3&exclusive=1``.

    Options: seed, paper, color (640x480), exclusive, moved_deg, moved_mm, free.
    """

    def devices(self) -> Sequence[DeviceInfo]:
        """The board before the usual rig."""
        return [SimulatedBoardCamera().info]

    def create(self, address: str) -> SimulatedBoardCamera:
        """Return the camera, not opened yet."""
        name, _, options = address.partition("?")
        if name not in ("", "kinect"):
            raise InputError(f"There is no simulated board '{name}'.", "Write simulator-board:kinect.")
        scene = BoardScene()
        for option, text in parse_qsl(options, keep_blank_values=True):
            try:
                if option == "color":
                    width, _, height = text.partition("x")
                    size = (int(width), int(height))
                    if not (320 <= size[0] <= 6000 and 240 <= size[1] <= 4500):
                        raise InputError("The colour picture of a simulated board is 320x240 to 6000x4500.")
                    scene = replace(scene, color_size=size)
                elif option == "paper":
                    BoardSpec.for_paper(text)
                    scene = replace(scene, paper=text.upper())
                elif option in ("exclusive", "free"):
                    scene = _with(scene, option, bool(int(text)))
                elif option == "seed":
                    scene = replace(scene, seed=abs(int(text)))
                elif option in ("moved_deg", "moved_mm"):
                    value = float(text)
                    if not abs(value) <= 50:
                        raise InputError(f"'{option}' of a simulated board is at most 50.")
                    scene = _with(scene, option, value)
                else:
                    raise InputError(
                        f"A simulated board has no option '{option}'.",
                        "It has seed, paper, color, exclusive, moved_deg, moved_mm and free.",
                    )
            except ValueError as error:
                raise InputError(f"'{text}' is not a number for '{option}' of a simulated board.") from error
        return SimulatedBoardCamera(scene)


BOARD_CAMERAS = _BoardCameras()
