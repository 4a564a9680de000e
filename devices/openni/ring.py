"""Frames in memory that two processes share: the newest is always there, and nobody waits for anybody.

The writer fills the slots of a ring in turn and then publishes a number; the reader copies the slot of the
newest number and looks afterwards whether the writer has come round meanwhile. A frame is a slot of the
leading stream (depth, else infrared, else colour) with the numbers of the others' frames that go with it, so
that a picture that serves two depth frames is stored once.
"""

from __future__ import annotations

import contextlib
import secrets
import shutil
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError

if TYPE_CHECKING:  # the runtime's process starts faster without what the application needs
    from devices.live import LiveFrame, StreamKind

SLOTS = 8
KINDS: tuple[StreamKind, ...] = ("depth", "infrared", "color")
"""Streams in the order in which they lead."""

_HEAD = np.dtype([("newest", "u8"), ("heartbeat_s", "f8"), ("arrived_s", "f8"), ("gone", "u8")])
_SLOT = np.dtype([("number", "u8"), ("time_s", "f8"), ("with", "u8", (len(KINDS),))])


@dataclass(frozen=True)
class RingLayout:
    """What lies where.

    Attributes
    ----------
    images : dict of str to (shape, dtype name)
        Of each stream.
    unit_m : float
        Metres per depth step.
    before : int
        Number of the last frame before this ring: numbers go on when the streams are started anew.
    """

    images: Mapping[StreamKind, tuple[tuple[int, ...], str]]
    unit_m: float
    before: int = 0

    @property
    def leader(self) -> StreamKind:
        """The stream whose frames are counted."""
        return next(kind for kind in KINDS if kind in self.images)

    def image_bytes(self, kind: StreamKind) -> int:
        """Bytes of one image of a stream."""
        shape, dtype = self.images[kind]
        return int(np.prod(shape)) * np.dtype(dtype).itemsize

    @property
    def size(self) -> int:
        """Bytes of the whole ring."""
        images = sum(self.image_bytes(kind) for kind in self.images)
        return _HEAD.itemsize + SLOTS * (len(KINDS) * _SLOT.itemsize + images)


