"""The application's side of the drawing process: one for all simulated cameras, started when first needed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from core.errors import Cancelled, InputError, WorkError
from core.progress import Progress, no_progress
from devices.child_process import ChildProcess
from devices.simulator.live_parcel import receive

_POLL_S = 0.05


def _never() -> bool:
    return False


class DrawingProcess:
    """Asks the drawing process and waits for it; from any thread, one request at a time."""

    def __init__(self) -> None:
        self._turn = threading.Lock()
        self._process: ChildProcess | None = None
        self._number = 0
        self._abandoned = False

    @property
    def pid(self) -> int | None:
        """Process id, None while there is none."""
        return None if self._process is None else self._process.pid

    def request(
        self,
        operation: str,
        *,
        progress: Progress = no_progress,
        stop: Callable[[], bool] = _never,
        **arguments: object,
    ) -> Any:
        """Run one operation of the worker and return its value.

        Parameters
        ----------
        operation : str
        progress : callable
        stop : callable
            Asked about twenty times a second; True abandons the request.

        Raises
        ------
        Cancelled
            Through ``progress`` or ``stop``.
        InputError, WorkError
            What the operation raised; `WorkError` also if the process ended.
        """
        while not self._turn.acquire(timeout=_POLL_S):
            if stop():
                raise Cancelled
        try:
            for attempt in (1, 2):
                self._number += 1
                try:
                    pipe = self._started()
                    self._forget(pipe, stop)
                    pipe.send(("request", self._number, operation, arguments))
                    return self._answer(pipe, progress, stop)
                except (EOFError, OSError) as error:
                    self._end()
                    if attempt == 2:
                        raise WorkError(
                            "The simulated patient's drawing process ended unexpectedly.",
                            "Open the simulated camera again.",
                        ) from error
        finally:
            self._turn.release()

    def _forget(self, pipe: Connection, stop: Callable[[], bool]) -> None:
        """Read the rest of an abandoned request: the worker may be blocked in sending its answer."""
        while self._abandoned:
            if not pipe.poll(_POLL_S):
                if stop():
                    raise Cancelled
                continue
            kind, _, *content = pipe.recv()
            if kind == "done":
                receive(pipe, *content)
            self._abandoned = kind == "progress"

    def _answer(self, pipe: Connection, progress: Progress, stop: Callable[[], bool]) -> Any:
        number = self._number
        try:
            while True:
                if not pipe.poll(_POLL_S):
                    if stop():
                        raise Cancelled
                    continue
                kind, _, *content = pipe.recv()
                if kind == "done":
                    return receive(pipe, *content)
                if kind == "progress":
                    progress(*content)
                    if stop():
                        raise Cancelled
                else:
                    is_input, message, advice = content
                    raise (InputError if is_input else WorkError)(message, advice)
        except Cancelled:
            pipe.send(("cancel", number))
            self._abandoned = True
            raise

    def _started(self) -> Connection:
        if self._process is not None and self._process.alive:
            return self._process.pipe
        self._end()
        from devices.simulator.live_worker import serve

        self._process, self._abandoned = ChildProcess(serve, "geoderm-simulator"), False
        return self._process.pipe

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end()

    def end(self) -> None:
        """End the process; a later request starts another."""
        with self._turn:
            self._end()


DRAWING = DrawingProcess()
