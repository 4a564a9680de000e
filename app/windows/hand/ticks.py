"""What the engine tells the window: frames as they are shown, sources, failures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from app.tasks import TaskFailure
from app.widgets.hand_mesh import HandMesh
from app.workflows.hand_rows import HandShot
from app.workflows.hand_skin import FrameSkin

if TYPE_CHECKING:
    from core.hand.answer import HandAnswer


@dataclass(frozen=True, eq=False)
class Tick:
    """One frame as the window shows it.

    Attributes
    ----------
    shot : HandShot
    image : QImage
        In the picture's own pixels.
    answer : HandAnswer or None
        None without a model, and while training.
    skin : FrameSkin or None
        Measured while training, and to show the marker where there is no model.
    anchors_px : ndarray (a, 2)
    anchors_kind : str
    mesh : HandMesh or None
        None if it was not worth preparing one for this frame.
    rate_hz : float
        Frames per second of late.
    live : bool
    """

    shot: HandShot
    image: QImage
    answer: HandAnswer | None
    skin: FrameSkin | None
    anchors_px: NDArray[np.float64]
    anchors_kind: str
    mesh: HandMesh | None
    rate_hz: float
    live: bool

    @property
    def anchors_seen(self) -> bool:
        """Whether the anchors were found in this very frame."""
        if self.answer is not None:
            return self.answer.marker_seen
        return self.skin is not None and self.skin.seen

    @property
    def reason(self) -> str:
        """What is wrong, for people; empty if nothing is."""
        if self.answer is not None:
            return self.answer.reason or ""
        return "" if self.skin is None else self.skin.reason


@dataclass(frozen=True)
class Opened:
    """A source that was opened: its number of frames (0: live) and the folder of its captures."""

    frames: int
    folder: Path | None

    @property
    def live(self) -> bool:
        """Whether it sees the present."""
        return self.frames == 0


def told(failure: TaskFailure) -> TaskFailure:
    """A failure in the words of this window: there is no visit here that could be saved."""
    if not failure.is_bug:
        return failure
    return TaskFailure(
        "Something went wrong. Nothing that was stored is lost.",
        "Try another frame or sequence. If it happens again, send the log file to your GeoDerm support.",
        is_bug=True,
    )


def picture_of(shot: HandShot) -> QImage:
    """The frame's picture in its own pixels; depth as a quiet grey where there is no colour."""
    if shot.rgb is not None:
        pixels = cv2.cvtColor(shot.rgb, cv2.COLOR_RGB2BGRA)
    else:
        from app.live.display import show_depth

        size = (shot.depth.shape[1], shot.depth.shape[0])
        return show_depth(shot.depth, shot.depth_unit_m, size, 0, 0.0).image.copy()
    height, width = pixels.shape[:2]
    return QImage(pixels.data, width, height, pixels.strides[0], QImage.Format.Format_RGB32).copy()
