"""What happens to an error: the world's are told to the user, bugs are logged without data."""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

from core.errors import GeodermError

LOGGER = logging.getLogger("geoderm.failures")

BUG_MESSAGE = "Something went wrong; the visit is saved."
BUG_ADVICE = "Please try again. If it happens again, send the log file to your GeoDerm support."


@dataclass(frozen=True)
class TaskFailure:
    """An error as the user is told of it.

    Attributes
    ----------
    message, advice : str
        What happened and what to do.
    is_bug : bool
        True if it is the application's own error (logged with its trace), False for the world's.
    """

    message: str
    advice: str
    is_bug: bool


def trace_without_data(error: BaseException) -> str:
    """The trace of ``error`` by file, line and function; no message, no values: they may name a patient."""
    lines: list[str] = []
    seen: set[int] = set()
    current: BaseException | None = error
    while current is not None and id(current) not in seen:
        seen.add(id(current))
        lines.append(type(current).__qualname__)
        lines += [f"  {f.filename}:{f.lineno} {f.name}" for f in traceback.extract_tb(current.__traceback__)]
        current = current.__cause__ or current.__context__
    return "\n".join(lines)


def describe_failure(error: BaseException) -> TaskFailure:
    """How to tell the user of ``error``; an error that is not of the world is logged with its trace."""
    if isinstance(error, GeodermError):
        return TaskFailure(error.message, error.advice, is_bug=False)
    LOGGER.error("%s", trace_without_data(error))
    return TaskFailure(BUG_MESSAGE, BUG_ADVICE, is_bug=True)


def install_excepthook(show: Callable[[TaskFailure], None]) -> None:
    """Tell the user of errors that reach the top of the GUI thread, instead of printing a traceback."""

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if issubclass(kind, KeyboardInterrupt | SystemExit):
            sys.__excepthook__(kind, error, trace)
            return
        show(describe_failure(error.with_traceback(trace)))

    sys.excepthook = hook
