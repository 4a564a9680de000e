"""A simulated hand with a marker as a live camera: for training, demonstrations and tests."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Collection, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.hand.labels import FrameLabels
from core.progress import Progress, no_progress
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.child_process import ChildProcess
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
from devices.simulator.shapes import SHAPES, describe_shape

if TYPE_CHECKING:
    from devices.simulator.hands.live_loop import LoopPlan, LoopShow
    from devices.simulator.room import SimulatedRig

FRAMES_PER_S = 30
_REMEMBERED = 200
_POLL_S = 0.05
_MAX_SECONDS = 20.0


class SimulatedHandCamera(OpenedByWith):
    """A live camera before which a simulated hand moves.

    A process of its own draws a loop of a few seconds; what is there of it is shown to and fro, with noise
    that is new in every frame, so that the first frame comes after a second or two and the camera then runs
    at its full rate. Half a megabyte is kept for each frame of the loop.

    Parameters
    ----------
    plan : LoopPlan, optional
        Whose hand it is and what it does: `devices.simulator.hands.live_loop`.
    """

    def __init__(self, plan: LoopPlan | None = None) -> None:
        if plan is None:
            from devices.simulator.hands.live_loop import LoopPlan
            from devices.simulator.hands.shots import Holder

            plan = LoopPlan(Holder())
        self._plan = plan
        self._simulated_rig: SimulatedRig | None = None
        self._profile: CalibrationProfile | None = None
        self._change = threading.Condition()
        self._streams: frozenset[StreamKind] = frozenset()
        self._show: LoopShow | None = None
        self._drawer: ChildProcess | None = None
        self._reader: threading.Thread | None = None
        self._problem: WorkError | None = None
        self._opened = False
        self._first_s = 0.0
        self._last: LiveFrame | None = None
        self._truth: OrderedDict[int, FrameLabels] = OrderedDict()

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        shape = self._plan.holder.shape
        return DeviceInfo(
            f"simulator-hand:{_address(self._plan)}",
            f"Simulated hand ({describe_shape(shape)})",
            "simulator",
            True,
        )

    @property
    def identity(self) -> CameraIdentity:
        """Serial numbers made of the seed; the colour camera is built in."""
        serial = f"SIM-HAND-{self._plan.holder.seed}"
        return CameraIdentity("Simulated depth camera", serial, serial, self._rig.sensor.name)

    @property
    def _rig(self) -> SimulatedRig:
        if self._simulated_rig is None:
            self._simulated_rig = self._plan.rig()
        return self._simulated_rig

    @property
    def rig(self) -> CameraRig:
        """Geometry in force: the profile's, or the true one."""
        return self._rig.rig if self._profile is None else self._profile.rig

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration in use; None for the true geometry."""
        return self._profile

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Use a calibration; raise `InputError` if it is not of this camera."""
        if profile is not None:
            from devices.simulator.live_calibration import check_profile

            check_profile(profile, self.identity, self._rig.rig)
        self._profile = profile

    @property
    def state(self) -> LiveState:
        """How the camera is."""
        if not self._opened:
            return LiveState.CLOSED
        return LiveState.GONE if self._problem is not None else LiveState.STREAMING

    @property
    def drawn(self) -> int:
        """Frames of the loop that are there by now."""
        return 0 if self._show is None else len(self._show)

    def truth(self, number: int) -> FrameLabels | None:
        """What is true about a frame handed out lately; None if it is too long ago."""
        return self._truth.get(number)

    def open(self) -> None:
        """Let the hand come. Nothing is drawn before somebody looks."""
        if self._opened:
            return
        self._problem, self._show, self._last = None, None, None
        self._opened = True
        self.start()

    def _draw(self) -> None:
        """Start the drawing process; the first frame is there after a second or two."""
        from devices.simulator.hands.live_loop import serve

        self._drawer = ChildProcess(serve, "geoderm-hand", self._plan)
        self._reader = threading.Thread(
            target=self._read, args=(self._drawer,), name="simulated-hand", daemon=True
        )
        self._reader.start()

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Stream these kinds from now on, counted from frame 1."""
        if "infrared" in streams:
            raise WorkError("The simulated hand is not filmed in infrared.", "Choose depth and colour.")
        if not streams:
            raise WorkError("A camera needs at least one stream.")
        self._check()
        with self._change:
            self._streams = frozenset(streams)
            self._first_s, self._last = time.monotonic(), None
            self._truth.clear()

    def _read(self, drawer: ChildProcess) -> None:
        """Take in what the drawing process sends, until the loop is complete or nobody wants it."""
        from devices.simulator.hands.live_loop import LoopShow

        try:
            room = drawer.pipe.recv()
            show = LoopShow(room, self._plan.seed)
            while (frame := drawer.pipe.recv()) is not None:
                with self._change:
                    show.add(frame)
                    if self._show is None:
                        self._show, self._first_s = show, time.monotonic()
                    self._change.notify_all()
        except (EOFError, OSError):
            with self._change:
                if self._opened and self._drawer is drawer and self._show is None:
                    self._problem = WorkError(
                        "The simulated hand's drawing process ended unexpectedly.",
                        "Open the simulated camera again.",
                    )
                self._change.notify_all()

    def _check(self) -> None:
        if not self._opened:
            raise WorkError("The simulated camera is closed.", "Open it first.")
        if self._problem is not None:
            raise self._problem

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame, put together when it is asked for; see `devices.live.LiveCamera`."""
        until = time.monotonic() + timeout_s
        with self._change:
            while True:
                self._check()
                if self._drawer is None:
                    self._draw()
                now = time.monotonic()
                wait = until - now
                if self._show is not None:
                    number = 1 + int((now - self._first_s) * FRAMES_PER_S)
                    if number > after:
                        return self._frame(self._show, number)
                    wait = min(wait, self._first_s + number / FRAMES_PER_S - now)
                if until <= now:
                    return None
                self._change.wait(min(max(wait, 0.0), _POLL_S))

    def _frame(self, show: LoopShow, number: int) -> LiveFrame:
        last = self._last
        if last is None or last.number != number:
            if last is not None:
                show.advance(number - last.number)
            taken_s = self._first_s + (number - 1) / FRAMES_PER_S
            depth = show.depth() if "depth" in self._streams else None
            rgb = show.rgb() if "color" in self._streams else None
            last = self._last = LiveFrame(number, taken_s, depth, 0.001, rgb, taken_s)
            self._truth[number] = show.labels
            while len(self._truth) > _REMEMBERED:
                self._truth.popitem(last=False)
        return replace(
            last,
            depth=None if last.depth is None else last.depth.copy(),
            rgb=None if last.rgb is None else last.rgb.copy(),
        )

    def modes(self) -> tuple[StreamMode, ...]:
        """The one mode of each stream."""
        depth, color = self._rig.rig.depth, self._rig.color
        return (
            StreamMode("depth", depth.width, depth.height, FRAMES_PER_S, "depth_1_mm"),
            StreamMode("color", color.width, color.height, FRAMES_PER_S, "rgb888"),
        )

    def choose_mode(self, mode: StreamMode) -> None:
        """Only what `modes` tells."""
        if mode not in self.modes():
            raise InputError("The simulated camera has no such mode.", "Choose one of those it offers.")

    def controls(self) -> tuple[CameraControl, ...]:
        """None."""
        return ()

    def set_control(self, name: str, value: float) -> None:
        """Raise: there is nothing to set."""
        raise InputError(f"The simulated camera has no control '{name}'.")

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """The next frames as a burst; the hand moves meanwhile."""
        self._check()
        if "depth" not in self._streams:
            raise WorkError("The camera streams no depth.", "Start the depth stream, then capture.")
        burst = collect_burst(self.latest, frames, progress, timeout_s=10 * STALLED_AFTER_S)
        return assemble_capture(
            burst,
            self.rig,
            sensor=self._rig.sensor.name,
            profile=self._profile,
            taken_at=datetime.now(UTC),
        )

    def preview(self) -> PreviewFrame | None:
        """The newest frame made small; None while there is none."""
        from devices.simulator.live_geometry import made_small

        frame = self.latest() if self._opened else None
        return None if frame is None else made_small(frame)

    def close(self) -> None:
        """Send the hand away and end its process."""
        with self._change:
            self._opened, self._streams = False, frozenset()
            drawer, self._drawer = self._drawer, None
            reader, self._reader = self._reader, None
            self._change.notify_all()
        if drawer is not None:
            drawer.kill()  # it owns nothing; the reader then finds the end of the pipe
            if reader is not None and reader is not threading.current_thread():
                reader.join()
            drawer.end()
        self._show = self._last = None


