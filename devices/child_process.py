"""A process of our own for code that may crash or hang: started, reached by a pipe, ended without a trace."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any


class ChildProcess:
    """A running process and the pipe to it. It ends with the application at the latest.

    Parameters
    ----------
    serve : callable
        Runs in the process with its end of the pipe and ``arguments``; importable by name.
    name : str
        As process lists show it.
    arguments
        Picklable.
    """

    def __init__(self, serve: Callable[..., None], name: str, *arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe: Connection
        self.pipe, there = context.Pipe()
        self._process: BaseProcess = context.Process(
            target=serve, args=(there, *arguments), name=name, daemon=True
        )
        with _deaf_to_interrupt():
            self._process.start()
        there.close()
        self._pid = self._process.pid
        self._ended = False

    @property
    def pid(self) -> int | None:
        """Process id, for diagnosis."""
        return self._pid

    @property
    def alive(self) -> bool:
        """Whether the process runs."""
        try:
            return not self._ended and self._process.is_alive()
        except ValueError:  # closed by another thread this moment
            return False

    @property
    def sentinel(self) -> int:
        """What `multiprocessing.connection.wait` waits for: the end of the process."""
        return self._process.sentinel

    def kill(self) -> None:
        """End the process at once; `end` is still due."""
        with contextlib.suppress(ValueError):
            self._process.kill()

    def finish(self, patience_s: float = 1.0) -> None:
        """Wait for the process, and kill it if it does not go. The pipe stays; `end` is still due."""
        with contextlib.suppress(ValueError):  # ended by another thread meanwhile
            self._process.join(patience_s)
            if self._process.is_alive():
                self._process.kill()
                self._process.join(5.0)

    def end(self, patience_s: float = 1.0) -> None:
        """Close the pipe, which tells the process to go, and `finish` it: no zombie stays behind."""
        self._ended = True
        self.pipe.close()
        self.finish(patience_s)
        with contextlib.suppress(ValueError):
            if not self._process.is_alive():
                self._process.close()


@contextlib.contextmanager
def _deaf_to_interrupt() -> Iterator[None]:
    """What is started inside never hears Ctrl-C; we hear one that comes meanwhile afterwards.

    The process would otherwise die with a traceback while it starts, before it can say that it does not care.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Starting this helper for the first time unblocks the signal again.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
