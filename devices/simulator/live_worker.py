"""What runs in the drawing process: it poses simulated patients and takes their captures.

Drawing holds Python's lock for a tenth of a second at a time, which a window would feel; here nobody does.
Requests are ``("request", number, operation, arguments)`` and ``("cancel", number)``; answers are
``("progress", number, fraction, message)``, ``("done", number, ...)``, ``("cancelled", number)`` and
``("error", number, is_input, message, advice)``.
"""

from __future__ import annotations

import signal
from collections import deque
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from core.errors import Cancelled, GeodermError, InputError
from devices.simulator.live_parcel import send, unpack_patient

if TYPE_CHECKING:
    from core.progress import Progress
    from devices.simulator.patient import SimulatedPatient

IDLE_S = 180.0
"""After so long without a request the process ends; the next request starts another."""

_PATIENTS = 4


def serve(pipe: Connection) -> None:
    """Answer requests until the other side closes the pipe or asks nothing for a long time."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    studio = _Studio()
    waiting: deque[tuple[Any, ...]] = deque()
    try:
        while waiting or pipe.poll(IDLE_S):
            message = waiting.popleft() if waiting else pipe.recv()
            if message[0] == "request":
                _answer(pipe, studio, waiting, *message[1:])
    except (EOFError, OSError):
        pass


def _answer(
    pipe: Connection,
    studio: _Studio,
    waiting: deque[tuple[Any, ...]],
    number: int,
    operation: str,
    arguments: dict[str, Any],
) -> None:
    def report(fraction: float, message: str = "") -> None:
        while pipe.poll():
            waiting.append(pipe.recv())
        if ("cancel", number) in waiting:
            raise Cancelled
        pipe.send(("progress", number, fraction, message))

    try:
        report(0.0)
        value = getattr(studio, operation)(report, **arguments)
    except Cancelled:
        pipe.send(("cancelled", number))
    except GeodermError as error:
        pipe.send(("error", number, isinstance(error, InputError), error.message, error.advice))
    except Exception as error:  # noqa: BLE001 - the renderer's own errors cross as a message
        pipe.send(("error", number, False, f"Drawing failed: {type(error).__name__}: {error}.", ""))
    else:
        send(pipe, ("done", number), value)


class _Studio:
    """The patients who are here."""

    def __init__(self) -> None:
        self._patients: dict[str, SimulatedPatient] = {}

    def admit(self, report: Progress, token: str, shape: str, seed: int, parcel: bytes | None) -> None:
        """Let a patient in: one packed, or the usual one of a shape and seed."""
        from devices.simulator.patient import SimulatedPatient

        while len(self._patients) >= _PATIENTS:
            self._patients.pop(next(iter(self._patients)))
        patient = SimulatedPatient(shape, seed) if parcel is None else unpack_patient(parcel)
        self._patients[token] = patient

    def has(self, report: Progress, token: str) -> bool:
        """Whether that patient is here."""
        return token in self._patients

    def pose(self, report: Progress, token: str, **arguments: Any) -> object:
        """Prepare a stance for the viewfinder, see `prepare_scene`."""
        from devices.simulator.live_geometry import live_rig_of
        from devices.simulator.live_scene import prepare_scene

        patient = self._patients[token]
        return prepare_scene(patient, live_rig=live_rig_of(patient.rig.rig), progress=report, **arguments)

    def capture(self, report: Progress, token: str, **arguments: Any) -> object:
        """Take a capture, see `take_capture`."""
        from devices.simulator.live_scene import take_capture

        return take_capture(self._patients[token], progress=report, **arguments)
