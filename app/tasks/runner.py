"""The task runner: one worker thread, tasks in order, signals in the GUI thread."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from enum import Enum
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal, Slot

from app.tasks.failures import LOGGER, TaskFailure, describe_failure
from core.errors import Cancelled
from core.progress import Progress

_MIN_REPORT_INTERVAL_S = 0.04


class TaskState(Enum):
    """Where a task is in its life; the last three are final."""

    WAITING = "waiting"
    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Task(QObject):
    """One piece of work. Made by `TaskRunner.start`; lives in the GUI thread.

    Signals (all in the GUI thread)
    -------------------------------
    progressed(float, str)
        Fraction 0..1 and what is being done (at most 25 times a second).
    finished(object)
        What the work returned.
    failed(object)
        A `TaskFailure`.
    cancelled()
    ended()
        After exactly one of the three above.
    """

    progressed = Signal(float, str)
    finished = Signal(object)
    failed = Signal(object)
    cancelled = Signal()
    ended = Signal()
    _reported = Signal(float, str)
    _done = Signal(object, object)

    def __init__(self, title: str, *, cancellable: bool, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.title = title
        self.cancellable = cancellable
        self.state = TaskState.WAITING
        self._stop = threading.Event()
        self._last_report = 0.0
        self._reported.connect(self._on_reported, Qt.ConnectionType.QueuedConnection)
        self._done.connect(self._on_done, Qt.ConnectionType.QueuedConnection)

    @property
    def running(self) -> bool:
        """Whether the task has not ended yet."""
        return self.state in (TaskState.WAITING, TaskState.RUNNING)

    @property
    def cancel_asked(self) -> bool:
        """Whether `cancel` was called."""
        return self._stop.is_set()

    @Slot()
    def cancel(self) -> None:
        """Ask the work to stop; it ends as cancelled at its next progress report."""
        self._stop.set()

    def report(self, fraction: float, message: str = "") -> None:
        """The `core.progress.Progress` the work is given (called in the worker thread)."""
        if self._stop.is_set():
            raise Cancelled
        now = time.monotonic()
        if now - self._last_report >= _MIN_REPORT_INTERVAL_S or fraction >= 1.0:
            self._last_report = now
            self._reported.emit(min(max(float(fraction), 0.0), 1.0), message)

    def run(self, work: Callable[[Progress], Any]) -> None:
        """Do ``work`` in the calling thread and hand the outcome to the GUI thread."""
        self.state = TaskState.RUNNING
        try:
            self.report(0.0)
            result = work(self.report)
        except Cancelled as stop:
            self._done.emit(None, stop)
        except Exception as error:  # noqa: BLE001 - the border of the worker thread: nothing may get lost here
            self._done.emit(None, error)
        else:
            self._done.emit(result, None)

    @Slot(float, str)
    def _on_reported(self, fraction: float, message: str) -> None:
        if self.running:
            self.progressed.emit(fraction, message)

    @Slot(object, object)
    def _on_done(self, result: object, error: BaseException | None) -> None:
        if isinstance(error, Cancelled):
            self.state = TaskState.CANCELLED
            self.cancelled.emit()
        elif error is not None:
            self.state = TaskState.FAILED
            self.failed.emit(describe_failure(error))
        else:
            self.state = TaskState.FINISHED
            self.finished.emit(result)
        self.ended.emit()


class TaskRunner(QObject):
    """Runs tasks one after another in one worker thread.

    Signals
    -------
    busy_changed(bool)
        True when a task was started while none ran, False when the last one has ended.
    unhandled(object)
        The `TaskFailure` of a task started with ``quiet=True`` (nobody else shows it).
    """

    busy_changed = Signal(bool)
    unhandled = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        # A plain thread that lives as long as the runner, not a QThreadPool: PySide gives every QRunnable
        # a new Python thread state on the same system thread, and extensions that keep the first one
        # (pybind11: Open3D, MediaPipe) then wait for themselves with the interpreter locked.
        self._queue: queue.SimpleQueue[tuple[Task, Callable[[Progress], Any]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="geoderm-tasks", daemon=True)
        self._thread.start()
        self._tasks: list[Task] = []

    @property
    def busy(self) -> bool:
        """Whether any task is waiting or running."""
        return bool(self._tasks)

    def start(
        self,
        title: str,
        work: Callable[[Progress], Any],
        *,
        cancellable: bool = True,
        quiet: bool = False,
    ) -> Task:
        """Queue ``work`` and return its task; connect to the task's signals right away.

        Parameters
        ----------
        title : str
            What the user sees, for example "Finding the lesions".
        work : callable
            Called with a `Progress` in the worker thread; it must not touch a widget.
        cancellable : bool
            Whether the user is offered to cancel.
        quiet : bool
            Work nobody waits for: its failure goes to `unhandled`.
        """
        task = Task(title, cancellable=cancellable, parent=self)
        if quiet:
            task.failed.connect(self.unhandled)
        task.ended.connect(self._forget_ended)
        self._tasks.append(task)
        if len(self._tasks) == 1:
            self.busy_changed.emit(True)
        self._queue.put((task, work))
        return task

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            task, work = job
            task.run(work)

    def shut_down(self, timeout_s: float = 10.0) -> bool:
        """Cancel everything and wait for the worker; True if it ended in time."""
        for task in self._tasks:
            task.cancel()
        self._queue.put(None)
        self._thread.join(timeout_s)
        ended = not self._thread.is_alive()
        if not ended:
            LOGGER.error("A task did not end within %.0f s of closing.", timeout_s)
        return ended

    @Slot()
    def _forget_ended(self) -> None:
        ended = [task for task in self._tasks if not task.running]
        self._tasks = [task for task in self._tasks if task.running]
        for task in ended:
            task.setParent(None)
            task.deleteLater()
        if ended and not self._tasks:
            self.busy_changed.emit(False)


__all__ = ["Task", "TaskFailure", "TaskRunner", "TaskState"]
