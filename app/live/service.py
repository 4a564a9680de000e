"""The live service: threads that look through the camera, and what they tell the window."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.live.display import show_color, show_depth
from app.live.newest import Newest
from app.live.status import LiveStatus, Shown
from app.tasks import TaskFailure, describe_failure
from core.errors import GeodermError
from devices.live import LiveState

if TYPE_CHECKING:
    from core.anchors import LivePose, LiveSkeleton
    from core.capture.rgbd import CameraRig
    from core.guidance import Guidance
    from devices.camera import DepthCamera
    from devices.live import LiveCamera, LiveFrame

POSE_INTERVAL_S: Final = 1 / 15
GUIDE_INTERVAL_S: Final = 1 / 10
FRAME_INTERVAL_S: Final = 1 / 32
"""A faster camera is not shown faster."""

REOPEN_INTERVAL_S: Final = 2.0
REOPEN_STALLED_S: Final = 6.0
POSE_AGE_S: Final = 0.5
"""A skeleton older than this is not judged any more."""

_WAIT_S: Final = 0.1

Opener = Callable[[], "DepthCamera"]


@dataclass(frozen=True, eq=False)
class _Source:
    """One opened camera."""

    camera: DepthCamera
    live: LiveCamera | None
    reopen: Opener


@dataclass(frozen=True, eq=False)
class _Seen:
    """A frame on its way to skeleton and readings."""

    frame: LiveFrame
    rig: CameraRig
    source: _Source


class LiveService(QObject):
    """Shows one camera while somebody looks. All signals arrive in the GUI's thread.

    Signals
    -------
    pictured()
        `take_picture` has a newer picture.
    posed()
        `pose` has changed.
    guided()
        `guidance` has changed.
    status_changed(object)
        A `LiveStatus`.
    reconnected(object)
        The camera that was gone is open again: a `DepthCamera` in place of the old one.
    failed(object)
        A `TaskFailure`: the picture of a recording could not be read, or the tracker cannot run.
    """

    pictured = Signal()
    posed = Signal()
    guided = Signal()
    status_changed = Signal(object)
    reconnected = Signal(object)
    failed = Signal(object)
    _came_back = Signal(object, object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._gate = threading.Condition()
        self._source: _Source | None = None
        self._looking = False
        self._resting = False
        self._closed = False
        self._room = (640, 480)
        self._psi = False
        self._threads: list[threading.Thread] = []
        self._pictures: Newest[Shown] = Newest()
        self._to_pose: Newest[_Seen] = Newest()
        self._to_judge: Newest[_Seen] = Newest()
        self.pose: LivePose | None = None
        self.guidance: Guidance | None = None
        self.status = LiveStatus("idle")
        self._came_back.connect(self._on_came_back, Qt.ConnectionType.QueuedConnection)

    # --- the window's side -------------------------------------------------------------------------------

    def set_camera(self, camera: DepthCamera | None, reopen: Opener | None = None) -> None:
        """Look through another open camera, or through none.

        Parameters
        ----------
        camera : DepthCamera or None
        reopen : callable
            Opens the same camera again, in any thread; asked when it is gone.
        """
        from devices.live import LiveCamera

        source = None
        if camera is not None and reopen is not None:
            source = _Source(camera, camera if isinstance(camera, LiveCamera) else None, reopen)
        with self._gate:
            self._source = source
            self._gate.notify_all()
        self.pose, self.guidance = None, None
        self._pictures.take()
        self._tell(LiveStatus("idle"))

    @property
    def is_live(self) -> bool:
        """Whether the camera sees the present."""
        return self._source is not None and self._source.live is not None

    def look(self, on: bool) -> None:
        """Begin or end looking; while nobody looks the threads wait and the camera is left alone."""
        with self._gate:
            changed = on != self._looking
            self._looking = on
            self._gate.notify_all()
        if on and not self._threads and not self._closed:
            self._start()
        if changed and not on:
            self.pose, self.guidance = None, None
            self._pictures.take()

    def rest(self, on: bool) -> None:
        """Leave the processor to other work: the picture goes on, skeleton and readings wait."""
        self._resting = on

    def set_room(self, width: int, height: int) -> None:
        """Width and height in device pixels that a picture may take."""
        self._room = (max(width, 16), max(height, 16))

    def set_psi(self, on: bool) -> None:
        """Whether the psi stance is wanted."""
        self._psi = on

    def take_picture(self) -> Shown | None:
        """The newest picture, or None if it was taken already."""
        return self._pictures.take()

    def close(self) -> None:
        """End the threads and wait for them. The camera stays open: it belongs to somebody else."""
        self._tell(LiveStatus("idle"))
        with self._gate:
            self._closed, self._looking, self._source = True, False, None
            self._gate.notify_all()
        for box in (self._to_pose, self._to_judge):
            box.close()
        for thread in self._threads:
            thread.join()
        self._threads = []

    def _tell(self, status: LiveStatus) -> None:
        if status != self.status:
            self.status = status
            self.status_changed.emit(status)

    @Slot(object, object)
    def _on_came_back(self, camera: DepthCamera, old: _Source) -> None:
        if self._closed or self._source is not old:
            camera.close()
            return
        self.set_camera(camera, old.reopen)
        self.reconnected.emit(camera)

    # --- the threads -------------------------------------------------------------------------------------

    def _start(self) -> None:
        for name, work in (("pull", self._pull), ("pose", self._follow), ("guide", self._judge)):
            thread = threading.Thread(target=work, name=f"live-{name}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def _await_source(self) -> _Source | None:
        """The camera to look through, once somebody looks; None at the end."""
        with self._gate:
            self._gate.wait_for(lambda: self._closed or (self._looking and self._source is not None))
            return None if self._closed else self._source

    def _wanted(self, source: _Source) -> bool:
        return self._looking and self._source is source and not self._closed

    def _pull(self) -> None:
        while (source := self._await_source()) is not None:
            try:
                if source.live is None:
                    self._show_still(source)
                else:
                    self._stream(source, source.live)
            except GeodermError as error:
                self._emit_status(source, LiveStatus("gone", error.message, _GONE_ADVICE))
                self._reopen(source)
            except Exception as error:  # noqa: BLE001 - the border of the thread: nothing may get lost here
                self.failed.emit(describe_failure(error))
                self._idle_until_changed(source)

    def _show_still(self, source: _Source) -> None:
        """The one picture of a camera that does not see the present."""
        try:
            preview = source.camera.preview()
        except GeodermError as error:
            self.failed.emit(TaskFailure(error.message, error.advice, is_bug=False))
            preview = None
        if preview is not None and self._wanted(source):
            if preview.rgb is not None:
                self._show(show_color(preview.rgb, self._room, 1, 0.0))
            elif preview.depth_m is not None:
                millimetres = (1000.0 * preview.depth_m).astype("uint16")
                self._show(show_depth(millimetres, 0.001, self._room, 1, 0.0))
        self._idle_until_changed(source)

    def _idle_until_changed(self, source: _Source) -> None:
        with self._gate:
            self._gate.wait_for(lambda: not self._wanted(source))

    def _stream(self, source: _Source, camera: LiveCamera) -> None:
        number, shown_s = 0, 0.0
        came_s = time.monotonic()
        while self._wanted(source):
            frame = camera.latest(number, _WAIT_S)
            now = time.monotonic()
            if frame is None:
                if camera.state is LiveState.STALLED:
                    self._emit_status(source, _STALLED)
                    if now - came_s > REOPEN_STALLED_S and self._reopen(source):
                        return
                continue
            came_s = now
            number = frame.number
            self._emit_status(source, LiveStatus("streaming"))
            seen = _Seen(frame, camera.rig, source)
            if not self._resting:
                self._to_pose.put(seen)
                self._to_judge.put(seen)
            if frame.rgb is not None:
                self._show(show_color(frame.rgb, self._room, frame.number, frame.time_s))
            elif frame.depth is not None:
                self._show(
                    show_depth(frame.depth, frame.depth_unit_m, self._room, frame.number, frame.time_s)
                )
            spare = shown_s + FRAME_INTERVAL_S - time.monotonic()
            if spare > 0:
                time.sleep(spare)
            shown_s = time.monotonic()

    def _show(self, picture: Shown) -> None:
        if self._pictures.put(picture):
            self.pictured.emit()

    def _emit_status(self, source: _Source, status: LiveStatus) -> None:
        if self._source is source:
            self._tell(status)

    def _reopen(self, source: _Source) -> bool:
        """Try to open the camera again until it is there; True if it is and the GUI was told."""
        once = self.status.kind == "stalled"
        while self._wanted(source):
            with self._gate:
                self._gate.wait_for(lambda: not self._wanted(source), REOPEN_INTERVAL_S)
            if not self._wanted(source):
                return False
            try:
                source.camera.close()
                camera = source.reopen()
            except GeodermError:
                if once:  # a stalled camera that cannot be opened again is gone
                    self._emit_status(source, _STALLED)
                continue
            self._came_back.emit(camera, source)
            self._idle_until_changed(source)
            return True
        return False

    def _follow(self) -> None:
        """The skeleton's thread."""
        skeleton: LiveSkeleton | None = None
        source: _Source | None = None
        try:
            while not self._closed:
                seen = self._to_pose.take(None)
                if seen is None:
                    continue
                began = time.monotonic()
                if skeleton is None:
                    from devices.trackers import open_live_skeleton

                    skeleton = open_live_skeleton()
                if seen.source is not source:
                    source = seen.source
                    skeleton.reset()
                frame = seen.frame
                if frame.rgb is not None:
                    pose = skeleton.update(frame.rgb, frame.color_time_s or frame.time_s)
                elif frame.depth is not None:
                    depth_m = frame.depth.astype("float32") * frame.depth_unit_m
                    pose = skeleton.update(None, frame.time_s, depth_m, seen.rig)
                else:
                    continue
                if self._wanted(seen.source):
                    self.pose = pose
                    self.posed.emit()
                self._pause(began, POSE_INTERVAL_S)
        except GeodermError as error:
            self.failed.emit(TaskFailure(error.message, error.advice, is_bug=False))
        except Exception as error:  # noqa: BLE001 - the border of the thread
            self.failed.emit(describe_failure(error))
        finally:
            if skeleton is not None:
                skeleton.close()

    def _judge(self) -> None:
        """The thread of the readings."""
        from core.guidance import LiveGuide, Reach

        guide: LiveGuide | None = None
        source: _Source | None = None
        try:
            while not self._closed:
                seen = self._to_judge.take(None)
                if seen is None or seen.frame.depth is None:
                    continue
                began = time.monotonic()
                if guide is None or seen.source is not source:
                    source = seen.source
                    live = source.live
                    sensor = "" if live is None else live.identity.sensor
                    guide = LiveGuide(Reach.of_sensor(sensor))
                frame, pose = seen.frame, self.pose
                if pose is not None and abs(frame.time_s - pose.time_s) > POSE_AGE_S:
                    pose = None
                guidance = guide.update(
                    frame.time_s,
                    frame.depth,
                    frame.depth_unit_m,
                    frame.rgb,
                    seen.rig,
                    pose,
                    psi=self._psi,
                )
                if self._wanted(seen.source):
                    self.guidance = guidance
                    self.guided.emit()
                self._pause(began, GUIDE_INTERVAL_S)
        except Exception as error:  # noqa: BLE001 - the border of the thread
            self.failed.emit(describe_failure(error))

    def _pause(self, began_s: float, interval_s: float) -> None:
        spare = began_s + interval_s - time.monotonic()
        if spare > 0:
            with self._gate:
                self._gate.wait_for(lambda: self._closed, spare)


_GONE_ADVICE: Final = (
    "Check its cable and power. It is opened again by itself as soon as it is back. "
    "Nothing of the visit is lost."
)
_STALLED = LiveStatus(
    "stalled",
    "The camera has stopped delivering pictures.",
    "Check its cable; it is started again by itself. Nothing of the visit is lost.",
)
