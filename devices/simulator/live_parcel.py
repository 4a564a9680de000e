"""What travels between the application and the drawing process: patients there, pictures back."""

from __future__ import annotations

import io
import pickle
from collections.abc import Mapping
from functools import lru_cache
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from devices.simulator.patient import SimulatedPatient

_PROTOCOL = 5
_CACHE = "_moles_at_visit"


def pack_patient(patient: SimulatedPatient) -> bytes:
    """A patient with everything that makes him, without caches that functions hold."""
    stream = io.BytesIO()
    _PatientPickler(stream, _PROTOCOL).dump(patient)
    return stream.getvalue()


def unpack_patient(parcel: bytes) -> SimulatedPatient:
    """The patient of `pack_patient`, in the same project's other process only."""
    patient: SimulatedPatient = pickle.loads(parcel)
    return patient


class _PatientPickler(pickle.Pickler):
    def reducer_override(self, what: Any) -> Any:
        from devices.simulator.patient import SimulatedPatient

        if isinstance(what, MappingProxyType):
            return _read_only, (dict(what),)
        if type(what) is SimulatedPatient:
            return _revived, ({name: value for name, value in vars(what).items() if name != _CACHE},)
        return NotImplemented


def _read_only(content: dict[Any, Any]) -> Mapping[Any, Any]:
    return MappingProxyType(content)


def _revived(state: dict[str, Any]) -> SimulatedPatient:
    from devices.simulator.patient import SimulatedPatient

    patient = SimulatedPatient.__new__(SimulatedPatient)
    vars(patient).update(state)
    vars(patient)[_CACHE] = lru_cache(maxsize=16)(patient._make_moles)
    return patient


def send(pipe: Connection, head: tuple[Any, ...], value: object) -> None:
    """Send ``value`` behind ``head``; large arrays follow as they lie in memory."""
    buffers: list[pickle.PickleBuffer] = []
    content = pickle.dumps(value, _PROTOCOL, buffer_callback=buffers.append)
    views = [buffer.raw() for buffer in buffers]
    pipe.send((*head, content, [view.nbytes for view in views]))
    for view in views:
        if view.nbytes:
            pipe.send_bytes(view)


def receive(pipe: Connection, content: bytes, sizes: list[int]) -> Any:
    """What `send` sent, after its head has been received; the arrays can be written to."""
    buffers = []
    for size in sizes:
        room = bytearray(size)
        if size:
            pipe.recv_bytes_into(room)
        buffers.append(room)
    return pickle.loads(content, buffers=buffers)
