"""One line on a terminal that says how far a long run is; nothing where nobody watches."""

from __future__ import annotations

import sys
import time
from typing import TextIO

from app.batch.run import Progress

_INTERVAL_S = 0.25


class ProgressLine:
    """Rewrites one line of standard error a few times a second, if that is a terminal."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._shown = self._stream is not None and self._stream.isatty()
        self._last = -1.0
        self._width = 0

    def __call__(self, progress: Progress) -> None:
        """Show how far it is."""
        now = time.monotonic()
        if not self._shown or now - self._last < _INTERVAL_S:
            return
        self._last = now
        self._write(describe(progress))

    def close(self) -> None:
        """Take the line away."""
        if self._width:
            self._write("")
            self._stream.write("\r")
            self._stream.flush()
            self._width = 0

    def _write(self, text: str) -> None:
        self._stream.write("\r" + text.ljust(self._width))
        self._stream.flush()
        self._width = len(text)


def describe(progress: Progress) -> str:
    """How far it is, how fast, and how long it will take."""
    parts = [f"{progress.finished} of {progress.total} pairs"]
    if progress.failed:
        parts.append(f"{progress.failed} failed")
    if progress.rate_hz > 0:
        left_s = (progress.total - progress.finished) / progress.rate_hz
        parts += [f"{progress.rate_hz * 60:.1f} a minute", f"{duration(left_s)} left"]
    parts.append(f"{progress.workers} worker{'' if progress.workers == 1 else 's'}")
    return ", ".join(parts)


def duration(seconds: float) -> str:
    """A time span as people say it, in its two largest units."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    if days:
        return f"{days} d {hours} h"
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
