"""Gloves cut of flat skin and hands made of balls: surfaces whose distances and motions are known exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.capture import PinholeCamera, RigidTransform
from core.hand.fields import HandFields, measure_fields
from core.hand.model import LabelledFrame
from core.hand.names import FINGER_OF, FINGERS, KNUCKLES, PAIRS
from core.hand.surface import HandSurface
from core.surface.body_surface import BodySurface

FloatArray = NDArray[np.float64]

CAMERA = PinholeCamera(320, 240, 290.0, 290.0, 159.5, 119.5)

SQUARE = 0.018 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
"""Anchors (4, 2) as corners of a marker."""

ON_THE_AXIS = np.column_stack([np.zeros(4), (-0.03, -0.01, 0.01, 0.03)])
"""Anchors (4, 2) that cannot tell left from right."""

_PALM_M = (0.078, 0.090)
_FINGER_X_M = (-0.031, -0.0105, 0.0105, 0.031)
_THUMB_Y_M = 0.012


@dataclass(frozen=True, eq=False)
class Glove:
    """A flat hand, fingers up in the picture, thumb to the left; so far from the camera as it says.

    Attributes
    ----------
    size : float
    lengths_m : sequence of float
        Of thumb, index to little finger.
    anchors : ndarray (a, 2)
        On the palm, about its middle; they do not grow with the hand.
    missing : sequence of str
        Fingers that the camera does not see.
    distance_m : float
    """

    size: float = 1.0
    lengths_m: Sequence[float] = (0.055, 0.066, 0.076, 0.070, 0.054)
    anchors: FloatArray = field(default_factory=lambda: SQUARE)
    missing: Sequence[str] = ()
    distance_m: float = 0.6

    def plane(self) -> tuple[FloatArray, FloatArray]:
        """Points (15, 2) and anchors (4, 2) in the plane of the glove."""
        places = []
        for k, length in enumerate(self.lengths_m):
            for share in (0.88, 0.5, -0.08):
                if k == 0:
                    places.append((-0.5 * _PALM_M[0] - share * length, _THUMB_Y_M))
                else:
                    places.append((_FINGER_X_M[k - 1], -0.5 * _PALM_M[1] - share * length))
        return self.size * np.array(places), np.asarray(self.anchors)

    @cached_property
    def points_m(self) -> FloatArray:
        """Points (15, 3), NaN for those of missing fingers but their knuckles, which the palm shows."""
        lost = np.isin(FINGER_OF, [FINGERS.index(name) for name in self.missing])
        lost[list(KNUCKLES)] = False
        return np.where(lost[:, None], np.nan, self._in_space(self.plane()[0]))

    @cached_property
    def anchors_m(self) -> FloatArray:
        """Anchors (a, 3)."""
        return self._in_space(self.plane()[1])

    def _in_space(self, plane: FloatArray) -> FloatArray:
        return np.column_stack([plane, np.full(len(plane), self.distance_m)])

    def skin(self) -> NDArray[np.bool_]:
        """Where the camera sees the glove (h, w)."""
        x, y = (self.distance_m / self.size * CAMERA.pixel_rays[..., k] for k in (0, 1))
        skin = (np.abs(x) < 0.5 * _PALM_M[0]) & (np.abs(y) < 0.5 * _PALM_M[1])
        for k, name in enumerate(FINGERS):
            if name in self.missing:
                continue
            if k == 0:
                along, aside = -x - 0.5 * _PALM_M[0], y - _THUMB_Y_M
            else:
                along, aside = -y - 0.5 * _PALM_M[1], x - _FINGER_X_M[k - 1]
            skin |= (np.abs(aside) < 0.008) & (along > -0.01) & (along < self.lengths_m[k])
        return skin

    @cached_property
    def hand(self) -> HandSurface:
        """The surface that the camera sees."""
        depth = np.where(self.skin(), self.distance_m, 0.0)
        return HandSurface(BodySurface.from_depth(depth, CAMERA, jump_m=0.012), (0, 0), 1)

    @cached_property
    def fields(self) -> HandFields:
        """Distances of all its skin."""
        return measure_fields(self.hand, self.anchors_m)

    def labelled(self, configuration: str = "flat", only: Sequence[int] = ()) -> LabelledFrame:
        """The distances that a person's clicks on the points (all, or some) would give."""
        points = self.points_m.copy()
        if only:
            points[np.setdiff1d(np.arange(len(points)), only)] = np.nan
        there = np.flatnonzero(np.isfinite(points).all(axis=1))
        anchor_m = np.full((len(points), len(self.anchors) + 2), np.nan)
        anchor_m[there] = self.fields.at(points[there])
        between = np.full((len(points), len(points)), np.nan)
        surface = self.hand.surface
        sources = surface.nearest(points[there])
        for p, along in zip(there, self.fields.solver.distances(sources), strict=True):
            between[p, there] = [surface.interpolate(along, source) for source in sources]
        return LabelledFrame(configuration, anchor_m, np.array([between[i, j] for i, j in PAIRS]))


BALLS_M = np.array(
    [(0.03 * x, 0.025 * y, 0.006 * (x * x + y)) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    + [(0.031 * k - 0.02, -0.05 - 0.016 * n, 0.003 * n * k) for k in range(3) for n in range(4)]
    + [(-0.055, 0.01, 0.004), (-0.07, -0.004, 0.008)]
)
"""Middles (n, 3) of the balls of a hand in its own frame: a palm, three fingers, a thumb."""

BALL_RADII_M = np.array([0.024] * 9 + [0.010] * 12 + [0.012] * 2)

BALL_ANCHORS_M = np.array([(-0.018, -0.018, -0.02), (0.018, -0.018, -0.02), (0.018, 0.018, -0.02)])


def depth_of_balls(
    camera_from_hand: RigidTransform, *, wall_m: float = 1.2, without: Sequence[int] = ()
) -> FloatArray:
    """Exact depth image (h, w) of the hand of balls before a wall."""
    kept = np.setdiff1d(np.arange(len(BALLS_M)), without)
    rays = CAMERA.pixel_rays
    square = (rays**2).sum(axis=-1)
    depth = np.full(rays.shape[:2], wall_m)
    for middle, radius in zip(camera_from_hand.apply(BALLS_M[kept]), BALL_RADII_M[kept], strict=True):
        along = rays @ middle
        free = along**2 - square * (middle @ middle - radius**2)
        hit = free > 0
        z = (along[hit] - np.sqrt(free[hit])) / square[hit]
        depth[hit] = np.minimum(depth[hit], z)
    return depth


def surface_of_balls(camera_from_hand: RigidTransform) -> BodySurface:
    """The skin of the hand of balls as the camera sees it."""
    depth = depth_of_balls(camera_from_hand)
    return BodySurface.from_depth(np.where(depth < 1.0, depth, 0.0), CAMERA, jump_m=0.012)
