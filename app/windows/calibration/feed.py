"""The thread that looks through the camera being calibrated, finds the board, and keeps the window free."""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Qt, Signal, SignalInstance, Slot
from PySide6.QtGui import QImage

from app.live.display import fitted, show_color
from app.live.newest import Newest
from app.live.status import Shown
from app.tasks import TaskFailure, describe_failure
from core.errors import GeodermError
from devices.live import LiveState

if TYPE_CHECKING:
    from app.windows.calibration.work import Findings, FrameWork
    from devices.live import LiveCamera, LiveFrame, StreamKind

_WAIT_S: Final = 0.2
_STALLED: Final = TaskFailure(
    "The camera has stopped delivering pictures.",
    "Check its cable, then open the camera again. The views collected so far are kept.",
    is_bug=False,
)


@dataclass(frozen=True, eq=False)
class Tick:
    """One frame as the window shows it.

    Attributes
    ----------
    color, infrared : Shown or None
        Pictures ready to be painted; None where the camera did not send one.
    color_corners, infrared_corners : ndarray (n, 2)
        Corners found, in pixels of the camera's own picture.
    findings : Findings
    """

    color: Shown | None
    infrared: Shown | None
    color_corners: NDArray[np.float64]
    infrared_corners: NDArray[np.float64]
    findings: Findings


class CalibrationFeed(QObject):
    """Looks through one camera while there is something to do. Signals arrive in the GUI's thread.

    Signals
    -------
    ticked()
        `take` has a newer `Tick`.
    lost(object)
        A `TaskFailure`: the camera is gone or stalled, or looking failed. The feed has paused.
    """

    ticked = Signal()
    lost = Signal(object)
    _ended = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._orders: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._ticks: Newest[Tick] = Newest()
        self._thread: threading.Thread | None = None
        self._room = (640, 480)
        self._orphan = False
        # used by the thread alone
        self._camera: LiveCamera | None = None
        self._work: FrameWork | None = None
        self._streams: frozenset[StreamKind] = frozenset()
        self._number = 0
        self._ended.connect(self._on_ended, Qt.ConnectionType.QueuedConnection)

    # --- the window's side ------------------------------------------------------------------------------

    def begin(self, camera: LiveCamera, work: FrameWork, streams: frozenset[StreamKind]) -> None:
        """Look through an open camera, which now belongs to the feed.

        ``streams`` are the kinds it streams; empty if the feed has had this camera before.
        """

        def order() -> None:
            if self._camera is not camera:
                self._put_away()
                self._camera, self._number = camera, 0
            self._work = work
            if streams:
                self._streams = streams

        self._order(order)

    def pause(self, then: Callable[[], None] | None = None) -> None:
        """Look no further; ``then`` is called in the feed's thread when nothing is looked at any more."""

        def order() -> None:
            self._work = None
            if then is not None:
                then()

        self._order(order)

    def release(self, then: Callable[[], None]) -> None:
        """Close the camera; ``then`` is called in the feed's thread when it is closed."""

        def order() -> None:
            try:
                self._put_away()
            finally:
                then()

        self._order(order)

    def ask(self, question: Callable[[], Findings | None]) -> None:
        """Do something to the work between two frames; what it tells is shown."""

        def order() -> None:
            findings = question()
            if findings is not None:
                self._put(Tick(None, None, _NONE, _NONE, findings))

        self._order(order)

    def set_room(self, width: int, height: int) -> None:
        """Width and height in device pixels that a picture may take."""
        self._room = (max(width, 16), max(height, 16))

    def take(self) -> Tick | None:
        """The newest tick, None if it was taken already."""
        return self._ticks.take()

    @property
    def running(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    def close(self, wait_s: float = 0.0) -> None:
        """End the thread, which closes the camera; waits for it at most ``wait_s``."""
        if self._thread is None:
            return
        self._orders.put(None)
        if wait_s:
            self._thread.join(wait_s)

    def outlive(self, heir: QObject) -> None:
        """Belong to ``heir`` from now on, and go when the thread has ended: nobody has to wait for it."""
        self.setParent(heir)
        self._orphan = True
        if not self.running:
            self.deleteLater()

    @Slot()
    def _on_ended(self) -> None:
        if self._orphan:
            self.deleteLater()

    def _order(self, order: Callable[[], None]) -> None:
        self._orders.put(order)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="calibration-feed", daemon=True)
            self._thread.start()

    # --- the thread -------------------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            try:
                order = self._orders.get(block=self._work is None)
            except queue.Empty:
                self._guarded(self._look)
                continue
            if order is None:
                break
            self._guarded(order)
        self._guarded(self._put_away)
        _emit(self._ended)

    def _guarded(self, step: Callable[[], None]) -> None:
        try:
            step()
        except GeodermError as error:
            self._give_up(TaskFailure(error.message, error.advice, is_bug=False))
        except Exception as error:  # noqa: BLE001 - the border of the thread: nothing may get lost here
            self._give_up(describe_failure(error))

    def _give_up(self, failure: TaskFailure) -> None:
        self._work = None
        _emit(self.lost, failure)

    def _put_away(self) -> None:
        camera, self._camera, self._work = self._camera, None, None
        if camera is not None:
            camera.close()

    def _look(self) -> None:
        camera, work = self._camera, self._work
        if camera is None or work is None:
            return
        wanted = frozenset(work.streams)
        if wanted != self._streams:
            camera.start(wanted)
            self._streams, self._number = wanted, 0
        frame = camera.latest(self._number, _WAIT_S)
        if frame is None:
            if camera.state is LiveState.STALLED:
                self._give_up(_STALLED)
            return
        self._number = frame.number
        findings = work.look(frame)
        self._put(self._tick(frame, findings))

    def _tick(self, frame: LiveFrame, findings: Findings) -> Tick:
        room, number, time_s = self._room, frame.number, frame.time_s
        step = findings.step
        return Tick(
            None if frame.rgb is None else show_color(frame.rgb, room, number, time_s),
            None if frame.infrared is None else show_gray(frame.infrared, room, number, time_s),
            _NONE if step.color is None else step.color.pixels,
            _NONE if step.infrared is None else step.infrared.pixels,
            findings,
        )

    def _put(self, tick: Tick) -> None:
        if self._ticks.put(tick):
            _emit(self.ticked)


def _emit(signal: SignalInstance, *what: object) -> None:
    """Tell the window, unless it is gone: the thread may end a moment after it."""
    with contextlib.suppress(RuntimeError):
        signal.emit(*what)


_NONE: Final = np.zeros((0, 2))


def show_gray(image: NDArray[Any], room: tuple[int, int], number: int, time_s: float) -> Shown:
    """An infrared picture, 8 or 16 bit, in the size in which it is painted."""
    from core.calibration.board import gray_picture

    gray = gray_picture(image)
    size = (gray.shape[1], gray.shape[0])
    to = fitted(size, room)
    small = cv2.resize(gray, to, interpolation=cv2.INTER_AREA if to[0] < size[0] else cv2.INTER_LINEAR)
    pixels = np.asarray(cv2.cvtColor(small, cv2.COLOR_GRAY2BGRA), np.uint8)
    picture = QImage(pixels.data, to[0], to[1], pixels.strides[0], QImage.Format.Format_RGB32)
    return Shown(picture, pixels, size, number, time_s)
