"""What the hand experiments are made on: frames with their truth, from wherever they come."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrueFrame:
    """One frame and what is true of it.

    Attributes
    ----------
    name : str
    body : str
        Whose hand: figures are spread over bodies, not over frames.
    capture : RgbdCapture
        One depth frame and its picture.
    labels : FrameLabels
        Points on the skin, also those the camera does not see; configuration None between two.
    remark : str
        What happens in the frame, in words.
    """

    name: str
    body: str
    capture: RgbdCapture
    labels: FrameLabels
    remark: str = ""

    @property
    def depth_m(self) -> FloatArray:
        """Depth (h, w), 0 for no measurement."""
        return np.asarray(self.capture.depth_frames[0] * self.capture.depth_unit_m, dtype=float)

    @property
    def points_m(self) -> FloatArray:
        """All true points (15, 3)."""
        return self.labels.array(only_visible=False)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Which points (15,) the depth camera sees."""
        return np.array([self.labels.visible.get(name, True) for name in POINT_NAMES], bool)


class FrameSet(Protocol):
    """Frames of one hand: a sequence in its order, or stills; drawn or read when they are asked for."""

    @property
    def name(self) -> str:
        """What kind of frames they are."""

    @property
    def body(self) -> str:
        """Whose hand it is."""

    def __len__(self) -> int:
        """How many frames there are."""

    def __iter__(self) -> Iterator[TrueFrame]:
        """The frames in their order; the same each time."""


@dataclass(frozen=True)
class HandSets:
    """Everything that the experiments are made on.

    Attributes
    ----------
    training, bare_training : tuple of FrameSet
        Single frames to learn from, with and without a marker.
    test, bare_test : tuple of FrameSet
        Single frames of hands never learned from. The bare ones show the first views of the others, under the
        same names, without the marker.
    large, bare_large : tuple of FrameSet
        Large displacements; likewise.
    changing, occluded, bottle, lost : tuple of FrameSet
        One configuration after the other; things before the fingers; a bottle in the hand; no marker to be
        read for some frames.
    three, five, six : tuple of str
        Configurations of the thesis's number, of the report, and with the hardest.
    """

    training: tuple[FrameSet, ...]
    bare_training: tuple[FrameSet, ...]
    test: tuple[FrameSet, ...]
    bare_test: tuple[FrameSet, ...]
    large: tuple[FrameSet, ...]
    bare_large: tuple[FrameSet, ...]
    changing: tuple[FrameSet, ...]
    occluded: tuple[FrameSet, ...]
    bottle: tuple[FrameSet, ...]
    lost: tuple[FrameSet, ...]
    three: tuple[str, ...]
    five: tuple[str, ...]
    six: tuple[str, ...]
