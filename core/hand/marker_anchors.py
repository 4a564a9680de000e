"""The four corners of the marker as anchors: found in the picture, put on the skin."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.hand.anchors import AnchorKind, FoundAnchors
from core.hand.marker import (
    DEFAULT_DICTIONARY,
    SeenMarker,
    find_markers,
    marker_pose,
    measured_side_m,
    other_dictionary,
    size_fault,
)
from core.hand.skin_patch import lift_corners

FloatArray = NDArray[np.float64]

_NEAR_SHARE = 1.2
"""The hand may move by so many sides of the marker from one frame to the next and is still found at once."""

_ASK_AGAIN = 15
"""Other dictionaries are tried on every so many-th frame without a marker: it takes longer than a frame."""


class MarkerAnchors:
    """Corners of an ArUco marker.

    Parameters
    ----------
    side_m : float
        Of the black square.
    dictionary : str
    number : int, optional
        Of the marker; others are then not looked at.
    """

    kind: Final[AnchorKind] = "marker"
    count: Final = 4

    def __init__(
        self, side_m: float, dictionary: str = DEFAULT_DICTIONARY, number: int | None = None
    ) -> None:
        self._side_m, self._dictionary, self._number = side_m, dictionary, number
        self._missed = 0
        self._other: str | None = None

    def find(
        self,
        rgb: NDArray[np.uint8] | None,
        depth_m: FloatArray,
        rig: CameraRig,
        near_m: FloatArray | None = None,
    ) -> FoundAnchors:
        """Anchors in a frame (`core.hand.anchors.AnchorFinder`)."""
        if rgb is None:
            return _none("There is no colour picture, and so no marker.")
        markers: list[SeenMarker] = []
        known_place = near_m is not None and bool(np.isfinite(near_m).all())
        if near_m is not None and known_place:
            markers = self._look(rgb, _box(near_m, rig))
        if not markers:
            markers = self._look(rgb)
        if not markers:
            return _none(self._why_none(rgb))
        self._missed, self._other = 0, None
        return self._choose(markers, depth_m, rig)

    def _look(self, rgb: NDArray[np.uint8], box: FloatArray | None = None) -> list[SeenMarker]:
        found = find_markers(rgb, self._dictionary, box)
        return [m for m in found if self._number is None or m.number == self._number]

    def _why_none(self, rgb: NDArray[np.uint8]) -> str:
        if self._missed % _ASK_AGAIN == 0:
            self._other = other_dictionary(rgb, self._dictionary)
        self._missed += 1
        if self._other is not None:
            return f"The marker in view is of {self._other}, not of {self._dictionary}."
        return "No marker is in view." if self._number is None else f"Marker {self._number} is not in view."

    def _choose(self, markers: list[SeenMarker], depth_m: FloatArray, rig: CameraRig) -> FoundAnchors:
        lifted = [lift_corners(depth_m, rig, marker.corners_px) for marker in markers]
        right = [
            k
            for k, corners in enumerate(lifted)
            if corners is None or size_fault(corners, self._side_m) is None
        ]
        if len(right) > 1:
            return _none(f"{len(right)} markers are in view: leave one.")
        if not right:
            corners = min((c for c in lifted if c is not None), key=self._unlike)
            return _none(size_fault(corners, self._side_m) or "")
        chosen = right[0]
        said = None
        if len(markers) > 1:
            said = "A second marker is in view: it has another size and is left out."
        places = lifted[chosen]
        if places is None:
            # what the marker's size tells is worse than the skin by millimetres, so it is said
            places = marker_pose(markers[chosen], rig, self._side_m)
            if not np.isfinite(places).all():
                return _none("The marker is seen, but there is no depth at it.")
            said = "The marker is seen, but there is no depth at it: its size alone tells how far it is."
        return FoundAnchors(places, True, said)

    def _unlike(self, corners_m: FloatArray) -> float:
        return abs(float(np.log(measured_side_m(corners_m) / self._side_m)))


def _none(reason: str) -> FoundAnchors:
    return FoundAnchors(np.full((4, 3), np.nan), False, reason)


def _box(near_m: FloatArray, rig: CameraRig) -> FloatArray:
    """Part of the picture around places (a, 3) of the frame before."""
    pixels = rig.project_to_picture(near_m)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    margin = _NEAR_SHARE * float((high - low).max())
    return np.concatenate([low - margin, high + margin])
