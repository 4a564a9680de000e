"""RealSense recordings (``.bag``, ``.db3``) as depth cameras of the application."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError
from core.progress import Progress, no_progress
from devices.burst import Burst, assemble_capture
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.camera_process.host import CameraProcess
from devices.camera_process.packets import Packet
from devices.live import LiveState
from devices.realsense.camera import SENSOR, factory_rig
from devices.realsense.playback import PlaybackSource

SUFFIXES = (".bag", ".db3")
_BURST_TIMEOUT_S = 60.0
_MAGIC = {".bag": b"#ROSBAG V2.0", ".db3": b"SQLite format 3\0"}


class RealSenseRecording(OpenedByWith):
    """A recording; each capture takes its next frames, and after the last one it starts again.

    The cameras are those that the recording tells (the factory's calibration at the time).

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        If there is no such file, or it is none of the library's.
    """

    def __init__(self, path: Path) -> None:
        _check_kind(path)
        self._path = path.resolve()
        self._info = DeviceInfo(f"realsense-bag:{path}", path.name, "recording", False)
        self._process = CameraProcess(
            PlaybackSource(str(self._path)), "The recording", "The recording may be damaged; choose another."
        )
        self._rig: CameraRig | None = None
        self._warnings: tuple[str, ...] = ()
        self._unit_m = 0.001

    @property
    def info(self) -> DeviceInfo:
        """Which recording this is."""
        return self._info

    @property
    def pid(self) -> int | None:
        """Process in which the library plays, for diagnosis."""
        return self._process.pid

    def open(self) -> None:
        """Start the library's process and the recording at its beginning."""
        if self._process.state in (LiveState.STREAMING, LiveState.STALLED):
            return
        facts = self._process.open()
        self._rig, warnings = factory_rig(facts)
        self._unit_m = facts["unit_m"]
        if not facts["told_unit"]:
            warnings = (*warnings, "The recording does not tell the unit of its depth; 1 mm was assumed.")
        if facts.get("no_extrinsics"):
            warnings = (
                *warnings,
                "The recording does not tell how its cameras stand to each other; its pictures are left out.",
            )
        self._warnings = warnings

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """The next depth frames with the colour picture of the same moment."""
        packet, warnings = self._burst(frames, progress), self._warnings
        assert self._rig is not None
        depth, rgb = packet.arrays["depth"], packet.arrays.get("rgb")
        if len(depth) < frames:
            warnings = (*warnings, f"The recording ended after {len(depth)} of {frames} frames.")
        seconds = packet.facts["taken_at"] or self._path.stat().st_mtime
        burst = Burst(depth, self._unit_m, np.array(packet.facts["times"]), rgb, packet.facts["color_time"])
        capture = assemble_capture(
            burst,
            self._rig,
            sensor=SENSOR,
            warnings=warnings,
            taken_at=datetime.fromtimestamp(seconds, UTC),
        )
        return replace(capture, view="front")

    def preview(self) -> PreviewFrame | None:
        """The next frame, at half the size."""
        packet = self._burst(1, no_progress)
        depth = packet.arrays["depth"][0][::2, ::2].astype(np.float32) * np.float32(self._unit_m)
        rgb = packet.arrays.get("rgb")
        return PreviewFrame(depth, None if rgb is None else rgb[::4, ::4])

    def close(self) -> None:
        """End the library's process."""
        self._process.close()

    def _burst(self, frames: int, progress: Progress) -> Packet:
        self.open()
        packet: Packet = self._process.request(
            "burst", frames=frames, timeout_s=_BURST_TIMEOUT_S, progress=progress
        )
        return packet


def _check_kind(path: Path) -> None:
    """Refuse what is no recording before the library sees it."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such recording.")
    wanted = _MAGIC.get(path.suffix.lower())
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError as error:
        raise InputError(f"{path}: not readable ({error.strerror}).") from error
    if wanted is None or not head.startswith(wanted):
        raise InputError(f"{path}: not a RealSense recording.", "Choose a .bag or .db3 file.")


class _RealSenseRecordings:
    """Factory of ``realsense-bag:PATH``."""

    def devices(self) -> Sequence[DeviceInfo]:
        """None by themselves."""
        return []

    def create(self, address: str) -> RealSenseRecording:
        """Recording at a path."""
        return RealSenseRecording(Path(address))


REALSENSE_RECORDINGS = _RealSenseRecordings()
