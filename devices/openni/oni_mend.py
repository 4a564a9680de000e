"""Makes a playable ``.oni`` file of one that is cut off, or lacks what the runtime's player insists on.

The runtime's recorder writes a stream's cropping only if the driver knows that property, and its player then
delivers no frame of that stream. And a recorder whose process dies leaves a file without tables and end.
Frames are copied as they are; headers, positions and tables are made anew.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from core.errors import InputError, WorkError
from devices.openni import oni_layout as layout

_COPY_BYTES = 1 << 20
_ADDED_TAIL = struct.Struct("<IQQQ")  # frames, first and last time, position of the table


@dataclass
class _Node:
    """A stream of the new file."""

    added_at: int
    fields: bytes
    width: int = 0
    height: int = 0
    cropping: bool = False
    ready: bool = False
    frames: list[tuple[int, int]] = field(default_factory=list)  # time stamp, position


def mend_oni(source: Path, target: Path) -> int:
    """Copy what can be played of ``source`` to a complete file ``target``; return its number of frames.

    Raises
    ------
    InputError
        If ``source`` is not an ``.oni`` recording.
    WorkError
        If ``target`` cannot be written.
    """
    partial = target.with_name(target.name + ".mending")
    try:
        with source.open("rb") as old, partial.open("wb") as new:
            if not old.read(layout.FILE_HEADER_BYTES).startswith(layout.FILE_MAGIC):
                raise InputError(f"{source}: not an OpenNI2 recording.", "Choose a .oni file.")
            frames = _Mending(old, new).run()
        partial.replace(target)
    except OSError as error:
        raise WorkError(
            f"{target}: the recording could not be written ({error.strerror}).",
            "Check the folder's free space and permissions.",
        ) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
    return frames


class _Mending:
    def __init__(self, old: BinaryIO, new: BinaryIO) -> None:
        self._old, self._new = old, new
        self._size = os.fstat(old.fileno()).st_size
        self._nodes: dict[int, _Node] = {}
        self._last_stamp = 0

    def run(self) -> int:
        self._header()
        position = layout.FILE_HEADER_BYTES
        while True:
            self._old.seek(position)
            head = self._old.read(layout.RECORD_HEADER.size)
            if len(head) < layout.RECORD_HEADER.size:
                break
            magic, kind, node, size, payload, _undo = layout.RECORD_HEADER.unpack(head)
            end = position + size + payload
            whole = magic == layout.RECORD_MAGIC and size >= len(head) and end <= self._size
            if not whole or kind == layout.END:
                break
            try:
                self._record(kind, node, self._old.read(size - len(head)), payload)
            except struct.error:
                break  # damaged from here on
            position = end
        return self._finish()

    def _record(self, kind: int, number: int, fields: bytes, payload: int) -> None:
        if kind in (layout.NODE_REMOVED, layout.SEEK_TABLE):
            return  # made anew at the end
        if kind == layout.NODE_ADDED:
            self._nodes[number] = _Node(self._new.tell(), fields)
            self._write(kind, number, fields)
            return
        node = self._nodes.get(number)
        if node is None:
            return
        if kind == layout.GENERAL_PROPERTY:
            self._learn(node, fields)
        if kind in (layout.NODE_STATE_READY, layout.DATA_BEGIN, layout.NEW_DATA):
            self._make_ready(number, node)
        if kind == layout.NEW_DATA:
            (stamp,) = struct.unpack_from("<Q", fields)
            previous = node.frames[-1][1] if node.frames else 0
            node.frames.append((stamp, self._new.tell()))
            self._last_stamp = max(self._last_stamp, stamp)
            self._write(kind, number, fields, payload, previous)
            shutil.copyfileobj(_Part(self._old, payload), self._new, _COPY_BYTES)
        elif payload == 0:
            self._write(kind, number, fields)

    def _learn(self, node: _Node, fields: bytes) -> None:
        (length,) = struct.unpack_from("<I", fields)
        name = fields[4 : 4 + length].rstrip(b"\0")
        if name == b"xnMapOutputMode":
            node.width, node.height = struct.unpack_from("<II", fields, 8 + length)
        node.cropping = node.cropping or name == b"xnCropping"

    def _make_ready(self, number: int, node: _Node) -> None:
        """Before the first frame: the cropping that the player insists on, in the right size."""
        if node.ready:
            return
        node.ready = True
        if not node.cropping:
            whole = struct.pack("<IHHHH", 0, 0, 0, node.width & 0xFFFF, node.height & 0xFFFF)
            name = layout.pack_string("xnCropping")
            self._write(layout.GENERAL_PROPERTY, number, name + struct.pack("<I", len(whole)) + whole)

    def _finish(self) -> int:
        for number, node in self._nodes.items():
            self._write(layout.NODE_REMOVED, number, undo=node.added_at)
            table = self._new.tell()
            entries = [(0, 0), *node.frames]
            data = b"".join(struct.pack("<QIQ", stamp, 0, position) for stamp, position in entries)
            self._write(layout.SEEK_TABLE, number, payload=len(data))
            self._new.write(data)
            end = self._new.tell()
            stamps = [stamp for stamp, _ in node.frames] or [0]
            tail = _ADDED_TAIL.pack(len(node.frames), stamps[0], stamps[-1], table)
            self._new.seek(node.added_at)
            self._write(layout.NODE_ADDED, number, node.fields[: -_ADDED_TAIL.size] + tail)
            self._new.seek(end)
        self._write(layout.END, 0)
        self._new.seek(0)
        self._header()
        leading = next((n for n in self._nodes.values() if n.frames), None)
        return 0 if leading is None else len(leading.frames)

    def _header(self) -> None:
        self._new.write(
            layout.FILE_MAGIC
            + struct.pack("<BBHIQI", 1, 0, 1, 0, self._last_stamp, max(self._nodes, default=0))
        )

    def _write(self, kind: int, node: int, fields: bytes = b"", payload: int = 0, undo: int = 0) -> None:
        size = layout.RECORD_HEADER.size + len(fields)
        self._new.write(
            layout.RECORD_HEADER.pack(layout.RECORD_MAGIC, kind, node, size, payload, undo) + fields
        )


class _Part:
    """The next bytes of a file as a file of their own."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self._stream, self._left = stream, size

    def read(self, size: int = -1) -> bytes:
        data = self._stream.read(self._left if size < 0 else min(size, self._left))
        self._left -= len(data)
        return data
