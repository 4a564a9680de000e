"""Where recorded frames go: into an ``.oni`` file, or into capture folders, with what goes beside them."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture import write_capture
from core.capture.rgbd import CameraRig
from core.errors import WorkError
from devices.burst import Burst, assemble_capture
from devices.live import LiveFrame
from devices.openni.calibration import write_calibration
from devices.openni.oni_file import ColorCodec, OniWriter
from devices.openni.recording import reduced
from devices.recordings.sources import write_sequence

_FINE_UNIT_M = 0.0001


@dataclass(frozen=True)
class RecordedRig:
    """What goes beside the frames."""

    rig: CameraRig
    sensor: str
    profile: CalibrationProfile | None
    corrected: bool
    nominal: bool

    @property
    def document(self) -> dict[str, Any] | None:
        """The profile as it is stored."""
        return None if self.profile is None else self.profile.document()


class RecordingTarget(Protocol):
    """Takes the frames one by one; used by one thread at a time."""

    frames: int

    def add(self, frame: LiveFrame, time_s: float) -> None:
        """Keep a frame; the time is from the beginning of the recording."""

    def complete(self) -> None:
        """No more frames come."""

    def abandon(self) -> None:
        """Leave nothing incomplete behind."""


class OniTarget:
    """An ``.oni`` file of our own writer, its calibration beside it."""

    def __init__(self, path: Path, about: RecordedRig, codec: ColorCodec) -> None:
        self._path, self._about, self._codec = path, about, codec
        self._writer: OniWriter | None = None
        self._rig = about.rig
        self._unit_m = _FINE_UNIT_M
        self.frames = 0

    def add(self, frame: LiveFrame, time_s: float) -> None:
        """Write a frame."""
        if self._writer is None:
            self._begin(frame)
        assert self._writer is not None
        assert frame.depth is not None
        depth = frame.depth
        if abs(frame.depth_unit_m - self._unit_m) > 1e-9:
            fine = np.rint(depth * (frame.depth_unit_m / self._unit_m))
            depth = np.where(fine > 65535, 0, fine).astype(
                np.uint16
            )  # too far for the format: no measurement
        rgb = frame.rgb
        if rgb is not None and self._about.rig.color is not None:
            rgb = reduced(rgb, self._about.rig.color)[0]
        try:
            self._writer.write(depth, rgb if self._rig.color is not None else None, time_s)
        except WorkError:
            self._beside()
            raise
        self.frames += 1

    def _begin(self, frame: LiveFrame) -> None:
        rig = self._about.rig
        if frame.depth_unit_m in (0.001, 0.0001):
            self._unit_m = frame.depth_unit_m
        color = rig.color
        if frame.rgb is None or color is None:
            self._rig = CameraRig(rig.depth)
        else:
            self._rig = CameraRig(rig.depth, reduced(frame.rgb, color)[1], rig.color_from_depth)
        self._writer = OniWriter(
            self._path,
            rig.depth,
            depth_unit_m=self._unit_m,
            color_camera=self._rig.color,
            color_codec=self._codec,
        )

    def complete(self) -> None:
        """Close the file."""
        assert self._writer is not None
        self._writer.close()
        self._beside()

    def _beside(self) -> None:
        if self._path.exists():
            about = self._about
            write_calibration(
                self._path,
                self._rig,
                sensor=about.sensor,
                nominal=about.nominal,
                profile=about.document,
                corrected=about.corrected,
            )

    def abandon(self) -> None:
        """Remove what is not complete."""
        if self._writer is not None:
            self._writer.abandon()


class FolderTarget:
    """Capture folders, one for each burst, with their times beside them."""

    def __init__(self, path: Path, about: RecordedRig, burst: int) -> None:
        self._path, self._about, self._burst = path, about, burst
        self._waiting: list[tuple[LiveFrame, float]] = []
        self._entries: list[dict[str, Any]] = []
        self.frames = 0
        try:
            path.mkdir()
        except OSError as error:
            raise unwritable(path, error) from error

    def add(self, frame: LiveFrame, time_s: float) -> None:
        """Keep a frame until its burst is complete."""
        self._waiting.append((frame, time_s))
        self.frames += 1
        if len(self._waiting) >= self._burst:
            self._write()

    def _write(self) -> None:
        frames = [frame for frame, _ in self._waiting]
        times = [time_s for _, time_s in self._waiting]
        middle = frames[len(frames) // 2]
        colored = [frame for frame in frames if frame.rgb is not None and self._about.rig.has_color]
        nearest = min(colored, key=lambda f: abs(f.color_time_s - middle.time_s), default=None)
        burst = Burst(
            np.stack([frame.depth for frame in frames if frame.depth is not None]),
            frames[0].depth_unit_m,
            np.array([frame.time_s for frame in frames]),
            None if nearest is None else nearest.rgb,
            0.0 if nearest is None else nearest.color_time_s,
        )
        about = self._about
        capture = assemble_capture(
            burst,
            about.rig,
            sensor=about.sensor,
            profile=None if about.corrected else about.profile,
        )
        if about.corrected and about.document is not None:
            capture = replace(capture, calibration=about.document)
        name = f"capture_{len(self._entries) + 1:04d}"
        write_capture(capture, self._path / name)
        color_s = None if nearest is None else times[0] + nearest.color_time_s - frames[0].time_s
        self._entries.append({"folder": name, "times_s": times, "color_time_s": color_s})
        self._waiting.clear()
        write_sequence(self._path, self._entries, nominal=about.nominal)

    def complete(self) -> None:
        """Write the last, shorter burst."""
        if self._waiting:
            self._write()

    def abandon(self) -> None:
        """The complete captures stay; without any, nothing does."""
        if not self._entries:
            shutil.rmtree(self._path, ignore_errors=True)


def unwritable(path: Path, error: OSError) -> WorkError:
    """What to tell about a file that cannot be written."""
    return WorkError(
        f"{path}: could not be written ({error.strerror}).", "Check the folder's free space and permissions."
    )