def _address(plan: LoopPlan) -> str:
    from devices.simulator.hands.live_loop import LoopPlan
    from devices.simulator.hands.shots import Holder

    usual = LoopPlan(Holder())
    holder, parts = plan.holder, []
    if holder.side != usual.holder.side:
        parts.append(f"side={holder.side}")
    if holder.seed or plan.seed:
        parts.append(f"seed={holder.seed}")
    if plan.kind != usual.kind:
        parts.append(f"kind={plan.kind}")
    if plan.configurations:
        parts.append(f"configurations={','.join(plan.configurations)}")
    if plan.seconds != usual.seconds:
        parts.append(f"seconds={plan.seconds:g}")
    if holder.marker_m != usual.holder.marker_m:
        parts.append(f"marker_m={holder.marker_m:g}")
    if holder.dictionary != usual.holder.dictionary:
        parts.append(f"dictionary={holder.dictionary}")
    return holder.shape + (f"?{'&'.join(parts)}" if parts else "")


class SimulatedHands:
    """Factory for ``simulator-hand:SHAPE``, options as in ``simulator-hand:child10?side=L&kind=bottle``.

    Options: side (R, L), seed, kind (one of `devices.simulator.hands.sequence.SEQUENCES`), configurations
    (with commas), seconds (of the loop, 1 to 20), marker_m (0 for none), dictionary.
    """

    def devices(self) -> Sequence[DeviceInfo]:
        """The usual hand."""
        return [SimulatedHandCamera().info]

    def create(self, address: str) -> SimulatedHandCamera:
        """Return the camera, not opened yet."""
        from devices.simulator.hands.live_loop import LoopPlan
        from devices.simulator.hands.sequence import checked_configurations, checked_kind
        from devices.simulator.hands.shots import Holder, checked_holder

        shape, _, options = address.partition("?")
        holder = Holder(shape or SHAPES[0])
        plan: dict[str, Any] = {}
        for option, text in parse_qsl(options, keep_blank_values=True):
            try:
                if option == "side":
                    holder = replace(holder, side=text)
                elif option == "dictionary":
                    holder = replace(holder, dictionary=text)
                elif option == "marker_m":
                    holder = replace(holder, marker_m=float(text))
                elif option == "seed":
                    holder = replace(holder, seed=int(text))
                elif option == "kind":
                    plan["kind"] = checked_kind(text)
                elif option == "configurations":
                    plan["configurations"] = checked_configurations([t for t in text.split(",") if t])
                elif option == "seconds":
                    plan["seconds"] = float(text)
                    if not 1.0 <= plan["seconds"] <= _MAX_SECONDS:
                        raise InputError(f"'seconds' of a simulated hand is 1 to {_MAX_SECONDS:g}.")
                else:
                    raise InputError(
                        f"A simulated hand has no option '{option}'.",
                        "It has side, seed, kind, configurations, seconds, marker_m and dictionary.",
                    )
            except ValueError as error:
                raise InputError(f"'{text}' is not a number for '{option}' of a simulated hand.") from error
        return SimulatedHandCamera(LoopPlan(checked_holder(holder), seed=holder.seed, **plan))


SIMULATED_HANDS = SimulatedHands()
