"""The four corners of the marker as anchors."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.hand.anchors import AnchorKind, FoundAnchors
from core.hand.marker import DEFAULT_DICTIONARY, find_markers, marker_pose, other_dictionary

FloatArray = NDArray[np.float64]


class MarkerAnchors:
    """Corners of an ArUco marker.

    Parameters
    ----------
    side_m : float
        Of the black square.
    dictionary : str
    """

    kind: Final[AnchorKind] = "marker"
    count: Final = 4

    def __init__(self, side_m: float, dictionary: str = DEFAULT_DICTIONARY) -> None:
        self._side_m, self._dictionary = side_m, dictionary

    def find(
        self,
        rgb: NDArray[np.uint8] | None,
        depth_m: FloatArray,
        rig: CameraRig,
        near_m: FloatArray | None = None,
    ) -> FoundAnchors:
        """Anchors in a frame (`core.hand.anchors.AnchorFinder`)."""
        nowhere = np.full((4, 3), np.nan)
        if rgb is None:
            return FoundAnchors(nowhere, False, "There is no colour picture, and so no marker.")
        markers = find_markers(rgb, self._dictionary)
        if len(markers) > 1:
            return FoundAnchors(nowhere, False, f"{len(markers)} markers are in view: leave one.")
        if not markers:
            other = other_dictionary(rgb, self._dictionary)
            said = "No marker is in view." if other is None else f"The marker in view is of {other}."
            return FoundAnchors(nowhere, False, said)
        return FoundAnchors(marker_pose(markers[0], rig, self._side_m), True)
