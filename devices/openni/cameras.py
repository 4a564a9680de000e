"""Live OpenNI2 cameras and ``.oni`` recordings as depth cameras of the application."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.mirror import unmirror
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.camera import DEFAULT_FRAMES, DeviceInfo, PreviewFrame
from devices.openni.calibration import (
    NOMINAL_WARNING,
    nominal_rig,
    picture_path,
    read_calibration,
    write_calibration,
)
from devices.openni.oni_file import write_oni_frames
from devices.openni.process import RuntimeProcess
from devices.openni.streams import StreamBatch, StreamInfo

MAX_STREAM_WIDTH = 1600
"""Wider colour frames are not delivered by the runtime when it plays a file (measured: 2048 is too wide)."""

_MIN_FRAMES = 1

Picture = NDArray[np.uint8] | None


class _OpenNISource:
    """What a live camera and a recording share: the runtime's process and the way to a capture."""

    def __init__(self, info: DeviceInfo, address: str, is_file: bool) -> None:
        self._info, self._address, self._is_file = info, address, is_file
        self._runtime = RuntimeProcess("recording" if is_file else "camera")
        self._streams: dict[str, StreamInfo] = {}

    @property
    def info(self) -> DeviceInfo:
        """Which camera this is."""
        return self._info

    def open(self) -> None:
        """Start the runtime's process and the streams."""
        if self._streams and self._runtime.alive:
            return
        try:
            self._streams = self._runtime.request("open", address=self._address, is_file=self._is_file)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the camera and end its process."""
        self._streams = {}
        self._runtime.stop()

    @property
    def runtime_pid(self) -> int | None:
        """Process in which the runtime works for this camera."""
        return self._runtime.pid

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Depth frames and one colour picture of the same moment."""
        batch = self._read(frames, progress)
        if len(batch.depth) < _MIN_FRAMES:
            raise self._no_frames()
        return self._assemble(batch)

    def preview(self) -> PreviewFrame | None:
        """Newest frame, at a quarter of the size."""
        batch = self._read(1, no_progress)
        if not batch.depth:
            return None
        depth = batch.depth[0][::2, ::2].astype(np.float32) * self._streams["depth"].unit_m
        rgb = batch.color[0][::2, ::2] if batch.color else None
        return PreviewFrame(depth, rgb)

    def _read(self, frames: int, progress: Progress) -> StreamBatch:
        self.open()
        batch: StreamBatch = self._runtime.request(
            "read",
            frames=frames,
            color_frames=1,
            progress=lambda fraction, _="": progress(fraction, "Reading depth frames"),
        )
        return batch

    def _no_frames(self) -> WorkError:
        self.close()
        return WorkError(
            "The camera delivers no frames.",
            "Check the cable; unplug and reconnect the camera, then try again.",
        )

    def _rig(
        self, picture: NDArray[np.uint8] | None
    ) -> tuple[CameraRig, NDArray[np.uint8] | None, tuple[str, ...]]:
        color = self._streams.get("color") if picture is not None else None
        return nominal_rig(self._streams["depth"], color), picture, (NOMINAL_WARNING,)

    def _assemble(self, batch: StreamBatch) -> RgbdCapture:
        rig, picture, warnings = self._rig(batch.color[0] if batch.color else None)
        capture = RgbdCapture(
            depth_frames=np.stack(batch.depth),
            depth_unit_m=self._streams["depth"].unit_m,
            rig=rig,
            color=picture,
            view="front",
            taken_at=self._taken_at(),
            mirrored=self._streams["depth"].mirrored,
            warnings=warnings,
        )
        return unmirror(capture) if capture.mirrored else capture

    def _taken_at(self) -> datetime:
        return datetime.now(UTC)


class OpenNICamera(_OpenNISource):
    """A connected camera (Kinect class) through the OpenNI2 runtime.

    Parameters
    ----------
    uri : str
        As the runtime lists it.
    name : str
        For people.
    """

    def __init__(self, uri: str, name: str = "Depth camera") -> None:
        super().__init__(DeviceInfo(f"openni:{uri}", name, "openni", True), uri, is_file=False)


