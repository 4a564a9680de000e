"""The application's side of the runtime's process: asks, waits a bounded time, and survives its death."""

from __future__ import annotations

import threading
import time
from multiprocessing.connection import Connection
from typing import Any

from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.child_process import ChildProcess

ANSWER_TIMEOUT_S = 20.0
_ADVICE = {
    "camera": "Unplug and reconnect the camera, then try again.",
    "recording": "The recording may be damaged; choose another.",
}


class RuntimeProcess:
    """The OpenNI2 runtime in a process of its own, started with the first request. Any thread may use it.

    Parameters
    ----------
    source : {"camera", "recording"}
        What messages call the source.
    """

    def __init__(self, source: str = "camera") -> None:
        self._source = source
        self._lock = threading.RLock()
        self._process: ChildProcess | None = None
        self._busy = False

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        process = self._process
        return process is not None and process.alive

    @property
    def pid(self) -> int | None:
        """Process id, for diagnosis."""
        process = self._process
        return process.pid if process is not None else None

    @property
    def busy(self) -> bool:
        """Whether a request is being worked on: no sign of life is due meanwhile."""
        return self._busy

    def request(
        self,
        operation: str,
        *,
        timeout_s: float | None = None,
        progress: Progress = no_progress,
        **arguments: object,
    ) -> Any:
        """Run one operation there and return its value.

        Raises
        ------
        WorkError
            What the runtime complained of; or that it crashed; or that it did not answer for ``timeout_s``
            (default `ANSWER_TIMEOUT_S`).
        InputError
            If the operation refused its arguments.
        Cancelled
            Through ``progress``. The process is stopped: a read in flight cannot be taken back.
        """
        with self._lock:
            self._busy = True
            try:
                pipe = self._started()
                pipe.send((operation, arguments))
                answer = self._answer(pipe, ANSWER_TIMEOUT_S if timeout_s is None else timeout_s, progress)
            except (EOFError, OSError) as error:
                self.stop()
                raise self.crashed() from error
            except BaseException:
                self.stop()
                raise
            finally:
                self._busy = False
        if answer[0] == "done":
            return answer[1]
        _, kind, message, advice = answer
        raise (InputError if kind == "input" else WorkError)(message, advice)

    def _answer(self, pipe: Connection, timeout_s: float, progress: Progress) -> tuple[Any, ...]:
        deadline = time.monotonic() + timeout_s
        while not pipe.poll(min(0.1, max(deadline - time.monotonic(), 0.0))):
            progress(0.0)
            if time.monotonic() >= deadline:
                raise self.hung(timeout_s)
        answer: tuple[Any, ...] = pipe.recv()
        return answer

    def crashed(self) -> WorkError:
        """What to tell when the process ended by itself."""
        return WorkError(
            f"The OpenNI2 runtime crashed while it was using the {self._source}; what was saved is safe.",
            _ADVICE[self._source],
        )

    def hung(self, seconds: float) -> WorkError:
        """What to tell when the process is there but does nothing."""
        return WorkError(
            f"The {self._source} did not answer for {seconds:.0f} seconds.", _ADVICE[self._source]
        )

    def _started(self) -> Connection:
        if self._process is not None:
            if self._process.alive:
                return self._process.pipe
            raise EOFError  # it ended since the last request: that is told once, then a new one is started
        from devices.openni.worker import serve

        self._process = ChildProcess(serve, "geoderm-openni2")
        return self._process.pipe

    def stop(self, patience_s: float = 1.0) -> None:
        """End the process and wait for it: no zombie stays behind."""
        with self._lock:
            process, self._process = self._process, None
            if process is not None:
                process.end(patience_s)
