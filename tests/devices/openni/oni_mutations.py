"""Damages ``.oni`` files as disks, cables and bad programs do, and judges what playing them does."""

from __future__ import annotations

import os
import re
import struct
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from core.capture.camera import PinholeCamera
from core.errors import GeodermError
from devices.openni import oni_layout as layout
from devices.openni.cameras import OniRecording
from devices.openni.oni_file import OniWriter

SIZE = PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5)
LONGEST_S = 30.0


def write_original(path: Path, frames: int = 4, codec: str = "NONE") -> None:
    """A small recording with depth and colour."""
    rng = np.random.default_rng(1)
    with OniWriter(path, SIZE, color_camera=SIZE, color_codec=codec) as writer:  # type: ignore[arg-type]
        for _ in range(frames):
            depth = rng.integers(500, 4000, (48, 64)).astype(np.uint16)
            writer.write(depth, rng.integers(0, 255, (48, 64, 3)).astype(np.uint8))


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Position, size with payload, and kind of every record of a good file."""
    found, at = [], layout.FILE_HEADER_BYTES
    while at + layout.RECORD_HEADER.size <= len(data):
        magic, kind, _node, size, payload, _undo = layout.RECORD_HEADER.unpack_from(data, at)
        if magic != layout.RECORD_MAGIC:
            break
        found.append((at, size + payload, kind))
        at += size + payload
        if kind == layout.END:
            break
    return found


def flip_bits(data: bytearray, rng: np.random.Generator) -> bytearray:
    """One to fifty bits anywhere."""
    for at in rng.integers(0, len(data), rng.integers(1, 50)):
        data[at] ^= 1 << int(rng.integers(8))
    return data


def flip_headers(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Bytes in headers and properties, where they hurt; the frames stay."""
    places = [at + i for at, _, _ in records(data) for i in range(28, 60)] + list(range(24))
    for at in rng.choice(places, int(rng.integers(1, 8))):
        if at < len(data):
            data[at] = int(rng.integers(256))
    return data


def absurd_sizes(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Sizes, counts and positions of records and properties become extreme numbers."""
    extremes = (0, 1, 0x7F, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, len(data), len(data) * 2)
    found = records(data)
    for _ in range(int(rng.integers(1, 4))):
        at, size, _ = found[int(rng.integers(len(found)))]
        offset = int(rng.choice([12, 16, 20, *range(28, min(max(size - 4, 29), 90))]))
        if at + offset + 4 <= len(data):
            struct.pack_into("<I", data, at + offset, int(rng.choice(extremes)))
    return data


def truncate(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Cut off anywhere."""
    return data[: int(rng.integers(len(data)))]


def truncate_with_end(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Cut off between two records, with a proper end behind it: tables point into nothing."""
    found = records(data)
    at = found[int(rng.integers(1, len(found)))][0]
    end = layout.RECORD_HEADER.pack(layout.RECORD_MAGIC, layout.END, 0, layout.RECORD_HEADER.size, 0, 0)
    return bytearray(data[:at] + end)


def swap_records(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Whole records change places, are repeated, or are missing."""
    pieces = [bytes(data[at : at + size]) for at, size, _ in records(data)]
    for _ in range(int(rng.integers(1, 4))):
        i, j = (int(k) for k in rng.integers(0, len(pieces), 2))
        action = int(rng.integers(3))
        if action == 0:
            pieces[i], pieces[j] = pieces[j], pieces[i]
        elif action == 1:
            pieces.insert(i, pieces[j])
        elif len(pieces) > 2:
            del pieces[i]
    return bytearray(bytes(data[: layout.FILE_HEADER_BYTES]) + b"".join(pieces))


def overwrite_block(data: bytearray, rng: np.random.Generator) -> bytearray:
    """A block of a disk is zeros or noise."""
    at, size = int(rng.integers(len(data))), int(rng.integers(1, 4096))
    noise = rng.integers(0, 256, size, dtype=np.uint8).tobytes() if rng.integers(2) else bytes(size)
    data[at : at + size] = noise[: len(data) - at]
    return data


def change_properties(data: bytearray, rng: np.random.Generator) -> bytearray:
    """Image size, pixel format, codec and frame size say something else."""
    words = (b"xnMapOutputMode\0", b"oniPixelFormat\0", b"oniRequiredFrameSize\0", b"xnCropping\0", b"NONE")
    word = words[int(rng.integers(len(words)))]
    starts = [found.start() for found in re.finditer(re.escape(word), data)]
    if not starts:
        return data
    at = starts[int(rng.integers(len(starts)))]
    if word == b"NONE":
        codecs = (b"16zT", b"JPEG", b"16zP", b"Im8z", b"ABCD", b"\0\0\0\0")
        data[at : at + 4] = codecs[int(rng.integers(len(codecs)))]
        return data
    offset = at + len(word) + 4 + 2 * int(rng.integers(4))
    values = (0, 1, 63, 64, 65, 101, 200, 203, 640, 8191, 65535, 1 << 30)
    struct.pack_into("<I", data, min(offset, len(data) - 4), int(rng.choice(values)))
    return data


MUTATIONS = (
    flip_bits,
    flip_headers,
    absurd_sizes,
    truncate,
    truncate_with_end,
    swap_records,
    overwrite_block,
    change_properties,
)


@dataclass(frozen=True)
class Outcome:
    """What became of a damaged file.

    Attributes
    ----------
    kind : str
        ``refused`` (before the runtime saw it), ``message`` (while it played), ``frames``.
    text : str
    seconds : float
    child_left : bool
        Whether a process stayed behind.
    peak_mib : float
        Memory of the runtime's process at most; 0 if there was none.
    crashed : bool
        Whether the runtime's process crashed or hung: a message for the user all the same.
    """

    kind: str
    text: str
    seconds: float
    child_left: bool
    peak_mib: float
    crashed: bool


def mutate(original: bytes, seed: int) -> tuple[str, bytes]:
    """The damage number ``seed``, and its name."""
    rng = np.random.default_rng(seed)
    damage = MUTATIONS[seed % len(MUTATIONS)]
    return damage.__name__, bytes(damage(bytearray(original), rng))


def play(path: Path) -> Outcome:
    """Play a file to its end. Anything but frames or a message of the application is raised."""
    started = time.monotonic()
    pid, kind, text, peak = None, "frames", "", 0.0
    recording = None
    try:
        recording = OniRecording(path)
        kind = "opened"
        recording.open()
        pid = recording.runtime_pid
        count = 0
        for _frame in recording.frames():
            count += 1
            if count > 100:
                break
        peak = _peak_mib(pid)
        if count:
            kind, text = "frames", f"{count} frames"
        else:
            kind, text = "message", "the recording has no frames"
    except GeodermError as error:
        kind = "refused" if recording is None else "message"
        text = str(error)
    finally:
        if recording is not None:
            recording.close()
    crashed = "crashed" in text or "did not answer" in text
    return Outcome(kind, text, time.monotonic() - started, _alive(pid), peak, crashed)


def _peak_mib(pid: int | None) -> float:
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0.0
    return next((int(s.split()[1]) / 1024 for s in status.splitlines() if s.startswith("VmHWM")), 0.0)


def _alive(pid: int | None) -> bool:
    if pid is None:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