class FrameRing:
    """One side of the ring. `create` is for the writer, `attach` for the reader."""

    def __init__(self, layout: RingLayout, memory: SharedMemory) -> None:
        self.layout, self._memory = layout, memory
        buffer = memory.buf
        self._head: NDArray[Any] = np.ndarray((1,), _HEAD, buffer)
        at = _HEAD.itemsize
        self._slots: dict[StreamKind, NDArray[Any]] = {}
        for kind in KINDS:
            self._slots[kind] = np.ndarray((SLOTS,), _SLOT, buffer, at)
            at += SLOTS * _SLOT.itemsize
        self._images: dict[StreamKind, NDArray[Any]] = {}
        for kind, (shape, dtype) in layout.images.items():
            self._images[kind] = np.ndarray((SLOTS, *shape), np.dtype(dtype), buffer, at)
            at += SLOTS * layout.image_bytes(kind)
        self._counts: dict[StreamKind, int] = dict.fromkeys(KINDS, 0)
        self._counts[layout.leader] = layout.before
        self._fence = threading.Lock()

    @classmethod
    def create(cls, layout: RingLayout) -> FrameRing:
        """A new ring."""
        _check_room(layout.size)
        memory = SharedMemory(f"geoderm-{secrets.token_hex(6)}", create=True, size=layout.size)
        ring = cls(layout, memory)
        ring._head["newest"], ring._head["arrived_s"] = layout.before, time.monotonic()
        ring.beat()
        return ring

    @classmethod
    def attach(cls, layout: RingLayout, name: str) -> FrameRing:
        """The ring of the other process. Its name is taken away at once: when both are gone, so is it."""
        memory = SharedMemory(name)
        memory.unlink()
        return cls(layout, memory)

    @property
    def name(self) -> str:
        """What the reader attaches by."""
        return self._memory.name

    def close(self) -> None:
        """Let the memory go."""
        self._head = np.empty(0, _HEAD)
        self._slots.clear()
        self._images.clear()
        self._memory.close()

    def remove(self) -> None:
        """Take the name away, if no reader came to do it."""
        with contextlib.suppress(FileNotFoundError):
            self._memory.unlink()

    # --- the writer's side

    def beat(self) -> None:
        """Say that the writer is well."""
        self._head["heartbeat_s"] = time.monotonic()

    def say_gone(self) -> None:
        """Say that the camera was unplugged."""
        self._head["gone"] = 1

    def put(self, kind: StreamKind, image: NDArray[Any], time_s: float) -> None:
        """Store one image; that of the leading stream is seen only when it is published."""
        number = self._counts[kind] + 1
        slot = number % SLOTS
        self._slots[kind]["number"][slot] = 0
        self._order()
        np.copyto(self._images[kind][slot], image)
        self._slots[kind]["time_s"][slot] = time_s
        self._order()
        self._slots[kind]["number"][slot] = number
        self._counts[kind] = number

    def publish(self) -> None:
        """Make the newest image of the leading stream, with the newest of the others, the newest frame."""
        leader = self.layout.leader
        number = self._counts[leader]
        self._slots[leader]["with"][number % SLOTS] = [self._counts[kind] for kind in KINDS]
        self._order()
        self._head["arrived_s"] = time.monotonic()
        self._head["newest"] = number

    def _order(self) -> None:
        """Taking a lock keeps the processor from reordering what was written before and after."""
        with self._fence:
            pass

    # --- the reader's side

    @property
    def newest(self) -> int:
        """Number of the newest frame; `RingLayout.before` if there is none yet."""
        return int(self._head["newest"][0])

    @property
    def heartbeat_s(self) -> float:
        """When the writer was last known to be well (`time.monotonic`)."""
        return float(self._head["heartbeat_s"][0])

    @property
    def arrived_s(self) -> float:
        """When the last frame was published, or the ring made."""
        return float(self._head["arrived_s"][0])

    @property
    def gone(self) -> bool:
        """Whether the writer said that the camera was unplugged."""
        return bool(self._head["gone"][0])

    def read(self, after: int) -> LiveFrame | None:
        """The newest frame if its number is greater than ``after``."""
        while (number := self.newest) > max(after, self.layout.before):
            self._order()
            frame = self._copy(number)
            if frame is not None:
                return frame
        return None

    def _copy(self, number: int) -> LiveFrame | None:
        """The frame of a number, or None if the writer came round while it was copied."""
        leader = self.layout.leader
        partners = self._slots[leader]["with"][number % SLOTS].copy()
        images: dict[str, NDArray[Any]] = {}
        times: dict[str, float] = {}
        for kind, partner in zip(KINDS, partners.tolist(), strict=True):
            if kind not in self.layout.images or partner == 0:
                continue
            slot = partner % SLOTS
            image = self._images[kind][slot].copy()
            time_s = float(self._slots[kind]["time_s"][slot])
            self._order()
            if int(self._slots[kind]["number"][slot]) != partner:
                if kind == leader:
                    return None
                continue  # the leading stream has stopped, and this picture is no longer the one beside it
            images[kind], times[kind] = image, time_s
        if leader not in images:
            return None
        from devices.live import LiveFrame

        return LiveFrame(
            number,
            times[leader],
            images.get("depth"),
            self.layout.unit_m,
            images.get("color"),
            times.get("color", 0.0),
            images.get("infrared"),
        )


def _check_room(size: int) -> None:
    """Refuse before the system grants memory that is not there, and ends the process when it is used."""
    folder = Path("/dev/shm")
    if folder.is_dir() and shutil.disk_usage(folder).free < size:
        raise WorkError(
            f"There is no room for the camera's pictures in shared memory ({size // 1_000_000} MB).",
            "Choose a smaller mode, close other programs, or enlarge /dev/shm.",
        )
