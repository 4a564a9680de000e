"""A loop of a moving hand for the viewfinder: drawn once by a process of its own, shown to and fro.

Drawing takes about a tenth of a second a frame, showing a few milliseconds. Each frame is kept as the part
of the pictures that differs from an empty room, with two takes of the sensor's noise, between which chance
decides whenever the frame is shown; the room around has a pool of takes of its own, and the picture's noise
is new in every frame.
"""

from __future__ import annotations

import contextlib
import os
import signal
from dataclasses import dataclass
from multiprocessing.connection import Connection

import cv2
import numpy as np
from numpy.typing import NDArray

from core.hand.labels import FrameLabels
from devices.simulator.hands.rendering import COLOR_NOISE, Box, HandScene, empty_picture, wall_cosine
from devices.simulator.hands.scene import HandView, true_points
from devices.simulator.hands.sequence import RATE_HZ, hand_motion, view_at
from devices.simulator.hands.shots import Holder
from devices.simulator.room import SimulatedRig, make_rig
from devices.simulator.sensor import FrameMaker, SensorView

TAKES, ROOM_TAKES = 2, 6
_NOISE_PICTURES = 6
_CHILD_NICE = 5


@dataclass(frozen=True)
class LoopPlan:
    """What is drawn.

    Attributes
    ----------
    holder : Holder
    kind : str
        Of sequence.
    configurations : tuple of str
    seconds : float
        From the first frame of the loop to the last.
    seed : int
    wall_m : float
    """

    holder: Holder
    kind: str = "configurations"
    configurations: tuple[str, ...] = ()
    seconds: float = 6.0
    seed: int = 0
    wall_m: float = 1.4

    @property
    def frames(self) -> int:
        """Frames of the loop."""
        return max(2, round(self.seconds * RATE_HZ))

    def rig(self) -> SimulatedRig:
        """The cameras: a Kinect v1 with its own colour camera."""
        return make_rig((640, 480), device_seed=self.holder.seed)


@dataclass(frozen=True, eq=False)
class EmptyRoom:
    """What is seen without a hand: raw depth (k, h, w), picture (h, w, 3)."""

    depth: NDArray[np.uint16]
    rgb: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class LoopFrame:
    """What one frame shows where it differs from the empty room.

    Attributes
    ----------
    depth_box, rgb_box : Box
    depth : ndarray (k, h, w) uint16
        Takes of the same moment.
    rgb : ndarray (h, w, 3) uint8
        Without noise.
    labels : FrameLabels
        The truth.
    """

    depth_box: Box
    depth: NDArray[np.uint16]
    rgb_box: Box
    rgb: NDArray[np.uint8]
    labels: FrameLabels


def empty_room(plan: LoopPlan) -> EmptyRoom:
    """The room without anybody."""
    rig = plan.rig()
    rng = np.random.default_rng((0xE3, plan.seed))
    sight = _wall(plan, rig)
    maker = FrameMaker(rig.sensor, sight, rig.device_seed, rng)
    depth = np.stack([maker.frame(sight.depth_m) for _ in range(ROOM_TAKES)])
    return EmptyRoom(depth, _bytes(empty_picture(rig.color)))


def _wall(plan: LoopPlan, rig: SimulatedRig) -> SensorView:
    camera = rig.sensor.depth_camera
    depth = np.full((camera.height, camera.width), plan.wall_m if plan.wall_m > 0 else np.inf, np.float32)
    return SensorView(depth, wall_cosine(camera), np.zeros(depth.shape, np.bool_))


def loop_frame(
    view: HandView, rig: SimulatedRig, configuration: str | None, rng: np.random.Generator
) -> LoopFrame:
    """Draw one frame of the loop."""
    scene = HandScene(view)
    true_depth, sight = scene.depth(rig)
    maker = FrameMaker(rig.sensor, sight, rig.device_seed, rng)
    box = scene.depth_box(rig)
    takes = np.stack([maker.frame(true_depth)[box.slices] for _ in range(TAKES)])
    rgb_box, patch = scene.picture_patch(rig.color, rig.color_from_depth)
    truth = FrameLabels(configuration, *true_points(view, scene, rig))
    return LoopFrame(box, takes, rgb_box, _bytes(patch), truth)


def _bytes(picture: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.asarray(np.clip(255.0 * picture, 0, 255).astype(np.uint8))


def serve(pipe: Connection, plan: LoopPlan) -> None:
    """Draw the loop frame by frame and send it; runs in the drawing process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):
        os.nice(_CHILD_NICE)  # the window goes first
    rig = plan.rig()
    try:
        pipe.send(empty_room(plan))
        motion = hand_motion(
            plan.kind, plan.holder, plan.seconds, seed=plan.seed, configurations=plan.configurations
        )
        for number in range(plan.frames):
            view, moment = view_at(motion, number / RATE_HZ, plan.holder, rig, wall_m=plan.wall_m)
            rng = np.random.default_rng((0xE4, plan.seed, number))
            pipe.send(loop_frame(view, rig, moment.configuration, rng))
        pipe.send(None)
    except (EOFError, OSError):
        pass  # nobody wants it any more


class LoopShow:
    """Shows a loop that may still be growing: to its end and back, without a jump.

    Parameters
    ----------
    room : EmptyRoom
    seed : int
        Of the order of the noise.
    """

    def __init__(self, room: EmptyRoom, seed: int = 0) -> None:
        self._room, self._rng = room, np.random.default_rng((0xE5, seed))
        noise = self._rng.standard_normal((_NOISE_PICTURES, *room.rgb.shape), np.float32)
        self._noise = np.clip(np.rint(255.0 * COLOR_NOISE * noise), -12, 12).astype(np.int8)
        self._frames: list[LoopFrame] = []
        self._at, self._step = 0, 1

    def __len__(self) -> int:
        return len(self._frames)

    def add(self, frame: LoopFrame) -> None:
        """The loop has grown."""
        self._frames.append(frame)

    @property
    def labels(self) -> FrameLabels:
        """The truth about the frame that is shown."""
        return self._frames[self._at].labels

    def advance(self, frames: int) -> None:
        """Go on by so many frames, turning at the ends."""
        last = len(self._frames) - 1
        if last <= 0:
            return
        for _ in range(frames % (2 * last) if frames > 2 * last else frames):
            if not 0 <= self._at + self._step <= last:
                self._step = -self._step
            self._at += self._step

    def depth(self) -> NDArray[np.uint16]:
        """Raw depth (h, w) of the present frame."""
        frame = self._frames[self._at]
        out: NDArray[np.uint16] = self._room.depth[self._rng.integers(len(self._room.depth))].copy()
        out[frame.depth_box.slices] = frame.depth[self._rng.integers(len(frame.depth))]
        return out

    def rgb(self) -> NDArray[np.uint8]:
        """Picture (h, w, 3) of the present frame."""
        frame = self._frames[self._at]
        out = self._room.rgb.copy()
        out[frame.rgb_box.slices] = frame.rgb
        noise = self._noise[self._rng.integers(len(self._noise))]
        return np.asarray(cv2.add(out, noise, dtype=cv2.CV_8U), np.uint8)
