"""Frames of a sequence for the hand tracker: capture folders in name order, or an ``.oni`` recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.cli.stored_pixels import mirrored_captures
from core.capture.folder import read_capture
from core.capture.rgbd import CameraRig
from core.errors import InputError
from core.hand.dataset import dataset_frames
from core.hand.stills import still_depth


@dataclass(frozen=True, eq=False)
class SequenceFrame:
    """One frame.

    Attributes
    ----------
    name : str
        Of the capture folder; ``frame_000001`` and so on in a recording.
    depth_m : ndarray (h, w)
        0 for no measurement.
    rgb : ndarray (h', w', 3) uint8 or None
    rig : CameraRig
    mirrored : bool
        The pictures are stored mirrored: a stored pixel u is here ``width - 1 - u``.
    """

    name: str
    depth_m: NDArray[np.float64]
    rgb: NDArray[np.uint8] | None
    rig: CameraRig
    mirrored: bool = False

    @property
    def stored_width(self) -> int | None:
        """Width of the picture in which pixels are mirrored as stored; None if they are not mirrored."""
        return self.rig.picture_camera.width if self.mirrored else None


def sequence_frames(path: Path) -> tuple[int, Iterator[SequenceFrame]]:
    """How many frames a sequence has (0: not known before its end), and the frames, read one at a time.

    A capture folder is one frame, also with several depth images (`core.hand.stills`).

    Raises
    ------
    InputError
        If there is no such sequence.
    """
    try:
        recorded = path.is_file()
    except OSError as error:
        raise InputError(f"{str(path)[:300]}: cannot be read ({error.strerror}).") from error
    if recorded:
        return 0, _recorded(path)
    folders = dataset_frames(path)
    return len(folders), _captured(folders)


def capture_name(folder: Path) -> str:
    """The capture's name where it lies: of a link its own, of "." and the like the folder's."""
    return folder.name if folder.name not in ("", "..") else folder.resolve().name


def same_rig(one: CameraRig, other: CameraRig) -> bool:
    """Whether two frames are of the same cameras in the same places."""
    return (
        one.depth == other.depth
        and one.color == other.color
        and np.array_equal(one.picture_from_depth.matrix, other.picture_from_depth.matrix)
    )


def _captured(folders: list[Path]) -> Iterator[SequenceFrame]:
    for folder in folders:
        capture = read_capture(folder)
        mirrored = bool(mirrored_captures(folder, [folder.name]))
        depth_m = still_depth(capture)
        yield SequenceFrame(capture_name(folder), depth_m, capture.color, capture.rig, mirrored)


def _recorded(path: Path) -> Iterator[SequenceFrame]:
    from core.calibration.profile import CalibrationProfile
    from devices.recordings.sources import open_source

    source, number = open_source(path), 0
    try:
        facts = source.facts()
        correction = None
        if facts.calibration is not None and not facts.depth_corrected:
            profile = CalibrationProfile.from_document(facts.calibration, f"{path}: calibration")
            correction = profile.depth_correction

        rig = facts.rig
        for frame in source.frames():
            if frame.depth is None:
                continue
            raw = frame.depth
            if correction is not None:
                raw = correction.apply(raw, frame.depth_unit_m)
            number += 1
            # a recording without colour has the rig of the depth camera alone
            rgb = frame.rgb if rig.has_color else None
            metres = np.asarray(raw * frame.depth_unit_m, dtype=float)
            yield SequenceFrame(f"frame_{number:06d}", metres, rgb, rig)
    finally:
        source.close()
