"""Writes ``.oni`` recordings that the OpenNI2 runtime plays back.

The layout is that of the runtime's own recorder (file version 1.0.1): a file header, then records, each a
28-byte header, fields and payload, little endian. Depth is stored without loss (codec NONE); colour without
loss or as JPEG.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.errors import InputError, WorkError

_FILE_MAGIC = b"NI10"
_RECORD_MAGIC = 0x0052494E
_RECORD_HEADER = struct.Struct("<IIIIIQ")

_INT_PROPERTY, _GENERAL_PROPERTY = 0x03, 0x06
_NODE_REMOVED, _DATA_BEGIN, _NODE_STATE_READY, _NEW_DATA, _END = 0x07, 0x08, 0x09, 0x0A, 0x0B
_NODE_ADDED = 0x0D
_SEEK_TABLE = 0x0E

_KIND = {"depth": 2, "color": 3}
_PIXEL_FORMAT = {"depth_1_mm": 100, "depth_100_um": 101, "rgb888": 200}
_NO_TIMESTAMP = 0xFFFFFFFFFFFFFFFF
_MAX_DEPTH = 10_000

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
    last_frame_at: int = 0
    seek_entries: list[tuple[int, int]] = field(default_factory=list)  # timestamp, position

    @property
    def bytes_per_frame(self) -> int:
        return self.camera.width * self.camera.height * (2 if self.kind == "depth" else 3)


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
    """Write depth frames, and colour frames if there are any, as an ``.oni`` file.

    Parameters
    ----------
    path : Path
        Target; it appears only when it is complete.
    depth_frames : sequence of ndarray (h, w) uint16
    depth_camera, color_camera : PinholeCamera
        Only the image size and the field of view fit into the format: principal point, distortion and the
        transform between the cameras belong in a calibration beside the file (`devices.openni.calibration`).
    depth_unit_m : float
        0.001 or 0.0001, the two units that the format has.
    color_frames : sequence of ndarray (h, w, 3) uint8
        RGB. Frame i has the time of depth frame i.
    mirrored : bool
        Stored as the file's mirror flag; the pixels are written as they are.

    Raises
    ------
    InputError
        If the frames do not fit the cameras or the format.
    WorkError
        If the file cannot be written.
    """
    nodes = [_depth_node(depth_frames, depth_camera, depth_unit_m, frame_rate)]
    if len(color_frames):
        nodes.append(_color_node(color_frames, color_camera, color_codec, frame_rate))
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as stream:
            _Writer(stream, nodes, mirrored).write(depth_frames, color_frames)
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise WorkError(
            f"{path}: the recording could not be written ({error.strerror}).",
            "Check the folder's free space and permissions.",
        ) from error


def _depth_node(
    frames: Sequence[NDArray[np.uint16]] | NDArray[np.uint16],
    camera: PinholeCamera,
    unit_m: float,
    frame_rate: int,
) -> _Node:
    if len(frames) == 0:
        raise InputError("A recording needs at least one depth frame.")
    for name, unit in (("depth_1_mm", 1e-3), ("depth_100_um", 1e-4)):
        if abs(unit_m - unit) < 1e-9:
            pixel_format = _PIXEL_FORMAT[name]
            break
    else:
        raise InputError(f"A .oni file stores depth in 1 mm or 0.1 mm, not in {unit_m * 1000:g} mm.")
    if any(f.shape != (camera.height, camera.width) or f.dtype != np.uint16 for f in frames):
        raise InputError("The depth frames do not fit the depth camera's image size.")
    return _Node(1, "depth", camera, "NONE", pixel_format, frame_rate)


def _color_node(
    frames: Sequence[NDArray[np.uint8]], camera: PinholeCamera | None, codec: ColorCodec, frame_rate: int
) -> _Node:
    if camera is None:
        raise InputError("Colour frames need a colour camera.")
    if any(f.shape != (camera.height, camera.width, 3) or f.dtype != np.uint8 for f in frames):
        raise InputError("The colour frames do not fit the colour camera's image size.")
    return _Node(2, "color", camera, codec, _PIXEL_FORMAT["rgb888"], frame_rate)


class _Writer:
    def __init__(self, stream: BinaryIO, nodes: list[_Node], mirrored: bool) -> None:
        self._stream, self._nodes, self._mirrored = stream, nodes, mirrored
        self._last_timestamp = 0

    def write(
        self,
        depth_frames: Sequence[NDArray[np.uint16]] | NDArray[np.uint16],
        color_frames: Sequence[NDArray[np.uint8]],
    ) -> None:
        self._file_header()
        for node in self._nodes:
            node.added_at = self._node_added(node)
            self._properties(node)
        for node in self._nodes:
            self._record(_NODE_STATE_READY, node.id)
            self._record(_DATA_BEGIN, node.id, struct.pack("<IQ", 0, _NO_TIMESTAMP))
        period = 1_000_000 // self._nodes[0].frame_rate
        for index in range(max(len(depth_frames), len(color_frames))):
            timestamp = (index + 1) * period
            if index < len(depth_frames):
                self._frame(self._nodes[0], timestamp, np.ascontiguousarray(depth_frames[index]).tobytes())
            if index < len(color_frames):
                self._frame(self._nodes[1], timestamp, self._encode(self._nodes[1], color_frames[index]))
        for node in self._nodes:
            self._record(_NODE_REMOVED, node.id, undo=node.added_at)
            position = self._seek_table(node)
            end = self._stream.tell()
            self._stream.seek(node.added_at)
            self._node_added(node, position)
            self._stream.seek(end)
        self._record(_END, 0)
        self._stream.seek(0)
        self._file_header()

    def _file_header(self) -> None:
        self._stream.write(
            _FILE_MAGIC + struct.pack("<BBHIQI", 1, 0, 1, 0, self._last_timestamp, len(self._nodes))
        )

    def _record(
        self, kind: int, node_id: int, fields: bytes = b"", payload: bytes = b"", undo: int = 0
    ) -> int:
        position = self._stream.tell()
        size = _RECORD_HEADER.size + len(fields)
        self._stream.write(_RECORD_HEADER.pack(_RECORD_MAGIC, kind, node_id, size, len(payload), undo))
        self._stream.write(fields)
        self._stream.write(payload)
        return position

    def _node_added(self, node: _Node, seek_table: int = 0) -> int:
        times = [t for t, _ in node.seek_entries] or [0]
        fields = (
            _string({"depth": "Depth", "color": "Image"}[node.kind])
            + struct.pack("<I", _KIND[node.kind])
            + node.codec.encode("ascii")
            + struct.pack("<IQQQ", len(node.seek_entries), times[0], times[-1], seek_table)
        )
        return self._record(_NODE_ADDED, node.id, fields)

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
        self._record(_INT_PROPERTY, node.id, _string(name) + struct.pack("<IQ", 8, value))

    def _general(self, node: _Node, name: str, data: bytes) -> None:
        self._record(_GENERAL_PROPERTY, node.id, _string(name) + struct.pack("<I", len(data)) + data)

    def _encode(self, node: _Node, rgb: NDArray[np.uint8]) -> bytes:
        if node.codec == "NONE":
            return np.ascontiguousarray(rgb).tobytes()
        done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
        if not done:
            raise WorkError("A colour frame could not be compressed.")
        return data.tobytes()

    def _frame(self, node: _Node, timestamp: int, payload: bytes) -> None:
        fields = struct.pack("<QI", timestamp, len(node.seek_entries) + 1)
        position = self._record(_NEW_DATA, node.id, fields, payload, undo=node.last_frame_at)
        node.last_frame_at = position
        node.seek_entries.append((timestamp, position))
        self._last_timestamp = max(self._last_timestamp, timestamp)

    def _seek_table(self, node: _Node) -> int:
        entries = [(0, 0), *node.seek_entries]
        payload = b"".join(struct.pack("<QIQ", timestamp, 0, position) for timestamp, position in entries)
        return self._record(_SEEK_TABLE, node.id, payload=payload)


def _string(text: str) -> bytes:
    data = text.encode("ascii") + b"\0"
    return struct.pack("<I", len(data)) + data
