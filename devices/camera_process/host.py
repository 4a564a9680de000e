"""The application's side of a camera's own process: waits a bounded time and survives its crash or hang.

A camera is read in a process of its own because native capture libraries can block for ever in one call, and
can crash when a cable is pulled. A thread that hangs cannot be ended and keeps the camera; a process can.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.shared_memory import SharedMemory
from typing import Any

from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.camera_process.packets import CameraSource, Packet, Placed, take
from devices.child_process import ChildProcess
from devices.live import STALLED_AFTER_S, LiveState

OPEN_TIMEOUT_S = 20.0
ANSWER_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class _Notice:
    """The newest packet of the stream."""

    number: int
    start: int
    stamp: int
    places: list[Placed]
    facts: Mapping[str, Any]


class CameraProcess:
    """A camera in a process of its own.

    Parameters
    ----------
    source : CameraSource
    name : str
        What messages call the camera.
    advice : str
        What to do when it crashes or hangs.
    stalled_after_s : float
        Without a picture for this long the camera is called stalled.
    """

    def __init__(
        self, source: CameraSource, name: str, advice: str, *, stalled_after_s: float = STALLED_AFTER_S
    ) -> None:
        self._source, self._name, self._advice = source, name, advice
        self._stalled_after_s = stalled_after_s
        self._process: ChildProcess | None = None
        self._pipe: Connection | None = None
        self._reader: threading.Thread | None = None
        self._news = threading.Condition()
        self._memory_lock = threading.Lock()
        self._pipe_lock = threading.Lock()
        self._memory: dict[str, SharedMemory] = {}
        self._reset()

    def _reset(self) -> None:
        self._opened: Mapping[str, Any] | None = None
        self._gone: WorkError | None = None
        self._notice: _Notice | None = None
        self._answers: dict[int, tuple[Any, ...]] = {}
        self._asked = 0
        self._last_s = 0.0

    @property
    def pid(self) -> int | None:
        """Process id, for diagnosis."""
        return self._process.pid if self._process is not None else None

    @property
    def state(self) -> LiveState:
        """How the camera is; cheap."""
        if self._gone is not None:
            return LiveState.GONE
        if self._opened is None:
            return LiveState.CLOSED
        quiet = time.monotonic() - self._last_s > self._stalled_after_s
        return LiveState.STALLED if quiet else LiveState.STREAMING

    def open(self, timeout_s: float = OPEN_TIMEOUT_S) -> Mapping[str, Any]:
        """Start the process, open the camera in it and return what it tells.

        Raises
        ------
        WorkError
            If the camera cannot be opened, or not within ``timeout_s``.
        """
        from devices.camera_process.worker import serve

        self.close()
        self._process = ChildProcess(serve, "geoderm-camera", self._source)
        self._pipe = self._process.pipe
        self._reader = threading.Thread(target=self._listen, name="geoderm-camera-reader", daemon=True)
        self._reader.start()
        try:
            with self._news:
                told = self._news.wait_for(lambda: self._opened is not None or self._gone, timeout_s)
                if self._gone is not None:
                    raise self._gone
                if not told or self._opened is None:
                    raise WorkError(f"{self._name} did not answer for {timeout_s:.0f} seconds.", self._advice)
                return self._opened
        except BaseException:
            self.close()
            raise

    def latest(self, after: int, timeout_s: float) -> tuple[int, Packet] | None:
        """The newest packet and its number, if greater than ``after``; waits at most ``timeout_s``.

        Raises
        ------
        WorkError
            If the camera is gone.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            with self._news:
                while (
                    self._gone is None
                    and (self._notice is None or self._notice.number <= after)
                    and self._news.wait(max(0.0, deadline - time.monotonic()))
                ):
                    pass
                self._check_open()
                notice = self._notice
            if notice is None or notice.number <= after:
                return None
            arrays = self._take("stream", notice.places, notice.start, notice.stamp)
            self._tell(("taken", notice.stamp))
            if arrays is not None:
                return notice.number, Packet(arrays, notice.facts)
            # Written over while it was copied: a newer one is there.
            after = max(after, notice.number)

    def request(
        self,
        name: str,
        *,
        timeout_s: float = ANSWER_TIMEOUT_S,
        progress: Progress = no_progress,
        **arguments: Any,
    ) -> Any:
        """Ask the camera's process something and return its answer; a `Packet` comes back as a packet.

        Raises
        ------
        InputError, WorkError
            What the camera complained of; or that it is gone; or that it did not answer for ``timeout_s``
            (the process is then ended: what hangs cannot be called back).
        Cancelled
            Through ``progress``, which is called while waiting.
        """
        progress(0.0)
        deadline = time.monotonic() + timeout_s
        with self._news:
            self._check_open()
            self._asked += 1
            asked = self._asked
        self._tell(("request", asked, name, arguments))
        while True:
            with self._news:
                self._news.wait_for(lambda: self._gone or asked in self._answers, 0.1)
                answer = self._answers.pop(asked, None)
                if answer is None:
                    self._check_open()
            if answer is not None:
                return self._value(answer)
            progress(0.0)
            if time.monotonic() > deadline:
                self._fail(
                    WorkError(f"{self._name} did not answer for {timeout_s:.0f} seconds.", self._advice)
                )

    def close(self) -> None:
        """End the process and wait for it: no zombie and no shared memory stays behind."""
        if self._pipe is not None:
            with self._pipe_lock:
                process, pipe, reader = self._process, self._pipe, self._reader
                self._process, self._pipe, self._reader = None, None, None
            assert process is not None
            assert reader is not None
            with contextlib.suppress(OSError):
                pipe.send(("close",))
            process.finish(1.5)
            reader.join(5.0)
            process.end()
        with self._memory_lock:
            for memory in self._memory.values():
                memory.close()
                memory.unlink()
            self._memory = {}
        with self._news:
            self._reset()
            self._news.notify_all()

    def _tell(self, message: tuple[Any, ...]) -> None:
        with self._pipe_lock, contextlib.suppress(OSError):  # a broken pipe is told by the reader
            if self._pipe is not None:
                self._pipe.send(message)

    def _check_open(self) -> None:
        if self._gone is not None:
            raise WorkError(self._gone.message, self._gone.advice)
        if self._opened is None:
            raise WorkError(f"{self._name} is closed.", "Open it first.")

    def _fail(self, error: WorkError) -> None:
        """Give the camera up: it is gone until it is opened again."""
        if self._process is not None:
            self._process.kill()
        with self._news:
            self._gone = self._gone or error
            self._news.notify_all()
        raise error

    def _value(self, answer: tuple[Any, ...]) -> Any:
        kind, first, *rest = answer
        if kind == "complaint":
            raise (InputError if first else WorkError)(*rest)
        placed = rest[0]
        if placed is None:
            return first
        start, stamp, places = placed
        arrays = self._take("answers", places, start, stamp)
        if arrays is None:
            raise WorkError(f"{self._name}: two answers came at once.", "Ask again.")
        return Packet(arrays, first)

    def _take(self, channel: str, places: list[Placed], start: int, stamp: int) -> dict[str, Any] | None:
        with self._memory_lock:
            memory = self._memory.get(channel)
            return None if memory is None else take(places, memory, start, stamp)

    def _listen(self) -> None:
        """Reader thread: keeps the pipe empty."""
        pipe, process = self._pipe, self._process
        assert pipe is not None
        assert process is not None
        try:
            while True:
                wait([pipe, process.sentinel], 1.0)
                if pipe.poll(0):
                    self._hear(pipe, pipe.recv())
                elif not process.alive:
                    break
        except (EOFError, OSError):
            pass
        with self._news:
            if self._gone is None:
                self._gone = WorkError(
                    f"{self._name} is gone: its driver crashed. What was saved is safe.", self._advice
                )
            self._news.notify_all()

    def _hear(self, pipe: Connection, message: tuple[Any, ...]) -> None:
        kind, *rest = message
        if kind == "memory":
            channel, size = rest
            name = self._new_memory(channel, size)
            with self._pipe_lock:
                pipe.send(("memory", name))
            return
        with self._news:
            if kind == "opened":
                self._opened, self._last_s = rest[0], time.monotonic()
            elif kind == "frame":
                self._notice, self._last_s = _Notice(*rest), time.monotonic()
            elif kind == "gone":
                self._gone = WorkError(*rest)
            elif kind in ("answer", "complaint"):
                self._answers[rest[0]] = (kind, *rest[1:])
            self._news.notify_all()

    def _new_memory(self, channel: str, size: int) -> str:
        memory = SharedMemory(create=True, size=size)
        with self._news:
            if channel == "stream":
                self._notice = None
        with self._memory_lock:
            old = self._memory.pop(channel, None)
            if old is not None:
                old.close()
                old.unlink()
            self._memory[channel] = memory
        return memory.name
