"""A place for one thing between two threads: the newest wins, nothing queues up."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Newest(Generic[T]):
    """Holds the newest value that was not taken yet."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._value: T | None = None
        self._closed = False

    def put(self, value: T) -> bool:
        """Leave a value; True if the one before it had been taken."""
        with self._condition:
            empty = self._value is None
            self._value = value
            self._condition.notify()
            return empty

    def take(self, timeout_s: float | None = 0.0) -> T | None:
        """Take the value; waits for one at most ``timeout_s`` (None: until there is one, or `close`)."""
        with self._condition:
            if self._value is None and not self._closed and timeout_s != 0.0:
                self._condition.wait_for(lambda: self._value is not None or self._closed, timeout_s)
            value, self._value = self._value, None
            return value

    def close(self) -> None:
        """Let every waiting `take` return None, now and from now on."""
        with self._condition:
            self._closed, self._value = True, None
            self._condition.notify_all()
