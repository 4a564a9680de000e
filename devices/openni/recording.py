"""``.oni`` recordings: played through the real runtime, and a capture saved as one."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.calibration.profile import CalibrationProfile
from core.capture.camera import PinholeCamera
from core.capture.mirror import mirror_camera, mirror_transform, unmirror
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.progress import Progress, no_progress
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import LiveFrame
from devices.openni.calibration import (
    NOMINAL_WARNING,
    nominal_rig,
    picture_path,
    read_calibration,
    write_calibration,
)
from devices.openni.oni_file import write_oni_frames
from devices.openni.oni_layout import inspect_oni
from devices.openni.oni_mend import mend_oni
from devices.openni.process import RuntimeProcess
from devices.openni.ring import FrameRing
from devices.openni.session import StartedStreams

MAX_STREAM_WIDTH = 1600
"""Wider colour frames are not delivered by the runtime when it plays a file (measured: 2048 is too wide)."""

_LONGEST_PATH = 200
_PLAIN_NAME = "recording.oni"


class OniRecording(OpenedByWith):
    """An ``.oni`` file played by the OpenNI2 runtime, frame by frame; none is left out.

    Each capture takes the next frames of the file; at its end the file starts again.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If there is no such file, or it is no ``.oni`` recording or damaged, or the calibration beside it is
        bad.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise InputError(f"{path}: there is no such recording.")
        self._summary = inspect_oni(path)
        if not (self._summary.stream("depth") or self._summary.stream("infrared")):
            raise InputError(
                f"{path}: the recording has no depth stream.", "Choose a recording of a depth camera."
            )
        self._path = path.resolve()
        self._info = DeviceInfo(f"recording:{path}", path.name, "recording", False)
        self._calibration = read_calibration(self._path)
        self._runtime = RuntimeProcess("recording")
        self._ring: FrameRing | None = None
        self._started: StartedStreams | None = None
        self._beside: tempfile.TemporaryDirectory[str] | None = None

    @property
    def info(self) -> DeviceInfo:
        """Which recording this is."""
        return self._info

    @property
    def runtime_pid(self) -> int | None:
        """Process in which the runtime plays it."""
        return self._runtime.pid

    @property
    def sensor(self) -> str:
        """Name of the noise model of the camera that recorded it; empty if unknown."""
        return "" if self._calibration is None else self._calibration.sensor

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration profile that the camera had, if it lies beside the file."""
        return None if self._calibration is None else self._calibration.profile

    @property
    def depth_corrected(self) -> bool:
        """Whether the profile's depth correction is in the frames."""
        return self._calibration is None or self._calibration.corrected

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is less than it should be."""
        known = self._calibration is not None and not self._calibration.nominal
        return () if known else (NOMINAL_WARNING,)

    @property
    def frame_count(self) -> int:
        """Frames of depth, or of infrared without depth, that the file holds."""
        stream = self._summary.stream("depth") or self._summary.stream("infrared")
        return 0 if stream is None else stream.frames

    @property
    def taken_at(self) -> datetime:
        """When the file was written."""
        return datetime.fromtimestamp(self._path.stat().st_mtime, UTC)

    def frame_rig(self) -> CameraRig:
        """Geometry of the frames as `frames` gives them, not mirrored. Opens the recording."""
        rig = self._rig()
        if not self._mirrored:
            return rig
        transform = rig.color_from_depth
        return CameraRig(
            mirror_camera(rig.depth),
            None if rig.color is None else mirror_camera(rig.color),
            None if transform is None else mirror_transform(transform),
        )

    def open(self) -> None:
        """Start the runtime's process at the beginning of the file."""
        if self._ring is not None and self._runtime.alive:
            return
        self.close()
        try:
            self._runtime.request("open", address=str(self._playable()), is_file=True)
            self._started = self._runtime.request("start", kinds=None)
            self._ring = FrameRing.attach(self._started.layout, self._started.ring)
        except BaseException:
            self.close()
            raise

    def _playable(self) -> Path:
        """The file, or what stands for it where the runtime's player would not take it.

        A copy that has what the player needs and its recorder may leave out; a link to a file whose path has
        other letters than ASCII, at which the player crashes, or is longer than it can hold.
        """
        name = str(self._path)
        speakable = name.isascii() and len(name) < _LONGEST_PATH
        if self._summary.playable and speakable:
            return self._path
        if self._beside is None:
            beside = tempfile.TemporaryDirectory(prefix="geoderm-oni-")
            if self._summary.playable:
                _link(self._path, Path(beside.name) / _PLAIN_NAME)
            else:
                mend_oni(self._path, Path(beside.name) / _PLAIN_NAME)
            self._beside = beside
        return Path(self._beside.name) / _PLAIN_NAME

    def close(self) -> None:
        """End the process."""
        if self._ring is not None:
            self._ring.close()
            self._ring = None
        self._runtime.stop()

    def frames(self) -> Iterator[LiveFrame]:
        """The frames from here to the end of the file, not mirrored, with the recorded times.

        Depth is as it was recorded: the correction of a profile is applied to captures only.
        """
        while (frame := self._step()) is not None:
            yield _unmirrored(frame) if self._mirrored else frame

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """Return the next ``frames`` depth frames with the colour picture of the same moment."""
        self.open()
        taken = self._take(frames, progress)
        if not taken:
            # The end. Seeking crashes in this runtime: start again by opening again.
            self.close()
            self.open()
            taken = self._take(frames, progress)
        if not taken:
            self.close()
            raise WorkError(f"{self._path}: the recording has no frames.", "Choose another recording.")
        return self._assemble(taken)

    def preview(self) -> PreviewFrame | None:
        """The next frame, at a quarter of the size."""
        self.open()
        taken = self._take(1, no_progress)
        if not taken:
            return None
        frame = taken[0]
        assert frame.depth is not None
        depth = frame.depth[::2, ::2].astype(np.float32) * frame.depth_unit_m
        return PreviewFrame(depth, None if frame.rgb is None else frame.rgb[::2, ::2])

    def _take(self, frames: int, progress: Progress) -> list[LiveFrame]:
        taken: list[LiveFrame] = []
        while len(taken) < frames:
            progress(len(taken) / frames, "Reading depth frames")
            frame = self._step()
            if frame is None:
                break
            if frame.depth is None:
                raise WorkError(
                    f"{self._path}: the recording has no depth stream.",
                    "An infrared recording serves calibration only.",
                )
            taken.append(frame)
        return taken

    def _step(self) -> LiveFrame | None:
        self.open()
        assert self._ring is not None
        number = self._runtime.request("step")
        if number is None:
            return None
        frame = self._ring.read(number - 1)
        still = None if self._calibration is None else self._calibration.picture
        # The colour camera of the rig is the one that took the still: the stream's pictures are not its.
        return frame if still is None or frame is None else replace(frame, rgb=still)

    @property
    def _mirrored(self) -> bool:
        started = self._started
        return started is not None and any(
            info.mirrored for kind, info in started.infos.items() if kind != "color"
        )

    def _rig(self) -> CameraRig:
        """Geometry of the frames as they lie in the file."""
        self.open()
        assert self._started is not None
        infos = self._started.infos
        depth = infos.get("depth") or infos["infrared"]
        color = infos.get("color")
        if self._calibration is None:
            return nominal_rig(depth, color)
        rig = self._calibration.rig
        if (rig.depth.width, rig.depth.height) != (depth.width, depth.height):
            raise InputError(f"{self._path}: the calibration beside it is for another depth image size.")
        if self._calibration.picture is not None or rig.color is None:
            return rig
        if color is None:
            return CameraRig(rig.depth)
        if (color.width, color.height) != (rig.color.width, rig.color.height):
            raise InputError(f"{self._path}: the calibration beside it is for another colour image size.")
        return rig

    def _assemble(self, taken: list[LiveFrame]) -> RgbdCapture:
        rig, profile = self._rig(), self.profile
        picture = next((frame.rgb for frame in taken if frame.rgb is not None), None)
        if self._calibration is not None and self._calibration.picture is not None:
            picture = self._calibration.picture
        if picture is None or rig.color is None:
            picture, rig = None, CameraRig(rig.depth)
        unit_m = taken[0].depth_unit_m
        depth = np.stack([frame.depth for frame in taken if frame.depth is not None])
        if profile is not None and self._calibration is not None and not self._calibration.corrected:
            depth = profile.depth_correction.apply(depth, unit_m)
        capture = RgbdCapture(
            depth_frames=depth,
            depth_unit_m=unit_m,
            rig=rig,
            color=picture,
            taken_at=self.taken_at,
            mirrored=self._mirrored,
            warnings=self.warnings,
            sensor=self.sensor,
            calibration=None if profile is None else profile.document(),
        )
        return unmirror(capture) if capture.mirrored else capture


