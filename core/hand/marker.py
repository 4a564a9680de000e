"""The four corners of an ArUco marker on the back of the hand: found, lifted to 3D, put on the skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.errors import InputError

FloatArray = NDArray[np.float64]

DEFAULT_DICTIONARY = "DICT_4X4_50"
_SIZE_TOLERANCE = 0.2


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
    rgb: NDArray[np.uint8], dictionary: str = DEFAULT_DICTIONARY, near_px: FloatArray | None = None
) -> list[SeenMarker]:
    """Markers in a picture (h, w, 3), the largest first.

    Parameters
    ----------
    rgb : ndarray (h, w, 3) uint8
    dictionary : str
        One of `dictionaries`.
    near_px : ndarray (4,), optional
        Only look inside this box (left, top, right, bottom).

    Raises
    ------
    InputError
        If there is no such dictionary.
    """
    left = top = 0
    gray = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    if near_px is not None:
        left, top = (max(int(x), 0) for x in near_px[:2])
        gray = gray[top : int(near_px[3]) + 1, left : int(near_px[2]) + 1]
        if min(gray.shape) < 16:
            return []
    corners, numbers, _ = _detector(dictionary).detectMarkers(np.ascontiguousarray(gray))
    if numbers is None:
        return []
    found = [
        SeenMarker(int(number), np.asarray(square, float).reshape(4, 2) + np.array([left, top]))
        for number, square in zip(np.ravel(numbers), corners, strict=True)
    ]
    return sorted(found, key=lambda marker: -marker.side_px)


@lru_cache(maxsize=4)
def _detector(dictionary: str) -> Any:
    if dictionary not in dictionaries():
        raise InputError(
            f"There is no ArUco dictionary '{dictionary}'.", "Use one such as DICT_4X4_50 or DICT_5X5_100."
        )
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = 4
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.ArucoDetector(known, parameters)


def other_dictionary(rgb: NDArray[np.uint8], dictionary: str) -> str | None:
    """A dictionary of which there is a marker although ``dictionary`` has none here; for the message."""
    for name in ("DICT_4X4_50", "DICT_5X5_50", "DICT_6X6_50", "DICT_7X7_50", "DICT_ARUCO_ORIGINAL"):
        if name != dictionary and find_markers(rgb, name):
            return name
    return None


def marker_pose(marker: SeenMarker, rig: CameraRig, side_m: float) -> FloatArray:
    """Corners (4, 3) in the depth camera's frame from the marker's known size alone (its four rays).

    Used where to look on the skin; the skin itself then gives the distance.
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


def size_fault(corners_m: FloatArray, side_m: float) -> str | None:
    """A sentence if corners (4, 3) lifted to the skin are those of a marker of another size."""
    sides = np.linalg.norm(corners_m - np.roll(corners_m, 1, axis=0), axis=1)
    measured = float(np.median(sides))
    if abs(measured / side_m - 1.0) <= _SIZE_TOLERANCE:
        return None
    return (
        f"The marker measures {1000 * measured:.0f} mm on the skin, not {1000 * side_m:.0f} mm: "
        "another marker, or its side was given wrongly."
    )


def one_marker(markers: Sequence[SeenMarker]) -> SeenMarker | None:
    """The marker, if there is exactly one."""
    return markers[0] if len(markers) == 1 else None
