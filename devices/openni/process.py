"""The application's side of the runtime's process: asks, waits a bounded time, and survives its death."""

from __future__ import annotations

import multiprocessing
import time
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from core.errors import WorkError
from core.progress import Progress, no_progress

ANSWER_TIMEOUT_S = 20.0
_RESTART = "Unplug and reconnect the camera, then try again."


class RuntimeProcess:
    """The OpenNI2 runtime in a process of its own, started with the first request.

    Parameters
    ----------
    source : str
        What messages call the source: "camera" or "recording".
    """

    def __init__(self, source: str = "camera") -> None:
        self._source = source
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        return self._process is not None and self._process.is_alive()

    @property
    def pid(self) -> int | None:
        """Process id, for diagnosis."""
        return self._process.pid if self._process is not None else None

    def request(
        self,
        operation: str,
        *,
        timeout_s: float = ANSWER_TIMEOUT_S,
        progress: Progress = no_progress,
        **arguments: object,
    ) -> Any:
        """Run one operation there and return its value.

        Raises
        ------
        WorkError
            What the runtime complained of; or that it crashed; or that it did not answer for ``timeout_s``.
        Cancelled
            Through ``progress``. The process is stopped: a read in flight cannot be taken back.
        """
        pipe = self._started()
        try:
            pipe.send((operation, arguments))
            return self._answer(pipe, timeout_s, progress)
        except (EOFError, BrokenPipeError, ConnectionResetError) as error:
            self.stop()
            raise WorkError(
                f"The OpenNI2 runtime crashed while it was using the {self._source}; what was saved is safe.",
                _RESTART if self._source == "camera" else "The recording may be damaged; choose another.",
            ) from error

    def _answer(self, pipe: Connection, timeout_s: float, progress: Progress) -> Any:
        deadline = time.monotonic() + timeout_s
        try:
            while True:
                if not pipe.poll(min(0.1, max(deadline - time.monotonic(), 0))):
                    if time.monotonic() < deadline:
                        continue
                    raise WorkError(
                        f"The {self._source} did not answer for {timeout_s:.0f} seconds.",
                        _RESTART
                        if self._source == "camera"
                        else "The recording may be damaged; choose another.",
                    )
                kind, *content = pipe.recv()
                if kind == "progress":
                    progress(float(content[0]))
                    deadline = time.monotonic() + timeout_s
                elif kind == "error":
                    raise _Complaint(*content)
                else:
                    return content[0]
        except _Complaint as complaint:
            raise WorkError(complaint.message, complaint.advice) from None
        except BaseException:
            self.stop()
            raise

    def _started(self) -> Connection:
        if self._pipe is not None and self.alive:
            return self._pipe
        self.stop()
        from devices.openni.worker import serve

        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=serve, args=(there,), name="geoderm-openni2", daemon=True)
        process.start()
        there.close()
        self._process, self._pipe = process, here
        return here

    def stop(self) -> None:
        """End the process and wait for it: no zombie stays behind."""
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._process is not None:
            self._process.join(1.0)
            if self._process.is_alive():
                self._process.kill()
                self._process.join(5.0)
            if not self._process.is_alive():
                self._process.close()
            self._process = None


class _Complaint(Exception):
    """An error that the runtime's process reported: it is well, the request was not."""

    def __init__(self, message: str, advice: str) -> None:
        super().__init__(message)
        self.message, self.advice = message, advice
