"""The camera's own process: reads the camera without pause and answers the application between pictures."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections import deque
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.shared_memory import SharedMemory
from typing import Any

from core.errors import GeodermError, InputError
from devices.camera_process.packets import CameraSource, Packet, SourceGone, place, slot_bytes

_MEMORY_TIMEOUT_S = 10.0
_SLOTS = 3
_LARGE_BYTES = 16_000_000
_LARGE_SLOTS = 2
_RENEW_S = 0.5


def serve(pipe: Connection, source: CameraSource) -> None:
    """Work for the application until it closes the pipe.

    Messages to the application: ``("opened", facts)``, ``("memory", channel, bytes)``,
    ``("frame", number, start, stamp, places, facts)``, ``("answer", asked, value, places or None)``,
    ``("complaint", asked, is_input, message, advice)``, ``("gone", message, advice)``.
    Messages from it: ``("request", asked, name, arguments)``, ``("memory", name)``, ``("taken", stamp)``,
    ``("close",)``.
    """
    # Ctrl-C reaches the whole group; the application decides what is to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Shared memory is the application's. Opened here it would be noted a second time (Python 3.13 has
    # track=False), and be called leaked if the application clears it away at that very moment.
    resource_tracker.register = lambda name, rtype: None
    worker = _Worker(pipe, source)
    with contextlib.suppress(EOFError, OSError, _ApplicationGone):
        worker.work()
    with contextlib.suppress(GeodermError, OSError, RuntimeError):
        source.close()
    with contextlib.suppress(OSError):
        pipe.close()
    # Native libraries have threads that may hang when the interpreter ends; nothing is left to be saved.
    os._exit(0)


class _ApplicationGone(Exception):
    pass


class _Worker:
    def __init__(self, pipe: Connection, source: CameraSource) -> None:
        self._pipe, self._source = pipe, source
        self._waiting: deque[Any] = deque()
        self._put_s = 0.0
        self._channels = {"stream": _Channel(), "answers": _Channel()}

    def work(self) -> None:
        try:
            self._pipe.send(("opened", dict(self._source.open())))
            number = 0
            while True:
                self._answer_requests()
                packet = self._source.read(self._wanted())
                if packet is not None:
                    number += 1
                    start, stamp, places = self._put("stream", packet)
                    self._put_s = time.monotonic()
                    self._pipe.send(("frame", number, start, stamp, places, dict(packet.facts)))
        except GeodermError as error:
            self._pipe.send(("gone", error.message, error.advice))

    def _wanted(self) -> bool:
        """Whether to take the next moment. Large pictures are decoded and copied only for a taker.

        An untaken one is replaced now and then, so that the first look is not at the distant past.
        """
        stream = self._channels["stream"]
        if stream.slot_bytes < _LARGE_BYTES or stream.taken == stream.written:
            return True
        return time.monotonic() - self._put_s > _RENEW_S

    def _answer_requests(self) -> None:
        while self._waiting or self._pipe.poll(0):
            message = self._waiting.popleft() if self._waiting else self._pipe.recv()
            if message[0] == "close":
                raise _ApplicationGone
            if message[0] == "taken":
                self._channels["stream"].taken = message[1]
            elif message[0] == "request":
                self._answer(*message[1:])

    def _answer(self, asked: int, name: str, arguments: dict[str, Any]) -> None:
        try:
            value = self._source.request(name, arguments)
        except SourceGone:
            raise
        except GeodermError as error:
            is_input = isinstance(error, InputError)
            self._pipe.send(("complaint", asked, is_input, error.message, error.advice))
            return
        if isinstance(value, Packet):
            self._pipe.send(("answer", asked, dict(value.facts), self._put("answers", value)))
        else:
            self._pipe.send(("answer", asked, value, None))

    def _put(self, name: str, packet: Packet) -> tuple[int, int, object]:
        """Copy the packet into the channel's next slot."""
        channel, size = self._channels[name], slot_bytes(packet)
        if channel.memory is None or size > channel.slot_bytes:
            channel.slots = 1 if name == "answers" else _LARGE_SLOTS if size > _LARGE_BYTES else _SLOTS
            channel.slot_bytes, channel.memory = size, None
            channel.memory = self._memory(name, channel.slots * size)
        channel.written += 1
        start = channel.written % channel.slots * channel.slot_bytes
        return start, channel.written, place(packet, channel.memory, start, channel.written)

    def _memory(self, channel: str, size: int) -> SharedMemory:
        """Shared memory of a size; the application makes it, and clears it away whatever happens here."""
        self._pipe.send(("memory", channel, size))
        deadline = time.monotonic() + _MEMORY_TIMEOUT_S
        while time.monotonic() < deadline:
            if self._pipe.poll(0.1):
                message = self._pipe.recv()
                if message[0] == "memory":
                    return SharedMemory(message[1])
                self._waiting.append(message)
        raise _ApplicationGone


class _Channel:
    """Shared memory with slots that are written in turn."""

    def __init__(self) -> None:
        self.memory: SharedMemory | None = None
        self.slots = 1
        self.slot_bytes = 0
        self.written = 0
        self.taken = 0
