"""Anchors of a hand: places that are easily found, from which geodesics are measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]

AnchorKind = Literal["marker", "palm"]

MIRRORED_ORDER: Final[dict[AnchorKind, tuple[int, ...]]] = {
    "marker": (1, 0, 3, 2),
    "palm": (0, 4, 3, 2, 1),
}
"""Order of the anchors in which the other hand of a pair has them where this one has its own."""


@dataclass(frozen=True, eq=False)
class FoundAnchors:
    """Anchors in one frame.

    Attributes
    ----------
    places_m : ndarray (a, 3)
        Depth-camera frame, on or near the skin; NaN for one that is missing. All NaN: none found.
    seen : bool
    reason : str or None
        Why there are none, or what is wrong with them; a sentence for people.
    """

    places_m: FloatArray
    seen: bool
    reason: str | None = None


class AnchorFinder(Protocol):
    """Finds the anchors of a frame. A new kind of anchor is one more class of this form."""

    @property
    def kind(self) -> AnchorKind:
        """Which kind it is."""

    @property
    def count(self) -> int:
        """How many anchors it finds, a."""

    def find(
        self,
        rgb: NDArray[np.uint8] | None,
        depth_m: FloatArray,
        rig: CameraRig,
        near_m: FloatArray | None = None,
    ) -> FoundAnchors:
        """Anchors in a frame.

        Parameters
        ----------
        rgb : ndarray (h', w', 3) uint8 or None
            Picture of ``rig.picture_camera``.
        depth_m : ndarray (h, w)
            Metres, 0 for no measurement.
        rig : CameraRig
        near_m : ndarray (a, 3), optional
            Where they were in the frame before; a finder may look only there first.
        """
