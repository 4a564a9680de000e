"""The layout of ``.oni`` files, and a look through one that trusts nothing it reads.

The runtime believes what a file says, and a damaged one makes it crash, hang or ask for absurd memory. So a
file is walked record by record before the runtime sees it; only headers and properties are read, no frame.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from core.errors import InputError

FILE_MAGIC = b"NI10"
RECORD_MAGIC = 0x0052494E
RECORD_HEADER = struct.Struct("<IIIIIQ")
FILE_HEADER_BYTES = 24

INT_PROPERTY, REAL_PROPERTY, STRING_PROPERTY, GENERAL_PROPERTY = 0x03, 0x04, 0x05, 0x06
NODE_REMOVED, DATA_BEGIN, NODE_STATE_READY, NEW_DATA, END = 0x07, 0x08, 0x09, 0x0A, 0x0B
NODE_ADDED_OLD, NODE_ADDED, SEEK_TABLE = 0x02, 0x0D, 0x0E

NODE_KINDS = {"depth": 2, "color": 3, "infrared": 5}
_BYTES_PER_PIXEL = {100: 2, 101: 2, 102: 2, 103: 2, 200: 3, 201: 2, 202: 1, 203: 2, 205: 2}

_MAX_FIELDS = 1 << 20
_MAX_SIDE = 8192
_MAX_FRAME_BYTES = 128 << 20
_MAX_NODES = 16
_MAX_RECORDS = 20_000_000
_PLAYABLE_CODECS = ("NONE", "JPEG", "16zT", "16zP", "8zP_", "Im8z", "IZ16")


@dataclass
class OniStream:
    """What a file says about one of its streams.

    Attributes
    ----------
    kind : str
        depth, color, infrared, or "other".
    codec : str
        NONE, JPEG, 16zT ...
    width, height, fps : int
        0 if the file does not tell.
    pixel_format : int
        OpenNI2's number; 0 if the file does not tell.
    frames : int
        Frames found.
    first_s, last_s : float
        Times of the first and the last frame.
    mirrored : bool
    cropping : bool
        Whether the file tells the cropping; the runtime's player delivers no frame of a stream without.
    """

    kind: str
    codec: str
    width: int = 0
    height: int = 0
    fps: int = 0
    pixel_format: int = 0
    frames: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    mirrored: bool = False
    cropping: bool = False
    seek_table: int = 0
    largest: int = 0


@dataclass
class OniSummary:
    """What a file holds.

    Attributes
    ----------
    streams : dict of int to OniStream
        By node number.
    end : int
        Bytes up to the end of the recording. The runtime's recorder may leave much nothing behind it.
    """

    streams: dict[int, OniStream] = field(default_factory=dict)
    end: int = 0

    @property
    def playable(self) -> bool:
        """Whether the runtime's player delivers its frames as it is; else `devices.openni.oni_mend` helps."""
        return all(s.cropping for s in self.streams.values() if s.kind != "other")

    def stream(self, kind: str) -> OniStream | None:
        """The stream of a kind."""
        return next((s for s in self.streams.values() if s.kind == kind), None)


def pack_string(text: str) -> bytes:
    """A string as the format has it."""
    data = text.encode("ascii") + b"\0"
    return struct.pack("<I", len(data)) + data


def inspect_oni(path: Path) -> OniSummary:
    """Look through a recording.

    Raises
    ------
    InputError
        If it is not an ``.oni`` file, is cut off or damaged, or has nothing that can be played.
    """
    try:
        with path.open("rb") as stream:
            return _Inspection(path, stream).run()
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}).") from error


