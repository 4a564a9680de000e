"""Writes ``.oni`` recordings that the OpenNI2 runtime plays back, frame by frame.

The layout is that of the runtime's own recorder (file version 1.0.1): a file header, then records, each a
28-byte header, fields and payload, little endian. Depth is stored without loss (codec NONE); colour without
loss or as JPEG.
"""

from __future__ import annotations

import contextlib
import errno
import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Literal, Self

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import InputError, WorkError
from devices.openni import oni_layout as layout

_FILE_VERSION = (1, 0, 1, 0)
_PIXEL_FORMAT = {"depth_1_mm": 100, "depth_100_um": 101, "rgb888": 200}
_NO_TIMESTAMP = 0xFFFFFFFFFFFFFFFF
_MAX_DEPTH = 10_000
_JPEG_QUALITY = 95

ColorCodec = Literal["NONE", "JPEG"]


@dataclass
class _Node:
    """One stream of the file while it is written."""

    id: int
    kind: str
    camera: PinholeCamera
    codec: str
    pixel_format: int
    frame_rate: int
    added_at: int = 0
    seek_entries: list[tuple[int, int]] = field(default_factory=list)  # timestamp, position

    @property
    def bytes_per_frame(self) -> int:
        return self.camera.width * self.camera.height * (2 if self.kind == "depth" else 3)


