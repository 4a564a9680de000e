"""A recording in the place of a camera: played in real time, again and again.

At the end of an ``.oni`` file there is a pause of about a second: the runtime cannot go back in a file
without crashing, so it is started anew.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Collection
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import GeodermError, InputError, WorkError
from core.progress import Progress, no_progress
from devices.burst import assemble_capture, collect_burst
from devices.camera import DEFAULT_FRAMES, DeviceInfo, OpenedByWith, PreviewFrame
from devices.live import (
    DEFAULT_STREAMS,
    STALLED_AFTER_S,
    CameraControl,
    CameraIdentity,
    LiveFrame,
    LiveState,
    StreamKind,
    StreamMode,
)
from devices.recordings.sources import NOMINAL_PERIOD_S, FrameSource, SourceFacts, open_source

LONGEST_GAP_S = 1.0
"""A pause of the recording (between two bursts) is played no longer than this."""


class PlayedCamera(OpenedByWith):
    """A recording as a live camera. Its geometry, depth correction and sensor are those it was made with.

    Parameters
    ----------
    path : Path
        ``.oni`` file, capture folder or folder of capture folders.
    """

    def __init__(self, path: Path) -> None:
        self._source: FrameSource = open_source(path)
        self._path = path
        self._info = DeviceInfo(f"recording:{path}?live", f"{path.name} (played)", "recording", True)
        self._facts: SourceFacts | None = None
        self._news = threading.Condition()
        self._frame: LiveFrame | None = None
        self._arrived_s = 0.0
        self._number = 0
        self._failure: WorkError | None = None
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._streams: frozenset[StreamKind] = frozenset(DEFAULT_STREAMS)

    @property
    def info(self) -> DeviceInfo:
        """Which recording this is."""
        return self._info

    @property
    def identity(self) -> CameraIdentity:
        """A recording has no serial number: nothing can be calibrated with it for later."""
        name = f"recording:{self._path.name}"
        has_color = self._facts is None or self._facts.rig.has_color
        sensor = "" if self._facts is None else self._facts.sensor
        return CameraIdentity("Recording", name, name if has_color else "", sensor, lasting=False)

    @property
    def rig(self) -> CameraRig:
        """Geometry it was recorded with."""
        return self._known().rig

    def _known(self) -> SourceFacts:
        if self._facts is None:
            self._facts = self._source.facts()
            if self._thread is None:
                self._source.close()
        return self._facts

    @property
    def profile(self) -> CalibrationProfile | None:
        """The calibration it was recorded with."""
        document = None if self._facts is None else self._facts.calibration
        return None if document is None else CalibrationProfile.from_document(document)

    def use_profile(self, profile: CalibrationProfile | None) -> None:
        """Refused: a recording keeps the calibration it was made with."""
        if profile is not None:
            raise InputError("A recording keeps the calibration that it was made with.")

    @property
    def state(self) -> LiveState:
        """How the playing is."""
        with self._news:
            if self._failure is not None:
                return LiveState.GONE
            if self._thread is None:
                return LiveState.CLOSED
            silent_s = time.monotonic() - self._arrived_s
        return LiveState.STALLED if silent_s > STALLED_AFTER_S + LONGEST_GAP_S else LiveState.STREAMING

    def open(self) -> None:
        """Begin to play."""
        if self._thread is not None and self._thread.is_alive():
            return
        self.close()
        self._known()
        self._stop.clear()
        self._arrived_s = time.monotonic()
        self._thread = threading.Thread(target=self._play, name="geoderm-playback", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop playing."""
        self._stop.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(30.0)
        self._source.close()
        with self._news:
            self._failure, self._frame = None, None

    def _play(self) -> None:
        try:
            while not self._stop.is_set():
                if not self._play_once():
                    raise WorkError(
                        f"{self._path}: the recording has no frames.", "Choose another recording."
                    )
        except GeodermError as error:
            with self._news:
                self._failure = WorkError(error.message, error.advice)
                self._news.notify_all()

    def _play_once(self) -> int:
        """Play from beginning to end; return how many frames there were."""
        due_s, last_s, count = 0.0, None, 0
        for frame in self._source.frames():
            now = time.monotonic()
            gap = 0.0 if last_s is None else frame.time_s - last_s
            last_s = frame.time_s
            # A computer that was busy goes on from now: it does not rush after what it missed.
            due_s = max(due_s + min(max(gap, 0.0), LONGEST_GAP_S), now - NOMINAL_PERIOD_S)
            if self._stop.wait(max(due_s - now, 0.0)):
                return count + 1
            count += 1
            self._show(frame)
        return count

    def _show(self, frame: LiveFrame) -> None:
        now = time.monotonic()
        with self._news:
            self._number += 1
            wanted = self._streams
            self._frame = replace(
                frame,
                number=self._number,
                time_s=now,
                color_time_s=now + frame.color_time_s - frame.time_s,
                depth=frame.depth if "depth" in wanted else None,
                rgb=frame.rgb if "color" in wanted else None,
                infrared=frame.infrared if "infrared" in wanted else None,
            )
            self._arrived_s = now
            self._news.notify_all()

    def start(self, streams: Collection[StreamKind] = DEFAULT_STREAMS) -> None:
        """Show these kinds from now on."""
        if "color" in streams and not self._known().rig.has_color and set(streams) != set(DEFAULT_STREAMS):
            raise WorkError("This recording has no colour.", "Use another recording.")
        self._streams = frozenset(streams)
        self.open()

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        """The newest frame if its number is greater than ``after``; waits at most ``timeout_s`` for one."""
        with self._news:
            self._news.wait_for(
                lambda: (
                    self._failure is not None
                    or self._thread is None
                    or (self._frame is not None and self._frame.number > after)
                ),
                timeout_s,
            )
            if self._failure is not None:
                raise self._failure
            if self._thread is None:
                raise WorkError("The recording is closed.", "Open it first.")
            frame = self._frame
        if frame is None or frame.number <= after:
            return None
        return replace(
            frame,
            depth=None if frame.depth is None else frame.depth.copy(),
            rgb=None if frame.rgb is None else frame.rgb.copy(),
        )

    def modes(self) -> tuple[StreamMode, ...]:
        """None: a recording runs as it was made."""
        return ()

    def choose_mode(self, mode: StreamMode) -> None:
        """Refused."""
        raise InputError("The modes of a recording cannot be chosen.")

    def controls(self) -> tuple[CameraControl, ...]:
        """None."""
        return ()

    def set_control(self, name: str, value: float) -> None:
        """Refused."""
        raise InputError(f"A recording has no control '{name}'.")

    def capture(self, frames: int = DEFAULT_FRAMES, progress: Progress = no_progress) -> RgbdCapture:
        """The frames that come from now on, and the colour picture nearest to their middle."""
        self.open()
        facts = self._known()
        burst = collect_burst(self.latest, frames, progress)
        capture = assemble_capture(
            burst,
            facts.rig,
            sensor=facts.sensor,
            profile=None if facts.depth_corrected else self.profile,
            warnings=facts.warnings,
            taken_at=datetime.now(UTC),
        )
        return replace(capture, calibration=facts.calibration)

    def preview(self) -> PreviewFrame | None:
        """Newest frame, at a quarter of the size."""
        frame = self.latest()
        if frame is None:
            return None
        depth = frame.depth
        return PreviewFrame(
            None if depth is None else (depth[::2, ::2] * frame.depth_unit_m).astype(np.float32),
            None if frame.rgb is None else frame.rgb[::2, ::2],
        )
