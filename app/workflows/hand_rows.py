"""Recorded sequences of hands as a row of frames that can be gone through in any order. No Qt."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.capture import read_capture
from core.capture.rgbd import CameraRig, RgbdCapture
from core.errors import InputError, WorkError
from core.hand.dataset import dataset_frames
from core.hand.stills import still_depth
from devices.live import LiveFrame
from devices.recordings.sources import NOMINAL_PERIOD_S, SEQUENCE_FILE, OniSource

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HandShot:
    """One frame of a hand, recorded or live.

    Attributes
    ----------
    number : int
        Place in the sequence from 0, or the camera's own count.
    name : str
        As tracks.json names it.
    time_s : float
        From the beginning of the sequence; a live camera's own clock.
    depth : ndarray (h, w) uint16
    depth_unit_m : float
    rgb : ndarray (h', w', 3) uint8 or None
    rig : CameraRig
    folder : Path or None
        Capture folder it was read from.
    fused_m : ndarray (h, w) or None
        Depth of all frames of a capture in metres, where there are several of a still hand.
    """

    number: int
    name: str
    time_s: float
    depth: NDArray[np.uint16]
    depth_unit_m: float
    rgb: NDArray[np.uint8] | None
    rig: CameraRig
    folder: Path | None = None
    fused_m: FloatArray | None = None

    @property
    def depth_m(self) -> FloatArray:
        """Depth in metres, 0 for no measurement."""
        return self.depth * np.float64(self.depth_unit_m) if self.fused_m is None else self.fused_m

    def capture(self) -> RgbdCapture:
        """The frame as a capture that can be stored."""
        rgb, rig = self.rgb, self.rig
        if rgb is None and rig.color is not None:
            rig = CameraRig(rig.depth)
        return RgbdCapture(self.depth[None], self.depth_unit_m, rig, rgb, view="hand", stance="hand")


class HandRow(Protocol):
    """A recorded sequence."""

    @property
    def path(self) -> Path:
        """Where it is."""

    @property
    def count(self) -> int:
        """How many frames there are."""

    @property
    def folder(self) -> Path | None:
        """The dataset it is; None if frames have no folders of their own."""

    def time_s(self, number: int) -> float:
        """When a frame was taken, from the beginning."""

    def read(self, number: int) -> HandShot:
        """A frame.

        Raises
        ------
        InputError
            If it is damaged.
        """

    def close(self) -> None:
        """Let go of the file."""


def open_row(path: Path) -> HandRow:
    """The sequence at a path: a folder of capture folders, a capture folder or an ``.oni`` file.

    Raises
    ------
    InputError
        If it is none.
    """
    if path.is_file():
        return OniRow(path)
    return FolderRow(path)


class FolderRow:
    """A folder of capture folders in name order; each capture is one frame.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path, self._frames = path, dataset_frames(path)
        self._times = _recorded_times(path, self._frames)

    @property
    def path(self) -> Path:
        """Where it is."""
        return self._path

    @property
    def count(self) -> int:
        """How many frames there are."""
        return len(self._frames)

    @property
    def folder(self) -> Path | None:
        """The dataset it is."""
        return self._path

    def time_s(self, number: int) -> float:
        """When a frame was taken, from the beginning."""
        return self._times[number]

    def read(self, number: int) -> HandShot:
        """A frame."""
        folder = self._frames[number]
        taken = read_capture(folder)
        return HandShot(
            number,
            folder.name,
            self._times[number],
            taken.depth_frames[0],
            taken.depth_unit_m,
            taken.color,
            taken.rig,
            folder,
            still_depth(taken),
        )

    def close(self) -> None:
        """Nothing is held open."""


def _recorded_times(path: Path, frames: list[Path]) -> list[float]:
    """Times from ``sequence.json`` where it tells one for every frame; the nominal pace otherwise."""
    nominal = [k * NOMINAL_PERIOD_S for k in range(len(frames))]
    file = path / SEQUENCE_FILE
    if not file.is_file():
        return nominal
    try:
        listed = json.loads(file.read_text(encoding="utf-8"))["captures"]
        times = {str(entry["folder"]): float(entry["times_s"][0]) for entry in listed}
    except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(
            f"{file}: is not a list of captures with their times.",
            "Take the file away to use a nominal pace.",
        ) from error
    if any(frame.name not in times for frame in frames):
        return nominal
    told = [times[frame.name] for frame in frames]
    forward = all(np.isfinite(told)) and all(b >= a for a, b in pairwise(told))
    return [time - told[0] for time in told] if forward else nominal


class OniRow:
    """An ``.oni`` file. The runtime reads it forward only: going back begins at its beginning again.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._source = OniSource(path)
        facts = self._source.facts()
        self._rig, self._count = facts.rig, facts.frames
        self._stream: Iterator[LiveFrame] | None = None
        self._at = -1
        self._rgb: NDArray[np.uint8] | None = None
        self._first_s: float | None = None

    @property
    def path(self) -> Path:
        """Where it is."""
        return self._path

    @property
    def count(self) -> int:
        """How many frames there are."""
        return self._count

    @property
    def folder(self) -> Path | None:
        """There is none: a file holds all frames."""
        return None

    def time_s(self, number: int) -> float:
        """The nominal pace: the file tells its times only while it is read."""
        return number * NOMINAL_PERIOD_S

    def read(self, number: int) -> HandShot:
        """A frame."""
        if self._stream is None or number <= self._at:
            self._stream, self._at, self._rgb = self._source.frames(), -1, None
        frame: LiveFrame | None = None
        while self._at < number:
            frame = next(self._stream, None)
            if frame is None:
                self._stream = None
                raise WorkError(
                    f"The recording ends at frame {self._at + 1}.",
                    "It may have been cut off while recording.",
                )
            self._at += 1
            self._rgb = frame.rgb if frame.rgb is not None else self._rgb
        if frame is None or frame.depth is None:
            raise WorkError("The recording has no depth.", "Choose a recording of a depth camera.")
        if self._first_s is None:
            self._first_s = frame.time_s - self.time_s(number)
        return HandShot(
            number,
            f"frame_{number + 1:04d}",
            max(frame.time_s - self._first_s, 0.0),
            frame.depth,
            frame.depth_unit_m,
            self._rgb,
            self._rig if self._rgb is not None else CameraRig(self._rig.depth),
        )

    def close(self) -> None:
        """End the runtime's process."""
        self._stream = None
        self._source.close()