class OniRecording(_OpenNISource):
    """An ``.oni`` file played by the OpenNI2 runtime.

    Each capture takes the next frames of the file; at its end the file starts again.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If there is no such file, or it is no ``.oni`` recording, or the calibration beside it is bad.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError(f"{path}: there is no such recording.")
        _check_complete(path)
        self._path = path.resolve()
        self._calibration = read_calibration(self._path)
        super().__init__(
            DeviceInfo(f"recording:{path}", path.name, "recording", False), str(self._path), is_file=True
        )

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Return the next ``frames`` depth frames with the colour picture of the same moment."""
        batch = self._read(frames, progress)
        if batch.ended and len(batch.depth) < frames:
            # Seeking crashes in this runtime: start again by opening again.
            self.close()
            if not batch.depth:
                batch = self._read(frames, progress)
        if not batch.depth:
            raise self._no_frames()
        self.open()
        return self._assemble(batch)

    def _no_frames(self) -> WorkError:
        self.close()
        return WorkError(f"{self._path}: the recording has no frames.", "Choose another recording.")

    def _taken_at(self) -> datetime:
        return datetime.fromtimestamp(self._path.stat().st_mtime, UTC)

    def _rig(
        self, picture: NDArray[np.uint8] | None
    ) -> tuple[CameraRig, NDArray[np.uint8] | None, tuple[str, ...]]:
        if self._calibration is None:
            return super()._rig(picture)
        rig = self._calibration.rig
        depth = self._streams["depth"]
        if (rig.depth.width, rig.depth.height) != (depth.width, depth.height):
            raise InputError(f"{self._path}: the calibration beside it is for another depth image size.")
        if self._calibration.picture is not None:
            return rig, self._calibration.picture, ()
        if rig.color is None or picture is None:
            return CameraRig(rig.depth), None, ()
        if picture.shape[:2] != (rig.color.height, rig.color.width):
            raise InputError(f"{self._path}: the calibration beside it is for another colour image size.")
        return rig, picture, ()


_HEADER_BYTES = 24
_END_RECORD = bytes.fromhex("4e495200") + (0x0B).to_bytes(4, "little")


def _check_complete(path: Path) -> None:
    """Refuse what the runtime would choke on: foreign and cut-off files."""
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEADER_BYTES)
            stream.seek(0, 2)
            size = stream.tell()
            stream.seek(max(_HEADER_BYTES, size - 64))
            tail = stream.read()
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}).") from error
    if not head.startswith(b"NI10"):
        raise InputError(f"{path}: not an OpenNI2 recording.", "Choose a .oni file.")
    if _END_RECORD not in tail:
        raise InputError(
            f"{path}: the recording is cut off; it has no end.", "Copy it again, or record anew."
        )


def write_oni(capture: RgbdCapture, path: Path) -> None:
    """Save a capture as an ``.oni`` recording with its calibration beside it.

    A colour picture wider than the runtime can play goes beside the file in full size, as an auxiliary
    camera's picture does, and into the file reduced.

    Raises
    ------
    InputError
        If the depth unit does not exist in the format.
    WorkError
        If a file cannot be written.
    """
    color, camera, picture = capture.color, capture.rig.color, None
    if color is not None and camera is not None and camera.width > MAX_STREAM_WIDTH:
        picture = color
        factor = int(np.ceil(camera.width / MAX_STREAM_WIDTH))
        color = np.asarray(
            cv2.resize(
                color, (camera.width // factor, camera.height // factor), interpolation=cv2.INTER_AREA
            ),
            dtype=np.uint8,
        )
        camera = _reduced(camera, factor)
    write_oni_frames(
        path,
        capture.depth_frames,
        capture.rig.depth,
        depth_unit_m=capture.depth_unit_m,
        color_frames=() if color is None else (color,),
        color_camera=camera,
        mirrored=capture.mirrored,
    )
    try:
        write_calibration(path, capture.rig, picture)
    except OSError as error:
        for file in (path, picture_path(path)):
            file.unlink(missing_ok=True)
        raise WorkError(f"{path}: the calibration could not be written ({error.strerror}).") from error


def _reduced(camera: PinholeCamera, factor: int) -> PinholeCamera:
    """The camera of a picture that was reduced by a whole factor, averaging blocks of pixels."""
    return PinholeCamera(
        camera.width // factor,
        camera.height // factor,
        camera.fx / factor,
        camera.fy / factor,
        (camera.cx + 0.5) / factor - 0.5,
        (camera.cy + 0.5) / factor - 0.5,
        camera.distortion,
    )


class _ConnectedCameras:
    """Factory of live cameras."""

    def devices(self) -> Sequence[DeviceInfo]:
        """Cameras that the runtime sees; none if there is no runtime or no camera."""
        runtime = RuntimeProcess()
        try:
            found: list[tuple[str, str]] = runtime.request("list_devices", timeout_s=8.0)
        except WorkError:
            return []
        finally:
            runtime.stop()
        return [DeviceInfo(f"openni:{uri}", name, "openni", True) for uri, name in found]

    def create(self, address: str) -> OpenNICamera:
        """Camera with the runtime's own address."""
        return OpenNICamera(address)


class _Recordings:
    """Factory of recordings: any file a person names."""

    def devices(self) -> Sequence[DeviceInfo]:
        """None by themselves."""
        return []

    def create(self, address: str) -> OniRecording:
        """Recording at a path."""
        return OniRecording(Path(address))


CONNECTED_CAMERAS = _ConnectedCameras()
RECORDINGS = _Recordings()
