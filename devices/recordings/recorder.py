"""Records what a camera sees: as an ``.oni`` file, or as capture folders. Memory stays bounded."""

from __future__ import annotations

import os
import queue
import shutil
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from core.calibration.profile import CalibrationProfile
from core.errors import GeodermError, InputError, WorkError
from core.progress import Progress, no_progress
from devices.live import LiveCamera, LiveFrame
from devices.openni.calibration import NOMINAL_WARNING, calibration_path, write_calibration
from devices.openni.live import OpenNICamera
from devices.openni.oni_layout import inspect_oni
from devices.openni.oni_mend import mend_oni
from devices.recordings.sources import FrameSource
from devices.recordings.targets import (
    FolderTarget,
    OniTarget,
    RecordedRig,
    RecordingTarget,
    unwritable,
)

MAX_WAITING = 60
"""Frames that may wait for the disk; a newer one is left out then, and counted."""

MIN_FREE_BYTES = 100_000_000
_DISK_FULL = "disk nearly full"
_SILENCE_S = 5.0
_FIRST_FRAME_S = 30.0
_LEAST_SHARE, _MOST_LEFT_OUT = 0.8, 10


@dataclass(frozen=True)
class RecordingReport:
    """What became of a recording.

    Attributes
    ----------
    path : Path
    frames : int
        Depth frames kept.
    seconds : float
    left_out : int
        Frames of the camera that were not kept, because this computer or its disk was too slow.
    recorder : str
        ``OpenNI2`` or ``GeoDerm``.
    ended : str
        Why it ended: ``done``, ``stopped``, ``end of the recording``, ``disk nearly full``.
    """

    path: Path
    frames: int
    seconds: float
    left_out: int
    recorder: str
    ended: str


@dataclass(frozen=True)
class Limits:
    """When to end.

    Attributes
    ----------
    seconds : float or None
    frames : int or None
    stop : Event
        Set to end now; what was recorded is complete.
    """

    seconds: float | None
    frames: int | None
    stop: threading.Event

    def reached(self, frames: int, elapsed_s: float) -> bool:
        """Whether one of the limits is reached."""
        return (self.frames is not None and frames >= self.frames) or (
            self.seconds is not None and elapsed_s >= self.seconds
        )

    def share(self, frames: int, elapsed_s: float) -> float:
        """How much of it is done, 0 to 1; 0 without a limit."""
        shares = [
            frames / self.frames if self.frames else 0.0,
            elapsed_s / self.seconds if self.seconds else 0.0,
        ]
        return min(max(shares), 1.0)


def record(
    camera: LiveCamera | FrameSource,
    path: Path,
    limits: Limits,
    progress: Progress = no_progress,
    *,
    burst: int = 30,
    lossy_color: bool = False,
) -> RecordingReport:
    """Record an open live camera, or copy a recording, until a limit is reached.

    Parameters
    ----------
    camera : LiveCamera or FrameSource
        An OpenNI2 camera is recorded by the runtime's own recorder, raw and complete; anything else frame by
        frame as it arrives here.
    path : Path
        ``NAME.oni``, or else a folder that gets a capture folder for each ``burst`` frames.
    limits : Limits
    progress : Progress
    burst : int
    lossy_color : bool
        Store colour as JPEG (``.oni`` only).

    Raises
    ------
    InputError
        If the path exists, or the frames do not fit the format.
    WorkError
        If the camera goes, or the disk is full. What was recorded until then is kept as a complete recording
        and the message says so.
    """
    for file in (path, calibration_path(path), path.with_name(path.name + ".part")):
        if file.exists() or file.is_symlink():
            raise InputError(f"{file}: exists already.", "Choose another name.")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder it would be in does not exist.")
    if path.suffix.lower() == ".oni" and isinstance(camera, OpenNICamera):
        return _record_with_runtime(camera, path, limits, progress, lossy_color)
    about = _about(camera)
    frames = _live_frames(camera, limits.stop) if isinstance(camera, LiveCamera) else camera.frames()
    if path.suffix.lower() == ".oni":
        target: RecordingTarget = OniTarget(path, about, "JPEG" if lossy_color else "NONE")
    else:
        target = FolderTarget(path, about, burst)
    return _pump(frames, target, path, limits, progress, live=isinstance(camera, LiveCamera))


