"""A list of callbacks: how a Qt-free model tells its observers that it changed."""

from __future__ import annotations

from collections.abc import Callable


class Notifier:
    """Calls every connected function, in order of connection, in the caller's thread."""

    def __init__(self) -> None:
        self._callbacks: list[Callable[[], None]] = []

    def connect(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` at every `notify`, until it is disconnected."""
        self._callbacks.append(callback)

    def disconnect(self, callback: Callable[[], None]) -> None:
        """Stop calling ``callback``; unknown callbacks are ignored."""
        self._callbacks = [c for c in self._callbacks if c != callback]

    def notify(self) -> None:
        """Call them all."""
        for callback in tuple(self._callbacks):
            callback()
