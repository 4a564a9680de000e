"""ArUco markers in a picture of a hand: found, their corners located, the number read also on bent skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.errors import InputError
from core.hand.marker_edges import Outline, trace_outline

FloatArray = NDArray[np.float64]
GrayImage = NDArray[np.uint8]

Effort = Literal["quick", "thorough"]

DEFAULT_DICTIONARY = "DICT_4X4_50"

_SIZE_TOLERANCE = 0.2
_RIM_SHARE = 6.0 / 8.0
"""Black square against white rim and all: sometimes the rim's outline is what is found."""

_LEAST_SIDE_PX = 12.0
_MOST_CANDIDATES = 16
_OTHERS = ("4X4_250", "5X5_1000", "6X6_1000", "7X7_1000", "ARUCO_ORIGINAL")
_FAMILY_SIZES = (50, 100, 250, 1000)


@dataclass(frozen=True, eq=False)
class SeenMarker:
    """A marker in a picture.

    Attributes
    ----------
    number : int
    corners_px : ndarray (4, 2)
        Sub-pixel, colour picture, ArUco's order (top left of the sheet first, clockwise).
    """

    number: int
    corners_px: FloatArray

    @property
    def side_px(self) -> float:
        """Mean length of the sides."""
        return float(np.linalg.norm(self.corners_px - np.roll(self.corners_px, 1, axis=0), axis=1).mean())


def dictionaries() -> tuple[str, ...]:
    """Names of the ArUco dictionaries there are."""
    return tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))


def find_markers(
    rgb: NDArray[np.uint8],
    dictionary: str = DEFAULT_DICTIONARY,
    near_px: FloatArray | None = None,
    effort: Effort = "thorough",
) -> list[SeenMarker]:
    """Markers in a picture (h, w, 3), the largest first.

    Parameters
    ----------
    rgb : ndarray (h, w, 3) uint8
    dictionary : str
        One of `dictionaries`.
    near_px : ndarray (4,), optional
        Only look inside this box (left, top, right, bottom).
    effort : {"quick", "thorough"}
        Quick looks with one threshold window; thorough with six, if the first found nothing.

    Raises
    ------
    InputError
        If there is no such dictionary.
    """
    _dictionary(dictionary)
    left = top = 0
    if near_px is not None:
        left, top = (max(int(x), 0) for x in near_px[:2])
        rgb = rgb[top : max(int(near_px[3]) + 1, 0), left : max(int(near_px[2]) + 1, 0)]
        if min(rgb.shape[:2]) < _LEAST_SIDE_PX:
            return []
    gray = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
    found = _search(gray, dictionary, thorough=False, all_of_them=near_px is None)
    if not found and effort == "thorough":
        found = _search(gray, dictionary, thorough=True, all_of_them=True)
    moved = [SeenMarker(m.number, m.corners_px + np.array([left, top])) for m in found]
    return sorted(moved, key=lambda marker: -marker.side_px)


def _search(gray: GrayImage, dictionary: str, *, thorough: bool, all_of_them: bool) -> list[SeenMarker]:
    """Markers; squares that ArUco could not read are read on the bent patch, ``all_of_them`` or if needed."""
    corners, numbers, rejected = _detector(dictionary, thorough).detectMarkers(gray)
    found: list[SeenMarker] = []
    for square, number in zip(corners, () if numbers is None else np.ravel(numbers), strict=True):
        given = np.asarray(square, float).reshape(4, 2)
        outline = trace_outline(gray, given)
        found.append(SeenMarker(int(number), given if outline is None else outline.corners_px))
    if found and not all_of_them:
        return found
    for outline in _outlines(gray, rejected):
        seen = _read(gray, outline, dictionary)
        if seen is not None and not any(_same_place(seen, other) for other in found):
            found.append(seen)
    return found