class OniWriter:
    """An ``.oni`` file that grows with every frame and needs no more memory than one.

    The file has its name only when it is complete; until then it is ``NAME.part``. When the disk is full, the
    frames that fit are kept as a complete recording.

    Parameters
    ----------
    path : Path
        Target.
    depth_camera, color_camera : PinholeCamera
        Only the image size and the field of view fit into the format: principal point, distortion and the
        transform between the cameras belong in a calibration beside the file (`devices.openni.calibration`).
        Without ``color_camera`` there is no colour stream.
    depth_unit_m : float
        0.001 or 0.0001, the two units that the format has.
    frame_rate : int
        Nominal frames per second.
    mirrored : bool
        Stored as the file's mirror flag; the pixels are written as they are.
    color_codec : {"NONE", "JPEG"}

    Raises
    ------
    InputError
        If the format does not have the depth unit.
    WorkError
        If the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        depth_camera: PinholeCamera,
        *,
        depth_unit_m: float = 0.001,
        color_camera: PinholeCamera | None = None,
        frame_rate: int = 30,
        mirrored: bool = False,
        color_codec: ColorCodec = "NONE",
    ) -> None:
        self._path, self._mirrored = path, mirrored
        self._depth = _Node(1, "depth", depth_camera, "NONE", _depth_format(depth_unit_m), frame_rate)
        self._nodes = [self._depth]
        self._color: _Node | None = None
        if color_camera is not None:
            self._color = _Node(2, "color", color_camera, color_codec, _PIXEL_FORMAT["rgb888"], frame_rate)
            self._nodes.append(self._color)
        self._partial = path.with_name(path.name + ".part")
        self._period_us = 1_000_000 // frame_rate
        self._last_timestamp = 0
        try:
            self._stream: BinaryIO = self._partial.open("xb", buffering=0)
            try:
                self._begin()
            except OSError:
                self.abandon()
                raise
        except FileExistsError as error:
            raise InputError(
                f"{self._partial}: exists already: a recording that is being made, or was cut off.",
                "Choose another name.",
            ) from error
        except OSError as error:
            raise self._failed(error) from error

    @property
    def frames(self) -> int:
        """Depth frames written."""
        return len(self._depth.seek_entries)

    def write(
        self,
        depth: NDArray[np.uint16] | None,
        rgb: NDArray[np.uint8] | None = None,
        time_s: float | None = None,
    ) -> None:
        """Add a depth frame, a colour frame, or both of one moment.

        Parameters
        ----------
        depth : ndarray (h, w) uint16 or None
        rgb : ndarray (h', w', 3) uint8 or None
        time_s : float, optional
            Since the beginning of the recording; without it the nominal frame rate is taken.

        Raises
        ------
        InputError
            If a frame does not fit its camera.
        WorkError
            If it cannot be written. The frames before are kept as a complete recording if there are any.
        """
        if time_s is None:
            timestamp = self._last_timestamp + self._period_us
        else:
            timestamp = max(round(time_s * 1e6), self._last_timestamp + 1)
        parts: list[tuple[_Node, bytes]] = []
        if depth is not None:
            parts.append((self._depth, _depth_bytes(depth, self._depth.camera)))
        if rgb is not None:
            if self._color is None:
                raise InputError("This recording was begun without a colour camera.")
            parts.append((self._color, _color_bytes(rgb, self._color)))
        end = self._stream.tell()
        try:
            for node, payload in parts:
                self._frame(node, timestamp, payload)
        except OSError as error:
            self._save_what_fits(end)
            raise self._failed(error) from error
        self._last_timestamp = timestamp

    def close(self) -> None:
        """Complete the file and give it its name.

        Raises
        ------
        InputError
            If no depth frame was written; nothing is left then.
        WorkError
            If it cannot be written.
        """
        if self._stream.closed:
            return
        if not self.frames:
            self.abandon()
            raise InputError("A recording needs at least one depth frame.")
        end = self._stream.tell()
        try:
            self._finish()
        except OSError as error:
            self._save_what_fits(end)
            raise self._failed(error) from error

    def abandon(self) -> None:
        """Give up: nothing is left of the file."""
        with contextlib.suppress(OSError):
            self._stream.close()
        with contextlib.suppress(OSError):
            self._partial.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is None:
            self.close()
        else:
            self.abandon()

    def _failed(self, error: OSError) -> WorkError:
        kept = (
            f" Its first {self.frames} frames are kept."
            if self._path.exists() and self._stream.closed and self.frames
            else ""
        )
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        reason = "the disk is full" if full else str(error.strerror)
        return WorkError(
            f"{self._path}: the recording could not be written ({reason}).{kept}",
            "Check the folder's free space and permissions.",
        )

    def _save_what_fits(self, end: int) -> None:
        """Complete the recording at ``end`` or, if even its tables no longer fit, some frames earlier."""
        while True:
            for node in self._nodes:
                node.seek_entries = [entry for entry in node.seek_entries if entry[1] < end]
            if not self.frames:
                self.abandon()
                return
            try:
                self._stream.truncate(end)
                self._stream.seek(end)
                self._finish()
                return
            except OSError:
                if self._stream.closed:
                    return
                end = max(entry[1] for node in self._nodes for entry in node.seek_entries)

    # --- the format

    def _begin(self) -> None:
        self._file_header()
        for node in self._nodes:
            node.added_at = self._node_added(node)
            self._properties(node)
        for node in self._nodes:
            self._record(layout.NODE_STATE_READY, node.id)
            self._record(layout.DATA_BEGIN, node.id, struct.pack("<IQ", 0, _NO_TIMESTAMP))

    def _finish(self) -> None:
        for node in self._nodes:
            self._record(layout.NODE_REMOVED, node.id, undo=node.added_at)
            position = self._seek_table(node)
            end = self._stream.tell()
            self._stream.seek(node.added_at)
            self._node_added(node, position)
            self._stream.seek(end)
        self._record(layout.END, 0)
        self._stream.seek(0)
        self._file_header()
        os.fsync(self._stream.fileno())
        self._stream.close()
        self._partial.replace(self._path)

    def _write(self, data: bytes) -> None:
        """All of it: an unbuffered file may take less at a time."""
        rest = memoryview(data)
        while rest:
            rest = rest[self._stream.write(rest) :]

    def _file_header(self) -> None:
        self._write(
            layout.FILE_MAGIC + struct.pack("<BBHIQI", *_FILE_VERSION, self._last_timestamp, len(self._nodes))
        )

    def _record(
        self, kind: int, node_id: int, fields: bytes = b"", payload: bytes = b"", undo: int = 0
    ) -> int:
        position = self._stream.tell()
        size = layout.RECORD_HEADER.size + len(fields)
        head = layout.RECORD_HEADER.pack(layout.RECORD_MAGIC, kind, node_id, size, len(payload), undo)
        self._write(head + fields + payload)
        return position

    def _node_added(self, node: _Node, seek_table: int = 0) -> int:
        times = [t for t, _ in node.seek_entries] or [0]
        fields = (
            layout.pack_string({"depth": "Depth", "color": "Image"}[node.kind])
            + struct.pack("<I", layout.NODE_KINDS[node.kind])
            + node.codec.encode("ascii")
            + struct.pack("<IQQQ", len(node.seek_entries), times[0], times[-1], seek_table)
        )
        return self._record(layout.NODE_ADDED, node.id, fields)

    def _properties(self, node: _Node) -> None:
        camera = node.camera
        mode = struct.pack("<III", camera.width, camera.height, node.frame_rate)
        horizontal = 2 * np.arctan(camera.width / 2 / camera.fx)
        vertical = 2 * np.arctan(camera.height / 2 / camera.fy)
        self._int(node, "oniRequiredFrameSize", node.bytes_per_frame)
        self._int(node, "xnIsGenerating", 1)
        if node.kind == "depth":
            self._int(node, "xnDeviceMaxDepth", _MAX_DEPTH)
        self._int(node, "xnSupportedMapOutputModesCount", 1)
        self._general(node, "xnSupportedMapOutputModes", mode)
        self._general(node, "xnMapOutputMode", mode)
        if node.kind == "color":
            self._general(node, "xnSupportedPixelFormats", struct.pack("<I", 1))
            self._int(node, "xnPixelFormat", 1)
        self._int(node, "oniPixelFormat", node.pixel_format)
        self._general(node, "xnFOV", struct.pack("<dd", horizontal, vertical))
        # Without a cropping property the runtime delivers no frames.
        self._general(node, "xnCropping", struct.pack("<IHHHH", 0, 0, 0, camera.width, camera.height))
        self._int(node, "xnMirror", int(self._mirrored))

    def _int(self, node: _Node, name: str, value: int) -> None:
        self._record(layout.INT_PROPERTY, node.id, layout.pack_string(name) + struct.pack("<IQ", 8, value))

    def _general(self, node: _Node, name: str, data: bytes) -> None:
        fields = layout.pack_string(name) + struct.pack("<I", len(data)) + data
        self._record(layout.GENERAL_PROPERTY, node.id, fields)

    def _frame(self, node: _Node, timestamp: int, payload: bytes) -> None:
        fields = struct.pack("<QI", timestamp, len(node.seek_entries) + 1)
        last = node.seek_entries[-1][1] if node.seek_entries else 0
        position = self._record(layout.NEW_DATA, node.id, fields, payload, undo=last)
        node.seek_entries.append((timestamp, position))

    def _seek_table(self, node: _Node) -> int:
        entries = [(0, 0), *node.seek_entries]
        payload = b"".join(struct.pack("<QIQ", timestamp, 0, position) for timestamp, position in entries)
        return self._record(layout.SEEK_TABLE, node.id, payload=payload)


def write_oni_frames(
    path: Path,
    depth_frames: Sequence[NDArray[np.uint16]] | NDArray[np.uint16],
    depth_camera: PinholeCamera,
    *,
    depth_unit_m: float = 0.001,
    color_frames: Sequence[NDArray[np.uint8]] = (),
    color_camera: PinholeCamera | None = None,
    frame_rate: int = 30,
    mirrored: bool = False,
    color_codec: ColorCodec = "NONE",
) -> None:
    """Write depth frames, and colour frames if there are any, as an ``.oni`` file; see `OniWriter`.

    Frame i of both kinds gets the time of depth frame i. Nothing is left if a frame does not fit.
    """
    if len(depth_frames) == 0:
        raise InputError("A recording needs at least one depth frame.")
    if len(color_frames) and color_camera is None:
        raise InputError("Colour frames need a colour camera.")
    with OniWriter(
        path,
        depth_camera,
        depth_unit_m=depth_unit_m,
        color_camera=color_camera if len(color_frames) else None,
        frame_rate=frame_rate,
        mirrored=mirrored,
        color_codec=color_codec,
    ) as writer:
        for index in range(max(len(depth_frames), len(color_frames))):
            writer.write(
                depth_frames[index] if index < len(depth_frames) else None,
                color_frames[index] if index < len(color_frames) else None,
            )


def _depth_format(unit_m: float) -> int:
    for name, unit in (("depth_1_mm", 1e-3), ("depth_100_um", 1e-4)):
        if abs(unit_m - unit) < 1e-9:
            return _PIXEL_FORMAT[name]
    raise InputError(f"A .oni file stores depth in 1 mm or 0.1 mm, not in {unit_m * 1000:g} mm.")


def _depth_bytes(depth: NDArray[np.uint16], camera: PinholeCamera) -> bytes:
    if depth.shape != (camera.height, camera.width) or depth.dtype != np.uint16:
        raise InputError("The depth frames do not fit the depth camera's image size.")
    return np.ascontiguousarray(depth).tobytes()


def _color_bytes(rgb: NDArray[np.uint8], node: _Node) -> bytes:
    if rgb.shape != (node.camera.height, node.camera.width, 3) or rgb.dtype != np.uint8:
        raise InputError("The colour frames do not fit the colour camera's image size.")
    if node.codec == "NONE":
        return np.ascontiguousarray(rgb).tobytes()
    import cv2

    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not done:
        raise WorkError("A colour frame could not be compressed.")
    return data.tobytes()
