"""What runs inside the runtime's own process: it answers requests over a pipe and pumps frames into the ring.

The OpenNI2 runtime can crash or hang natively (seeking does, so does reading a stream that has stopped). In
a process of its own that costs a message, not the consultation. Requests are ``(operation, arguments)``;
answers are ``("done", value)`` or ``("error", kind, message, advice)``.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from multiprocessing import connection
from multiprocessing.connection import Connection

from core.errors import GeodermError, InputError
from devices.openni.session import Session

_MAX_MEMORY_BYTES = 4 << 30
_PUMP_S = 0.05


def serve(pipe: Connection) -> None:
    """Answer requests until the other side closes the pipe, then leave without native clean-up.

    The runtime's own shutdown crashes in some builds when streams were open; nothing is left to lose here.
    """
    # Ctrl-C in a terminal reaches every process; what it means is the application's business.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _bound_memory()
    threading.Thread(target=_leave_with_parent, name="parent-watch", daemon=True).start()
    session = Session()
    try:
        while True:
            if pipe.poll(0.0 if session.streaming else 0.5):
                _answer(session, pipe)
            elif session.streaming:
                session.pump(_PUMP_S)
            session.beat()
    except (EOFError, OSError):
        with contextlib.suppress(Exception):
            session.stop_recording()  # what was recorded until now becomes a complete file
    finally:
        os._exit(0)


def _answer(session: Session, pipe: Connection) -> None:
    operation, arguments = pipe.recv()
    try:
        pipe.send(("done", getattr(session, operation)(**arguments)))
    except GeodermError as error:
        kind = "input" if isinstance(error, InputError) else "work"
        pipe.send(("error", kind, error.message, error.advice))
    except Exception as error:  # noqa: BLE001 - the binding raises bare kinds; all cross as messages
        pipe.send(("error", "work", f"OpenNI2: {_first_line(error)}.", ""))


def _first_line(error: Exception) -> str:
    text = " ".join(
        part.decode(errors="replace") if isinstance(part, bytes) else str(part)
        for part in (error.args or (type(error).__name__,))
        if part is not None
    )
    return (text.strip().splitlines() or [type(error).__name__])[0].rstrip(".")


def _leave_with_parent() -> None:
    """End when the application ends, however it does, even while the runtime hangs."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        # A healthy loop sees the closed pipe as well, and completes a recording first.
        threading.Event().wait(2.0)
        os._exit(0)


def _bound_memory() -> None:
    """A damaged recording may ask for any amount of memory; and a crash need not leave its memory on disk."""
    if os.name != "posix":
        return
    import resource

    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        limit = _MAX_MEMORY_BYTES if hard == resource.RLIM_INFINITY else min(hard, _MAX_MEMORY_BYTES)
        resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