def _about(camera: LiveCamera | FrameSource) -> RecordedRig:
    if isinstance(camera, LiveCamera):
        profile = camera.profile
        return RecordedRig(camera.rig, camera.identity.sensor, profile, profile is None, profile is None)
    facts = camera.facts()
    document = facts.calibration
    return RecordedRig(
        facts.rig,
        facts.sensor,
        None if document is None else CalibrationProfile.from_document(document),
        facts.depth_corrected,
        NOMINAL_WARNING in facts.warnings,
    )


def _live_frames(camera: LiveCamera, stop: threading.Event) -> Iterator[LiveFrame]:
    """Every frame that can be caught from now on, until ``stop`` is set."""
    newest = camera.latest(0, 0.0)
    number = 0 if newest is None else newest.number
    heard_s = time.monotonic() + (0.0 if number else _FIRST_FRAME_S - _SILENCE_S)
    while not stop.is_set():
        frame = camera.latest(number, 0.2)
        if frame is not None:
            number, heard_s = frame.number, time.monotonic()
            yield frame
        elif time.monotonic() - heard_s > _SILENCE_S:
            raise WorkError(
                "The camera has stopped delivering frames.",
                "Check its cable; unplug and reconnect it, then record again.",
            )


def _pump(
    frames: Iterator[LiveFrame],
    target: RecordingTarget,
    path: Path,
    limits: Limits,
    progress: Progress,
    *,
    live: bool,
) -> RecordingReport:
    """Carry frames to the target through a bounded queue, so that a slow disk does not stop the camera."""
    waiting: queue.Queue[tuple[LiveFrame, float] | None] = queue.Queue(MAX_WAITING)
    trouble: list[Exception] = []

    def write() -> None:
        while (item := waiting.get()) is not None:
            if trouble:
                continue
            try:
                target.add(*item)
            except OSError as error:
                trouble.append(unwritable(path, error))
            except Exception as error:  # noqa: BLE001 - raised by the thread that waits for this one
                trouble.append(error)

    writer = threading.Thread(target=write, name="geoderm-recorder", daemon=True)
    writer.start()
    first_s: float | None = None
    taken = left_out = last_number = 0
    elapsed_s = 0.0
    ended = "stopped" if live else "end of the recording"
    failure: BaseException | None = None
    try:
        for frame in frames:
            if trouble or limits.stop.is_set():
                ended = "stopped"
                break
            if frame.depth is None:
                continue
            first_s = frame.time_s if first_s is None else first_s
            elapsed_s = frame.time_s - first_s
            left_out += max(frame.number - last_number - 1, 0) if last_number and live else 0
            last_number = frame.number
            if _free_bytes(path) < MIN_FREE_BYTES:
                ended = _DISK_FULL
                break
            try:
                waiting.put((frame, elapsed_s), block=not live)
                taken += 1
            except queue.Full:
                left_out += 1
            progress(limits.share(taken, elapsed_s), f"{taken} frames")
            if limits.reached(taken, elapsed_s):
                ended = "done"
                break
    except BaseException as error:  # noqa: BLE001 - whatever ends it, the file is completed first
        failure = error
    waiting.put(None)
    writer.join()
    return _close(target, path, (elapsed_s, left_out, ended), trouble, failure)


def _close(
    target: RecordingTarget,
    path: Path,
    told: tuple[float, int, str],
    trouble: list[Exception],
    failure: BaseException | None,
) -> RecordingReport:
    if trouble:
        target.abandon()
        raise trouble[0]
    if not target.frames:
        target.abandon()
        if failure is not None:
            raise failure
        if told[2] == _DISK_FULL:
            raise WorkError(
                f"{path}: nothing was recorded: less than {MIN_FREE_BYTES // 1_000_000} MB are free there.",
                "Free space, or record to another disk.",
            )
        if told[2] == "stopped":
            raise WorkError(f"{path}: stopped before the first frame; nothing was recorded.")
        raise WorkError(f"{path}: no frame was recorded.", "Check that the camera delivers depth.")
    try:
        target.complete()
    except OSError as error:
        raise unwritable(path, error) from error
    if isinstance(failure, GeodermError):
        raise WorkError(
            f"{failure.message} The {target.frames} frames until then are kept in {path}.", failure.advice
        ) from failure
    if failure is not None:
        raise failure
    seconds, left_out, ended = told
    return RecordingReport(path, target.frames, seconds, left_out, "GeoDerm", ended)


