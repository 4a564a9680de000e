"""How long work reports progress and learns that it was cancelled, without knowing of any window."""

from __future__ import annotations

from typing import Protocol

from core.errors import Cancelled


class Progress(Protocol):
    """What a long computation calls now and then.

    ``__call__`` raises `core.errors.Cancelled` when the user has asked to stop.
    """

    def __call__(self, fraction: float, message: str = "") -> None:
        """Report ``fraction`` in 0..1 and what is being done."""


def no_progress(fraction: float, message: str = "") -> None:
    """Report to nobody."""


class ScaledProgress:
    """A part of a larger progress bar: maps 0..1 onto ``start..end`` of ``parent``."""

    def __init__(self, parent: Progress, start: float, end: float) -> None:
        self._parent, self._start, self._end = parent, start, end

    def __call__(self, fraction: float, message: str = "") -> None:
        """Report to the parent."""
        self._parent(self._start + (self._end - self._start) * min(max(fraction, 0.0), 1.0), message)


__all__ = ["Cancelled", "Progress", "ScaledProgress", "no_progress"]
