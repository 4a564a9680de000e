"""The thread that reads frames, looks at hands and keeps the window free.

Recorded: every frame in its order, at the recorded pace or as fast as tracking goes. Live: the newest frame,
whatever was missed meanwhile is dropped.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from PySide6.QtCore import QObject, Signal, SignalInstance

from app.live.newest import Newest
from app.tasks import TaskFailure, describe_failure
from app.widgets.hand_mesh import hand_mesh
from app.windows.hand.ticks import Opened, Tick, picture_of, told
from app.workflows.hand_log import MOST_LIVE_FRAMES, TrackLog
from app.workflows.hand_rows import HandRow, HandShot, open_row
from app.workflows.hand_settings import HandSettings, empty_model, finder_of
from app.workflows.hand_skin import FrameSkin, look_at
from core.errors import GeodermError
from devices.live import LiveState

if TYPE_CHECKING:
    from core.hand.anchors import AnchorFinder
    from core.hand.answer import HandAnswer
    from core.hand.hand_model import HandModel
    from core.hand.landmarks import HandDetector
    from core.hand.tracker import HandTracker
    from devices.live import LiveCamera

_WAIT_S: Final = 0.1
_LONGEST_GAP_S: Final = 1.0
_MESH_EVERY_S: Final = 0.12
_RATE_OVER_S: Final = 2.0
_STALLED: Final = TaskFailure(
    "The camera has stopped delivering pictures.", "Check its cable, then choose it again.", is_bug=False
)

OpenCamera = Callable[[], "LiveCamera"]


class HandEngine(QObject):
    """Looks at one source. Signals arrive in the window's thread.

    Signals
    -------
    ticked()
        `take` has a newer `Tick`.
    opened(object)
        An `Opened`.
    failed(object)
        A `TaskFailure`: the source cannot be used, or looking failed. Playing has stopped.
    playing_changed(bool)
    """

    ticked = Signal()
    opened = Signal(object)
    failed = Signal(object)
    playing_changed = Signal(bool)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.log = TrackLog()
        self._orders: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._ticks: Newest[Tick] = Newest()
        self._thread: threading.Thread | None = None
        self._sought = -1
        # used by the thread alone
        self._row: HandRow | None = None
        self._camera: LiveCamera | None = None
        self._index = self._camera_number = 0
        self._playing = False
        self._speed, self._due_s = 1.0, 0.0
        self._settings = HandSettings()
        self._model: HandModel | None = None
        self._finders: dict[str, AnchorFinder] = {}
        self._kind = "marker"
        self._tracker: HandTracker | None = None
        self._tracked_number = -2
        self._labelling = False
        self._shot: HandShot | None = None
        self._shown_s: deque[float] = deque(maxlen=120)
        self._mesh_s = 0.0
        self._detector: HandDetector | None = None

    # --- the window's side ------------------------------------------------------------------------------

    def open_recording(self, path: Path) -> None:
        """Look at a recorded sequence from its beginning."""

        def order() -> None:
            self._put_away()
            row = open_row(path)
            self._row, self._index = row, 0
            self.log = TrackLog()
            _emit(self.opened, Opened(row.count, row.folder))
            self._show_number(0)

        self._order(order)

    def open_camera(self, open_it: OpenCamera) -> None:
        """Look through a live camera; ``open_it`` is called in the thread."""

        def order() -> None:
            self._put_away()
            self._camera, self._camera_number = open_it(), 0
            self.log = TrackLog(MOST_LIVE_FRAMES)
            _emit(self.opened, Opened(0, None))
            self._set_playing(True)

        self._order(order)

    def release(self) -> None:
        """Look at nothing."""
        self._order(self._put_away)

    def play(self, on: bool) -> None:
        """Go on, or hold the frame that is shown."""

        def order() -> None:
            row = self._row
            if on and row is not None and self._index >= row.count - 1:
                self._index = -1
            self._due_s = time.monotonic()
            self._set_playing(on and (row is not None or self._camera is not None))
            if not on and self._camera is not None:
                self._look_again()

        self._order(order)

    def step(self, by: int) -> None:
        """Hold, and show a neighbouring frame of a recording."""

        def order() -> None:
            if self._row is not None:
                self._set_playing(False)
                self._show_number(min(max(self._index + by, 0), self._row.count - 1))

        self._order(order)

    def seek(self, number: int) -> None:
        """Show a frame of a recording; of several asked for, the last."""
        self._sought = number

        def order() -> None:
            if number != self._sought:
                return
            if self._row is not None and 0 <= number < self._row.count and number != self._index:
                self._due_s = time.monotonic()
                self._show_number(number)

        self._order(order)

    def set_speed(self, factor: float) -> None:
        """How much faster than recorded."""

        def order() -> None:
            self._speed, self._due_s = factor, time.monotonic()

        self._order(order)

    def use(self, model: HandModel | None, settings: HandSettings) -> None:
        """Track with another model or in another way; the frame shown is looked at again."""

        def order() -> None:
            self._model, self._settings = model, settings
            self._finders.clear()
            self._tracker = None
            self.log.clear()
            self._look_again()

        self._order(order)

    def set_labelling(self, on: bool) -> None:
        """Measure the skin of every frame instead of tracking it, and hold recordings."""

        def order() -> None:
            self._labelling = on
            if on and self._row is not None:
                self._set_playing(False)
            self._look_again()

        self._order(order)

    def take(self) -> Tick | None:
        """The newest tick, None if it was taken already."""
        return self._ticks.take()

    def track_once(self, shot: HandShot, then: Callable[[HandAnswer], None]) -> None:
        """Track one frame by itself with the model in use; ``then`` is called in the thread."""

        def order() -> None:
            if self._model is not None:
                tracker = self._made_tracker(shot)
                tracker.reset()
                then(tracker.track(shot.depth_m, shot.rgb))
                self._tracked_number = -2

        self._order(order)

    def close(self) -> None:
        """End the thread, which closes the source, and wait for it."""
        if self._thread is not None:
            self._orders.put(None)
            self._thread.join()
            self._thread = None

    def _order(self, order: Callable[[], None]) -> None:
        self._orders.put(order)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="hand-engine", daemon=True)
            self._thread.start()

    # --- the thread -------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            try:
                order = self._orders.get(timeout=self._patience())
            except queue.Empty:
                self._guarded(self._go_on)
                continue
            if order is None:
                break
            self._guarded(order)
        self._guarded(self._put_away)
        if self._detector is not None:
            self._detector.close()

    def _patience(self) -> float | None:
        """How long to wait for an order before the next frame is due; None for ever."""
        if not self._playing:
            return None if self._camera is None else _WAIT_S
        return 0.0 if self._camera is not None else max(self._due_s - time.monotonic(), 0.0)

    def _guarded(self, step: Callable[[], None]) -> None:
        try:
            step()
        except GeodermError as error:
            self._give_up(TaskFailure(error.message, error.advice, is_bug=False))
        except Exception as error:  # noqa: BLE001 - the border of the thread: nothing may get lost here
            self._give_up(told(describe_failure(error)))

    def _give_up(self, failure: TaskFailure) -> None:
        self._set_playing(False)
        if self._camera is not None:
            camera, self._camera = self._camera, None
            with contextlib.suppress(GeodermError):
                camera.close()
        _emit(self.failed, failure)

    def _set_playing(self, on: bool) -> None:
        if on != self._playing:
            self._playing = on
            self._shown_s.clear()
            _emit(self.playing_changed, on)

    def _put_away(self) -> None:
        self._set_playing(False)
        row, self._row = self._row, None
        camera, self._camera = self._camera, None
        self._shot, self._tracker, self._tracked_number = None, None, -2
        if row is not None:
            row.close()
        if camera is not None:
            camera.close()

    def _go_on(self) -> None:
        """The next frame of what is played."""
        if self._camera is not None:
            self._pull(self._camera)
        elif self._row is not None and self._playing:
            row, following = self._row, self._index + 1
            if following >= row.count:
                self._set_playing(False)
                return
            gap_s = row.time_s(following) - row.time_s(max(following - 1, 0))
            now = time.monotonic()
            self._due_s = max(self._due_s, now - _LONGEST_GAP_S) + min(gap_s, _LONGEST_GAP_S) / self._speed
            self._show_number(following)
            self._due_s = max(self._due_s, now)

    def _pull(self, camera: LiveCamera) -> None:
        frame = camera.latest(self._camera_number, _WAIT_S)
        if frame is None:
            if camera.state is LiveState.STALLED:
                self._give_up(_STALLED)
            return
        self._camera_number = frame.number
        if not self._playing or frame.depth is None:
            return
        shot = HandShot(
            frame.number,
            f"frame_{frame.number:04d}",
            frame.time_s,
            frame.depth,
            frame.depth_unit_m,
            frame.rgb,
            camera.rig,
        )
        self._show(shot)

    def _show_number(self, number: int) -> None:
        assert self._row is not None
        self._index = number
        self._show(self._row.read(number))

    def _look_again(self) -> None:
        self._tracked_number = -2
        if self._shot is not None and (self._row is not None or not self._playing):
            self._show(self._shot)

    def _show(self, shot: HandShot) -> None:
        self._shot = shot
        answer, skin = None, None
        if self._model is not None and not self._labelling:
            answer = self._track(shot)
            self.log.add(shot, answer)
        elif not (self._labelling and self._playing):
            skin = look_at(shot, self._made_finder(None), step_px=1 if self._labelling else 2)
        self._tell(shot, answer, skin)

    def _tell(self, shot: HandShot, answer: HandAnswer | None, skin: FrameSkin | None) -> None:
        anchors = np.zeros((0, 3))
        if answer is not None:
            anchors = answer.anchors_m
        elif skin is not None:
            anchors = skin.anchors_m
        now = time.monotonic()
        self._shown_s.append(now)
        mesh = None
        if not self._playing or now - self._mesh_s >= _MESH_EVERY_S:
            surface = answer.surface if answer is not None else skin.surface if skin is not None else None
            mesh, self._mesh_s = hand_mesh(shot, surface, answer, anchors), now
        kind = self._kind
        finite = np.isfinite(anchors).all(axis=1)
        pixels = np.full((len(anchors), 2), np.nan)
        if finite.any():
            pixels[finite] = shot.rig.project_to_picture(anchors[finite])
        live = self._camera is not None
        tick = Tick(shot, picture_of(shot), answer, skin, pixels, kind, mesh, self._rate(now), live)
        if self._ticks.put(tick):
            _emit(self.ticked)

    def _rate(self, now: float) -> float:
        recent = [t for t in self._shown_s if now - t <= _RATE_OVER_S]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 else 0.0

    def _track(self, shot: HandShot) -> HandAnswer:
        tracker = self._made_tracker(shot)
        follows = self._camera is not None or shot.number == self._tracked_number + 1
        if not follows:
            tracker.reset()
        self._tracked_number = shot.number
        return tracker.track(shot.depth_m, shot.rgb)

    def _made_tracker(self, shot: HandShot) -> HandTracker:
        from core.hand.tracker import HandTracker

        if self._tracker is None:
            assert self._model is not None
            self._tracker = HandTracker(
                self._model, shot.rig, self._made_finder(self._model), self._settings.tracking
            )
        return self._tracker

    def _made_finder(self, model: HandModel | None) -> AnchorFinder:
        """What finds the anchors of a model, or those that new models are learned with."""
        wanted = model or empty_model(self._settings)
        key = "settings" if model is None else "model"
        if key not in self._finders:
            if wanted.anchors == "palm" and self._detector is None:
                self._detector = open_follower()
            self._finders[key] = finder_of(wanted, self._detector)
        self._kind = self._finders[key].kind
        return self._finders[key]


def open_follower() -> HandDetector:
    """The detector of successive pictures, for anchors without a marker.

    Raises
    ------
    WorkError
        If it cannot run here.
    """
    from devices.trackers.mediapipe_hands import HandFollower

    return HandFollower()


def _emit(signal: SignalInstance, *what: object) -> None:
    """Tell the window, unless it is gone."""
    with contextlib.suppress(RuntimeError):
        signal.emit(*what)