def _free_bytes(path: Path) -> int:
    try:
        return shutil.disk_usage(path.parent).free
    except OSError:
        return MIN_FREE_BYTES


def _record_with_runtime(
    camera: OpenNICamera, path: Path, limits: Limits, progress: Progress, lossy_color: bool
) -> RecordingReport:
    """The runtime records inside its own process; here is only watched when to stop."""
    partial = path.with_name(path.name + ".part")
    about = _about(camera)
    first = camera.latest(0, _SILENCE_S)
    if first is None:
        raise WorkError("The camera delivers no frames.", "Unplug and reconnect it, then record again.")
    if limits.reached(0, 0.0):
        raise InputError("A recording needs at least one frame.")
    camera.record_oni(str(partial), lossy_color)
    # The recorder takes its time to begin; what passed until then is not left out of the recording.
    first = camera.latest(0, 0.0) or first
    begun_s, seen, ended = time.monotonic(), first.number, "stopped"
    failure: GeodermError | None = None
    try:
        for frame in _live_frames(camera, limits.stop):
            taken, elapsed_s = frame.number - first.number, time.monotonic() - begun_s
            seen = frame.number
            progress(limits.share(taken, elapsed_s), f"{taken} frames")
            if limits.reached(taken, elapsed_s):
                ended = "done"
                break
            if _free_bytes(path) < MIN_FREE_BYTES:
                ended = _DISK_FULL
                break
    except GeodermError as error:
        failure = error
    try:
        camera.stop_recording()
        whole = _ends(partial)
    except GeodermError:  # the process is gone, and with it the recorder
        whole = False
    kept = _kept(partial, path)
    if not kept[0]:
        raise failure or _incomplete(path, 0)
    try:
        write_calibration(
            path,
            about.rig,
            sensor=about.sensor,
            nominal=about.nominal,
            profile=about.document,
            corrected=about.corrected,
        )
    except OSError as error:
        raise unwritable(calibration_path(path), error) from error
    if failure is not None:
        raise WorkError(
            f"{failure.message} The {kept[0]} frames until then are kept in {path}.", failure.advice
        ) from failure
    left_out = max(seen - first.number - kept[0], 0)
    if not whole or left_out > max(_MOST_LEFT_OUT, (1 - _LEAST_SHARE) * (seen - first.number)):
        raise _incomplete(path, kept[0])
    return RecordingReport(path, kept[0], kept[1], left_out, "OpenNI2", ended)


def _kept(partial: Path, path: Path) -> tuple[int, float]:
    """Depth frames and seconds of what the runtime wrote, made playable and given its name.

    The runtime's process may have died in the middle, and its recorder leaves out what its player needs.
    """
    if not partial.exists():
        return 0, 0.0
    try:
        if not _playable(partial):
            mend_oni(partial, partial)
        summary = inspect_oni(partial)
        depth = summary.stream("depth") or summary.stream("infrared")
    except InputError:
        depth = None
    if depth is None or not depth.frames:
        partial.unlink(missing_ok=True)
        return 0, 0.0
    os.truncate(partial, summary.end)
    partial.replace(path)
    return depth.frames, depth.last_s - depth.first_s


def _incomplete(path: Path, frames: int) -> WorkError:
    """The runtime's recorder does not tell that a disk is full: its file lacks frames, or its end."""
    kept = f" {frames} frames are kept." if frames else ""
    return WorkError(
        f"{path}: the disk did not take the whole recording.{kept}",
        "Check the folder's free space and permissions.",
    )


def _ends(path: Path) -> bool:
    try:
        return inspect_oni(path).end > 0
    except InputError:
        return False


def _playable(path: Path) -> bool:
    try:
        return inspect_oni(path).playable
    except InputError:
        return False
