"""The simulated stream: which frame it is now, which stance is shown, and what goes wrong when."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING

from core.errors import Cancelled, GeodermError, WorkError
from devices.live import STALLED_AFTER_S, LiveFrame, LiveState, StreamKind
from devices.simulator.live_faults import NO_FAULTS, Faults
from devices.simulator.live_light import LightControl
from devices.simulator.live_sway import FRAME_S, StandingPerson

if TYPE_CHECKING:
    from devices.simulator.camera_device import SimulatedScene
    from devices.simulator.live_scene import LiveScene
    from devices.simulator.live_view import SceneView

Draw = Callable[["SimulatedScene", Callable[[], bool]], "LiveScene"]
"""Prepares a scene; the second argument is asked whether to give up."""


class PatientStream:
    """30 frames a second of a patient who stands, made when somebody looks.

    A frame is made in the thread that asks for it: nobody looking costs nothing. Only while the patient takes
    another stance there is a thread, which waits for the drawing process; the last stance goes on meanwhile,
    and it moves, so that nobody takes it for a patient who is ready.

    Parameters
    ----------
    draw : callable
    scene : SimulatedScene
    person : callable
        Makes the `StandingPerson` of a stature.
    seed : int
    streams : collection of {"depth", "color"}
    faults : Faults
    """

    def __init__(
        self,
        draw: Draw,
        scene: SimulatedScene,
        person: Callable[[float], StandingPerson],
        seed: int,
        streams: Collection[StreamKind],
        faults: Faults = NO_FAULTS,
    ) -> None:
        self._draw, self._make_person, self._seed = draw, person, seed
        self._streams, self._faults = frozenset(streams), faults
        self._light = LightControl()
        self._change = threading.Condition(threading.RLock())
        self._wanted: SimulatedScene = scene
        self._shown: SimulatedScene | None = None
        self._view: SceneView | None = None
        self._person: StandingPerson | None = None
        self._poser: threading.Thread | None = None
        self._problem: GeodermError | None = None
        self._closed = False
        self._first_s = 0.0
        self._frame: LiveFrame | None = None
        self._pose()

    @property
    def state(self) -> LiveState:
        """How the stream is."""
        age = -1.0 if self._view is None else time.monotonic() - self._first_s
        if self._closed:
            return LiveState.CLOSED
        if age >= self._faults.unplug_s:
            return LiveState.GONE
        if age >= self._faults.stall_s + STALLED_AFTER_S:
            return LiveState.STALLED
        return LiveState.STREAMING

    @property
    def changing(self) -> bool:
        """Whether the patient is taking another stance."""
        return self._wanted != self._shown

    def stand(self, scene: SimulatedScene) -> None:
        """Ask the patient to take another stance."""
        with self._change:
            self._wanted, self._problem = scene, None
            self._pose()

    def restart(self, streams: Collection[StreamKind]) -> None:
        """Begin anew with these streams: frames are counted from 1."""
        with self._change:
            self._streams = frozenset(streams)
            self._first_s = time.monotonic()
            self._frame = None
            if self._person is not None:
                self._person = self._make_person(self._person.stature_m)

    def light(self, light: LightControl) -> None:
        """Use another exposure from the next frame on."""
        self._light = light

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """See `devices.live.LiveCamera.latest`."""
        deadline = time.monotonic() + timeout_s
        with self._change:
            while True:
                now = time.monotonic()
                self.check()
                number = self._number(now)
                if number > after:
                    return self._handed_out(number)
                wait = deadline - now
                if wait <= 0:
                    return None
                if self._view is not None:
                    wait = min(wait, max(self._first_s + number * FRAME_S - now, 0.001))
                self._change.wait(min(wait, 0.1))

    def check(self) -> None:
        """Raise what keeps the stream from going on: closed, unplugged, a stance that cannot be drawn."""
        if self._closed:
            raise WorkError("The simulated camera is closed.", "Open it first.")
        if self.state is LiveState.GONE:
            raise WorkError(
                "The simulated camera was unplugged.", "Plug it in again, then choose the camera once more."
            )
        if self._problem is not None:
            raise self._problem

    def close(self) -> None:
        """End the stream."""
        with self._change:
            self._closed = True
            self._change.notify_all()
            poser = self._poser
        if poser is not None and poser is not threading.current_thread():
            poser.join()

    def _number(self, now: float) -> int:
        """Number of the frame of a moment; 0 before the first."""
        if self._view is None:
            return 0
        until = min(now, self._first_s + self._faults.stall_s)
        return max(0, 1 + int((until - self._first_s) / FRAME_S))

    def _handed_out(self, number: int) -> LiveFrame:
        if self._frame is None or self._frame.number != number:
            self._frame = self._make(number)
        made = self._frame
        return replace(
            made,
            depth=None if made.depth is None else made.depth.copy(),
            rgb=None if made.rgb is None else made.rgb.copy(),
        )

    def _make(self, number: int) -> LiveFrame:
        view, person = self._view, self._person
        if view is None or person is None:
            raise WorkError("The simulated patient is not ready.")
        motion = person.at(number, self.changing)
        taken_s = self._first_s + (number - 1) * FRAME_S
        return LiveFrame(
            number,
            taken_s,
            view.depth(motion) if "depth" in self._streams else None,
            view.depth_unit_m,
            view.rgb(motion, self._light.table) if "color" in self._streams else None,
            taken_s,
        )

    def _pose(self) -> None:
        with self._change:
            if self._poser is None and not self._closed and self.changing:
                self._poser = threading.Thread(
                    target=self._pose_until_right, name="simulated-patient", daemon=True
                )
                self._poser.start()

    def _pose_until_right(self) -> None:
        from devices.simulator.live_view import SceneView

        while True:
            with self._change:
                if self._closed or self._problem is not None or not self.changing:
                    self._poser = None
                    return
                scene = self._wanted
            try:
                drawn = self._draw(scene, lambda scene=scene: self._closed or self._wanted != scene)  # type: ignore[misc]
                view = SceneView(drawn, self._seed)
            except Cancelled:
                continue
            except GeodermError as error:
                with self._change:
                    if self._wanted == scene:
                        self._problem = error
                    self._change.notify_all()
                continue
            with self._change:
                if self._view is None:
                    self._first_s = time.monotonic()
                    self._person = self._make_person(drawn.stature_m)
                self._view, self._shown = view, scene
                self._change.notify_all()