class _Inspection:
    def __init__(self, path: Path, stream: BinaryIO) -> None:
        self._path, self._stream = path, stream
        self._size = stream.seek(0, 2)
        self._summary = OniSummary()

    def run(self) -> OniSummary:
        self._stream.seek(0)
        head = self._stream.read(FILE_HEADER_BYTES)
        if not head.startswith(FILE_MAGIC):
            raise InputError(f"{self._path}: not an OpenNI2 recording.", "Choose a .oni file.")
        position, tables = FILE_HEADER_BYTES, {0}
        for _ in range(_MAX_RECORDS):
            kind, node, fields, payload = self._header(position)
            if kind == END:
                self._summary.end = position + RECORD_HEADER.size + len(fields) + payload
                break
            if kind == SEEK_TABLE:
                tables.add(position)
            self._record(kind, node, fields, payload)
            position += RECORD_HEADER.size + len(fields) + payload
            self._stream.seek(position)
        else:
            raise self._damaged("it does not end")
        self._check(tables)
        return self._summary

    def _header(self, position: int) -> tuple[int, int, bytes, int]:
        head = self._stream.read(RECORD_HEADER.size)
        if len(head) < RECORD_HEADER.size:
            raise self._cut_off()
        magic, kind, node, size, payload, _undo = RECORD_HEADER.unpack(head)
        if magic != RECORD_MAGIC or not RECORD_HEADER.size <= size <= _MAX_FIELDS:
            raise self._damaged(f"no record at byte {position}")
        if payload > _MAX_FRAME_BYTES and kind != SEEK_TABLE:
            raise self._damaged(f"an impossible size at byte {position}")
        if position + size + payload > self._size:
            raise self._cut_off()
        return kind, node, self._stream.read(size - RECORD_HEADER.size), payload

    def _record(self, kind: int, node: int, fields: bytes, payload: int) -> None:
        try:
            if kind == NODE_ADDED:
                self._node_added(node, fields)
            elif kind in (INT_PROPERTY, GENERAL_PROPERTY):
                self._property(node, fields)
            elif kind == NEW_DATA:
                self._frame(node, fields, payload)
        except (struct.error, UnicodeDecodeError) as error:
            raise self._damaged("a record is too short") from error

    def _node_added(self, node: int, fields: bytes) -> None:
        if node in self._summary.streams or len(self._summary.streams) >= _MAX_NODES:
            raise self._damaged("a stream is there twice")
        (length,) = struct.unpack_from("<I", fields)
        if not 0 < length <= 256:
            raise self._damaged("a stream has no name")
        number, codec, _frames, _first, _last, table = struct.unpack_from("<I4sIQQQ", fields, 4 + length)
        kind = next((name for name, n in NODE_KINDS.items() if n == number), "other")
        self._summary.streams[node] = OniStream(
            kind, codec.decode("ascii", errors="replace"), seek_table=table
        )

    def _property(self, node: int, fields: bytes) -> None:
        stream = self._summary.streams.get(node)
        (length,) = struct.unpack_from("<I", fields)
        if stream is None or not 0 < length <= 256:
            raise self._damaged("a property belongs to no stream")
        name = fields[4 : 4 + length].rstrip(b"\0")
        (size,) = struct.unpack_from("<I", fields, 4 + length)
        data = fields[8 + length : 8 + length + size]
        if len(data) != size:
            raise self._damaged("a property is too short")
        if name == b"xnMapOutputMode":
            stream.width, stream.height, stream.fps = struct.unpack("<III", data)
        elif name == b"oniPixelFormat":
            stream.pixel_format = struct.unpack("<Q", data)[0]
        elif name == b"xnCropping":
            stream.cropping = True
        elif name == b"xnMirror":
            stream.mirrored = any(data)
        elif name == b"oniRequiredFrameSize" and struct.unpack("<Q", data)[0] > _MAX_FRAME_BYTES:
            raise self._damaged("a frame would have an impossible size")

    def _frame(self, node: int, fields: bytes, payload: int) -> None:
        stream = self._summary.streams.get(node)
        if stream is None:
            raise self._damaged("a frame belongs to no stream")
        stamp, _number = struct.unpack_from("<QI", fields)
        stream.frames += 1
        stream.last_s = stamp * 1e-6
        stream.first_s = stream.last_s if stream.frames == 1 else stream.first_s
        stream.largest = max(stream.largest, payload)

    def _check(self, tables: set[int]) -> None:
        for stream in self._summary.streams.values():
            if stream.kind == "other":
                continue
            if not (0 < stream.width <= _MAX_SIDE and 0 < stream.height <= _MAX_SIDE):
                raise self._damaged(f"{stream.kind} pictures of {stream.width} x {stream.height}")
            if stream.seek_table not in tables:
                raise self._damaged("a table is not where it should be")
            if stream.codec not in _PLAYABLE_CODECS:
                raise self._damaged(f"the {stream.kind} stream is compressed as '{stream.codec}'")
            room = stream.width * stream.height * _BYTES_PER_PIXEL.get(stream.pixel_format, 3)
            if stream.codec == "NONE" and stream.largest > room:
                raise self._damaged(f"a {stream.kind} frame is larger than its picture")

    def _damaged(self, what: str) -> InputError:
        return InputError(f"{self._path}: the recording is damaged: {what}.", "Choose another recording.")

    def _cut_off(self) -> InputError:
        return InputError(
            f"{self._path}: the recording is cut off; it has no end.", "Copy it again, or record anew."
        )