def _link(path: Path, link: Path) -> None:
    try:
        try:
            link.symlink_to(path)
        except OSError:  # Windows allows links to few people only
            shutil.copyfile(path, link)
    except OSError as error:
        raise WorkError(
            f"{path}: could not be copied to {link.parent} ({error.strerror}).",
            "Move the recording to a short path without accented letters, or free space.",
        ) from error


def _unmirrored(frame: LiveFrame) -> LiveFrame:
    return replace(
        frame,
        depth=None if frame.depth is None else np.ascontiguousarray(frame.depth[:, ::-1]),
        rgb=None if frame.rgb is None else np.ascontiguousarray(frame.rgb[:, ::-1]),
        infrared=None if frame.infrared is None else np.ascontiguousarray(frame.infrared[:, ::-1]),
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
        color, camera = reduced(color, camera)
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
        write_calibration(
            path,
            capture.rig,
            picture,
            sensor=capture.sensor,
            nominal=NOMINAL_WARNING in capture.warnings,
            profile=capture.calibration,
        )
    except OSError as error:
        for file in (path, picture_path(path)):
            file.unlink(missing_ok=True)
        raise WorkError(f"{path}: the calibration could not be written ({error.strerror}).") from error


def reduced(rgb: NDArray[np.uint8], camera: PinholeCamera) -> tuple[NDArray[np.uint8], PinholeCamera]:
    """A picture and its camera, made small enough for the format by averaging blocks of pixels."""
    factor = int(np.ceil(camera.width / MAX_STREAM_WIDTH))
    if factor <= 1:
        return rgb, camera
    import cv2

    smaller = PinholeCamera(
        camera.width // factor,
        camera.height // factor,
        camera.fx / factor,
        camera.fy / factor,
        (camera.cx + 0.5) / factor - 0.5,
        (camera.cy + 0.5) / factor - 0.5,
        camera.distortion,
    )
    size = (smaller.width, smaller.height)
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), smaller
