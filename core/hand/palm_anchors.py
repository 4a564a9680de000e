"""Landmarks of the palm as anchors: a hand that wears no marker.

A detector marks wrist and knuckles on the picture; the depth image gives them their place on the skin. They
need not be the joints that their names say, but must be the same spots of the skin from frame to frame and
from hand to hand. The landmarks of the thumb are not used: they wander two to three times as far.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.hand.anchors import AnchorKind, FoundAnchors
from core.hand.landmark_lifting import PictureDepth, on_rays
from core.hand.landmarks import WRIST, HandDetector, landmark
from core.hand.names import FINGERS

FloatArray = NDArray[np.float64]

PALM_NAMES: Final = ("wrist", *(f"{finger}_mcp" for finger in FINGERS[1:]))
"""The anchors in their order."""

PALM_LANDMARKS: Final = (WRIST, *(landmark(finger, 0) for finger in range(1, 5)))

MIRRORED: Final = (0, 4, 3, 2, 1)
"""The order of the anchors on a hand that was taken for the other one."""

LEAST_ANCHORS: Final = 4

ACROSS_M: Final = (0.030, 0.100)
"""From the index finger's knuckle to the little finger's: a small child's to a large man's, and tilted."""

ALONG_M: Final = (0.045, 0.140)
"""From the wrist to the knuckle of the middle finger."""

OFF_PLANE_M: Final = 0.010
"""Wrist and knuckles lie in a plane to within 4 mm; farther off, something else was measured."""

SURE: Final = 0.7
"""Below this score the worst anchor lies 9 mm beside its usual place, above 0.9 it is 5 mm (medians)."""

_UNSURE: Final = "The hand is not clearly seen: its anchors may be some millimetres off."


class PalmAnchors:
    """Wrist and four knuckles, by a landmark detector and the depth image.

    A detector may take the back of a right hand for the palm of a left one, and then gives all fingers in
    the wrong order. A single picture does not show it. It is put right where the side is known, or by the
    majority of the frames in a row (those that come with ``near_m``).

    Parameters
    ----------
    detector : HandDetector
        Not closed here.
    side : {"L", "R"}, optional
        Which hand it is, if that is known.
    """

    kind: Final[AnchorKind] = "palm"
    count: Final = len(PALM_NAMES)

    def __init__(self, detector: HandDetector, side: Literal["L", "R"] | None = None) -> None:
        self._detector, self._side = detector, side
        self._votes = 0

    def find(
        self,
        rgb: NDArray[np.uint8] | None,
        depth_m: FloatArray,
        rig: CameraRig,
        near_m: FloatArray | None = None,
    ) -> FoundAnchors:
        """Anchors in a frame (`core.hand.anchors.AnchorFinder`).

        One whose landmark lies outside the depth image, or on no measured skin, is NaN; more than one such
        anchor, and there are none. Anchors of a hand that the detector is unsure of are given with a reason.
        """
        if rgb is None:
            return _none("There is no colour picture, and so no palm to be found on it.")
        found = self._detector.detect(rgb)
        if found is None:
            return _none("No hand is in view.")
        pixels = found.pixels[list(PALM_LANDMARKS)]
        if self._taken_for_the_other(pixels, near_m is not None):
            pixels = pixels[list(MIRRORED)]
        skin = PictureDepth(depth_m, rig)
        places = on_rays(pixels, np.array([skin.near_layer_m(pixel) for pixel in pixels]), rig)
        if np.isfinite(places[:, 2]).sum() < LEAST_ANCHORS:
            return _none("There is a hand in the picture, but the depth camera does not measure its palm.")
        places = _in_one_plane(places)
        if np.isfinite(places[:, 2]).sum() < LEAST_ANCHORS:
            return _none("The palm of the hand in view is covered.")
        if wrong := _wrong_size(places):
            return _none(wrong)
        return FoundAnchors(places, True, _UNSURE if found.score < SURE else None)

    def _taken_for_the_other(self, pixels: FloatArray, follows: bool) -> bool:
        wrist, index, little = pixels[0], pixels[1], pixels[4]
        (ax, ay), (bx, by) = index - wrist, little - wrist
        # the back of a right hand has its index finger to the left of the little finger
        right = bool(ax * by - ay * bx > 0)
        if self._side is not None:
            return right != (self._side == "R")
        vote = 1 if right else -1
        self._votes = vote + (int(np.clip(self._votes, -_MEMORY, _MEMORY)) if follows else 0)
        return self._votes * vote < 0


_MEMORY: Final = 10
"""Frames in a row whose majority counts."""


def _none(reason: str) -> FoundAnchors:
    return FoundAnchors(np.full((len(PALM_NAMES), 3), np.nan), False, reason)


def _in_one_plane(places: FloatArray) -> FloatArray:
    """The places (5, 3) without those far off the plane through most of them."""
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    best: NDArray[np.bool_] = np.zeros(len(places), bool)
    for three in combinations(known, 3):
        a, b, c = places[list(three)]
        normal = np.cross(b - a, c - a)
        length = float(np.linalg.norm(normal))
        if length == 0:
            continue
        near = np.abs((places - a) @ (normal / length)) < OFF_PLANE_M  # NaN is not near
        if near.sum() > best.sum():
            best = near
    return np.where(best[:, None], places, np.nan)


def _wrong_size(places: FloatArray) -> str | None:
    across = float(np.linalg.norm(places[1] - places[4]))
    along = float(np.linalg.norm(places[0] - places[2]))
    for size, (low, high), said in ((across, ACROSS_M, "wide"), (along, ALONG_M, "long")):
        if np.isfinite(size) and not low <= size <= high:
            return (
                f"What looks like a hand would have a palm {round(1000 * size)} mm {said}: show the back of "
                "the hand to the camera, with nothing before it."
            )
    return None