@lru_cache(maxsize=8)
def _dictionary(name: str) -> Any:
    if name not in dictionaries():
        raise InputError(
            f"There is no ArUco dictionary '{name}'.", "Use one such as DICT_4X4_50 or DICT_5X5_100."
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


@lru_cache(maxsize=8)
def _detector(dictionary: str, thorough: bool) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    # the corners are located afterwards, along the whole sides
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    windows = (3, 53, 10) if thorough else (15, 15, 10)
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = windows[:2]
    parameters.adaptiveThreshWinSizeStep = windows[2]
    parameters.polygonalApproxAccuracyRate = 0.05
    parameters.minMarkerPerimeterRate = 0.02
    parameters.errorCorrectionRate = 1.0
    # the rim's outline must not hide the black square's within it
    parameters.minMarkerDistanceRate = 0.02
    return cv2.aruco.ArucoDetector(_dictionary(dictionary), parameters)


def _outlines(gray: GrayImage, squares: Sequence[Any]) -> list[Outline]:
    """Sides of the squares seen but not read: black within white all around, whatever is in them."""
    given = [np.asarray(square, float).reshape(4, 2) for square in squares]
    sides = [np.linalg.norm(c - np.roll(c, 1, axis=0), axis=1) for c in given]
    large = [c for c, side in zip(given, sides, strict=True) if side.min() >= _LEAST_SIDE_PX]
    large.sort(key=lambda c: -float(cv2.contourArea(c.astype(np.float32))))
    traced = []
    for square in large[:_MOST_CANDIDATES]:
        middle = square.mean(axis=0)
        for corners in (square, middle + _RIM_SHARE * (square - middle)):
            outline = trace_outline(gray, corners)
            if outline is not None:
                traced.append(outline)
                break
    return traced


def _read(gray: GrayImage, outline: Outline, dictionary: str, *, correct: bool = True) -> SeenMarker | None:
    """The marker within an outline, its cells looked for on the bent patch that the sides span."""
    known = _dictionary(dictionary)
    cells = known.markerSize + 2
    u, v = np.meshgrid((np.arange(3 * cells) + 0.5) / (3 * cells), (np.arange(3 * cells) + 0.5) / (3 * cells))
    places = outline.places(u.ravel(), v.ravel()).astype(np.float32).reshape(3 * cells, 3 * cells, 2)
    shade = cv2.remap(gray, places, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
    # the middle ninth of a cell counts most: its rim is blurred with its neighbours
    level = shade.reshape(cells, 3, cells, 3).transpose(0, 2, 1, 3).reshape(cells, cells, 9) @ _CELL_WEIGHTS
    half = 0.5 * (np.percentile(level, 10) + np.percentile(level, 95))
    white = level > half
    if white[[0, -1]].any() or white[:, [0, -1]].any():
        return None
    bits = np.ascontiguousarray(white[1:-1, 1:-1].astype(np.uint8))
    same, number, turns = known.identify(bits, 1.0 if correct else 0.0)
    if not same:
        return None
    return SeenMarker(int(number), np.roll(outline.corners_px, int(turns), axis=0))


_CELL_WEIGHTS = np.array([1.0, 2.0, 1.0, 2.0, 4.0, 2.0, 1.0, 2.0, 1.0]) / 16.0


def _same_place(one: SeenMarker, other: SeenMarker) -> bool:
    apart = one.corners_px.mean(axis=0) - other.corners_px.mean(axis=0)
    return float(np.hypot(*apart)) < 0.5 * max(one.side_px, other.side_px)


def other_dictionary(rgb: NDArray[np.uint8], dictionary: str) -> str | None:
    """A dictionary of which there is a marker although ``dictionary`` has none here; for the message.

    The squares are looked for once and read as markers of every size. The smallest dictionary of the family
    that holds the number is named. Without correction of single bits, for a name that is wrong helps nobody.
    """
    gray = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
    corners, _, rejected = _detector(dictionary, True).detectMarkers(gray)
    for outline in _outlines(gray, [*corners, *rejected]):
        for family in _OTHERS:
            seen = _read(gray, outline, f"DICT_{family}", correct=False)
            if seen is None:
                continue
            size = family.split("_")[0]
            name = f"DICT_{family}"
            if family != "ARUCO_ORIGINAL":
                name = next(f"DICT_{size}_{n}" for n in _FAMILY_SIZES if seen.number < n)
            if name != dictionary:
                return name
    return None


def marker_pose(marker: SeenMarker, rig: CameraRig, side_m: float) -> FloatArray:
    """Corners (4, 3) in the depth camera's frame from the marker's known size alone (its four rays).

    For a marker at which there is no depth; elsewhere the skin itself tells the distance.
    """
    camera = rig.picture_camera
    h = 0.5 * side_m
    square = np.array([(-h, h, 0), (h, h, 0), (h, -h, 0), (-h, -h, 0)])
    rays = np.ascontiguousarray(camera.rays(marker.corners_px)[:, :2])
    done, rotation, translation = cv2.solvePnP(square, rays, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    if not done:
        return np.full((4, 3), np.nan)
    corners = square @ cv2.Rodrigues(rotation)[0].T + translation.ravel()
    return rig.picture_from_depth.inverse().apply(corners)


def measured_side_m(corners_m: FloatArray) -> float:
    """Median side of corners (4, 3)."""
    sides = np.sort(np.linalg.norm(corners_m - np.roll(corners_m, 1, axis=0), axis=1))
    return float(0.5 * (sides[1] + sides[2]))


def size_fault(corners_m: FloatArray, side_m: float) -> str | None:
    """A sentence if corners (4, 3) lifted to the skin are those of a marker of another size."""
    measured = measured_side_m(corners_m)
    if abs(measured / side_m - 1.0) <= _SIZE_TOLERANCE:
        return None
    return (
        f"The marker measures {1000 * measured:.0f} mm on the skin, not {1000 * side_m:.0f} mm: "
        "another marker, or its side was given wrongly."
    )


def one_marker(markers: Sequence[SeenMarker]) -> SeenMarker | None:
    """The marker, if there is exactly one."""
    return markers[0] if len(markers) == 1 else None
