"""What travels from a camera's own process to the application: arrays in shared memory, the rest by pipe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from multiprocessing.shared_memory import SharedMemory
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from core.errors import GeodermError

_ALIGN = 64


@dataclass(frozen=True, eq=False)
class Packet:
    """Arrays of one moment and what is known about them.

    Attributes
    ----------
    arrays : mapping of str to ndarray
    facts : mapping of str to Any
        Small and picklable.
    """

    arrays: Mapping[str, NDArray[Any]]
    facts: Mapping[str, Any] = field(default_factory=dict)


class CameraSource(Protocol):
    """A camera as its own process sees it. Made in the application, pickled, used in the process only."""

    def open(self) -> Mapping[str, Any]:
        """Open the camera and return what is to be known about it."""

    def read(self, wanted: bool) -> Packet | None:
        """The next moment; None if there was none for a short while. Raise `SourceGone` when it has ended.

        If it is not ``wanted``, it is to be passed over as cheaply as can be, and None returned.
        """

    def request(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Answer a question or change something; a `Packet` is answered through shared memory."""

    def close(self) -> None:
        """Release the camera."""


class SourceGone(GeodermError):
    """The camera was unplugged, or its file has ended."""


@dataclass(frozen=True)
class Placed:
    """Where an array lies in a piece of shared memory."""

    name: str
    dtype: str
    shape: tuple[int, ...]
    offset: int


HEADER_BYTES = _ALIGN
"""Before the arrays of a slot: number of the packet that is, or is being, written there."""


def place(packet: Packet, memory: SharedMemory, start: int, stamp: int) -> list[Placed]:
    """Copy a packet's arrays into the slot at byte ``start``; ``stamp`` is the packet's own number."""
    _stamp(memory, start)[0] = stamp
    placed, offset = [], start + HEADER_BYTES
    for name, array in packet.arrays.items():
        target: NDArray[Any] = np.ndarray(array.shape, array.dtype, memory.buf, offset)
        target[...] = array
        placed.append(Placed(name, array.dtype.str, array.shape, offset))
        offset += _rounded(array.nbytes)
    return placed


def take(
    placed: list[Placed], memory: SharedMemory, start: int, stamp: int
) -> dict[str, NDArray[Any]] | None:
    """Copies of the arrays of a slot; None if another packet has been written over them meanwhile."""
    copies = {p.name: np.ndarray(p.shape, np.dtype(p.dtype), memory.buf, p.offset).copy() for p in placed}
    return copies if int(_stamp(memory, start)[0]) == stamp else None


def slot_bytes(packet: Packet) -> int:
    """Bytes of a slot that holds this packet."""
    return HEADER_BYTES + sum(_rounded(a.nbytes) for a in packet.arrays.values())


def _stamp(memory: SharedMemory, start: int) -> NDArray[np.uint64]:
    return np.ndarray((1,), np.uint64, memory.buf, start)


def _rounded(size: int) -> int:
    return -(-size // _ALIGN) * _ALIGN
