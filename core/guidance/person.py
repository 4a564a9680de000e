"""The person in a coarse depth image, within a few milliseconds.

As `core.surface.segmentation` does it for a capture, with two shortcuts: the planes of the room are looked
for once in a while, for camera and room stand still, and the parts that belong to the patient are chosen by
place alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from core.guidance.moment import Moment
from core.surface.planes import Plane, find_floor, find_walls
from core.surface.threads import one_linear_algebra_thread

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ROOM_AGE_S: Final = 5.0
"""How long the planes of the room are believed."""

_FARTHEST_M: Final = 6.0
_PERSON_M2: Final = 0.05
_MOST_M2: Final = 1.6
_RELOOK_S: Final = 0.3
_PERSON_PIXELS: Final = 90
_REACH_M: Final = 0.25
_AHEAD_M: Final = 0.95
_CLOSE_M: Final = 0.16
_THIN_M: Final = 0.03
_SPECK_PIXELS: Final = 4


@dataclass(frozen=True, eq=False)
class Person:
    """Somebody in view.

    Attributes
    ----------
    mask : ndarray (h, w) bool
        Coarse pixels measured on the person.
    missing : ndarray (h, w) bool
        Pixels within the outline that were not measured.
    distance_m : float
        Median depth.
    low_m, high_m : ndarray (3,)
        Box around the person in the depth camera's frame.
    """

    mask: BoolArray
    missing: BoolArray
    distance_m: float
    low_m: FloatArray
    high_m: FloatArray


@dataclass(frozen=True, eq=False)
class _Parts:
    """Connected parts of the scene and their measures, one row each."""

    labels: NDArray[np.int32]
    pixels: NDArray[np.int64]
    area: FloatArray
    center: FloatArray
    low: FloatArray
    high: FloatArray


class PersonFinder:
    """Finds the person in successive moments of one camera that stands still."""

    def __init__(self) -> None:
        self._planes: list[Plane] = []
        self._looked_s = -np.inf

    def find(self, moment: Moment) -> Person | None:
        """The large, central, near person of a moment, or None if nobody is there."""
        inside = (moment.depth_m > 0) & (moment.depth_m < _FARTHEST_M)
        age = moment.time_s - self._looked_s
        if not 0.0 <= age <= ROOM_AGE_S:
            self._look_at_room(moment, inside)
            age = 0.0
        parts = self._parts(moment, inside)
        if age > _RELOOK_S and bool((parts.area > _MOST_M2).any()):
            # larger than any person: the camera was moved, and the room is not where it was
            self._look_at_room(moment, inside)
            parts = self._parts(moment, inside)
        return _person_among(parts, moment)

    def _parts(self, moment: Moment, inside: BoolArray) -> _Parts:
        """Connected parts of what stands before walls and floor."""
        from core.surface.depth_kernels import label_components, measure_parts

        free = inside.copy()
        for plane in self._planes:
            free &= plane.distances(moment.points) < -plane.tolerance(moment.points)
        left = np.where(free, moment.depth_m, 0.0)
        # noise is that of single pixels, but neighbours are several apart: a slanted limb must hold together
        labels, count = label_components(left, np.maximum(0.07, 0.02 * left * left))
        pixels, sums = measure_parts(labels, moment.points, count)
        area = sums[:, 0] / (moment.camera.fx * moment.camera.fy)
        center = sums[:, 1:4] / np.maximum(pixels, 1)[:, None]
        return _Parts(labels, pixels, area, center, sums[:, 4:7], sums[:, 7:10])

    def _look_at_room(self, moment: Moment, inside: BoolArray) -> None:
        """Find walls and floor again."""
        points = moment.points[inside][::2]
        self._looked_s = moment.time_s
        if len(points) < 500:
            self._planes = []
            return
        camera = moment.camera
        rows = np.nonzero(inside)[0][::2]
        with one_linear_algebra_thread():
            planes = find_walls(points, 2.0 * points[:, 2] ** 2 / (camera.fx * camera.fy))
            free = np.ones(len(points), np.bool_)
            for wall in planes:
                free &= wall.distances(points) < -wall.tolerance(points)
            floor = find_floor(points[free], rows[free] > 0.5 * camera.height)
        self._planes = planes if floor is None else [*planes, floor]


def _person_among(parts: _Parts, moment: Moment) -> Person | None:
    """The part that is a person, with the limbs that something in front cut off."""
    area, center, low, high = parts.area, parts.center, parts.low, parts.high
    aside = center[:, 0] / np.maximum(center[:, 2], 0.1)
    score = area * np.exp(-((aside / 0.4) ** 2)) / np.maximum(center[:, 2], 0.3)
    score[(area > _MOST_M2) | (area < _PERSON_M2) | (parts.pixels < _PERSON_PIXELS)] = 0.0
    if not len(score) or score.max() <= 0.0:
        return None
    main = int(score.argmax())
    near = ((center > low[main] - _REACH_M) & (center < high[main] + _REACH_M))[:, :2].all(axis=1)
    ahead = center[main, 2] - center[:, 2]
    belongs = near & (ahead < _AHEAD_M) & (ahead > -0.4) & (area < 0.4 * area[main])
    belongs &= parts.pixels >= _SPECK_PIXELS
    belongs[main] = True
    mask = belongs[parts.labels] & (parts.labels >= 0)
    z = float(np.median(moment.depth_m[mask]))
    missing = missing_within(mask, moment.depth_m, moment.camera.fx / z)
    return Person(mask, missing, z, low[main], high[main])


def missing_within(mask: BoolArray, depth: FloatArray, pixels_per_m: float) -> BoolArray:
    """Unmeasured pixels within the outline: holes, and gaps that a hand's breadth closes.

    Parameters
    ----------
    mask : ndarray (h, w) bool
        The person.
    depth : ndarray (h, w)
        0 where there is no measurement.
    pixels_per_m : float
        At the person.
    """
    size = max(3, round(_CLOSE_M * pixels_per_m)) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    padded = np.pad(mask.astype(np.uint8), size)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)[size:-size, size:-size]
    gaps = np.asarray((closed > 0) & ~mask & (depth <= 0))
    # a thin unmeasured line beside the body is the sensor's shadow on the wall, not skin
    thin = max(3, round(_THIN_M * pixels_per_m))
    opened = cv2.morphologyEx(gaps.astype(np.uint8), cv2.MORPH_OPEN, np.ones((thin, thin), np.uint8))
    return np.asarray(opened > 0)
