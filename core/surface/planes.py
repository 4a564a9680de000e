"""The room around a person: walls behind, the floor below."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_DRAWN = 3000
_SCORED = 150
_SCORED_POINTS = 2000
_MIN_POINTS = 300


@dataclass(frozen=True, eq=False)
class Plane:
    """Points p with ``normal . p + offset = 0``; the room ends on the positive side."""

    normal: FloatArray
    offset: float

    def distances(self, points: FloatArray) -> FloatArray:
        """Signed distances (...,) of points (..., 3), metres, positive beyond the plane."""
        return np.asarray(points @ self.normal + self.offset)

    def tolerance(self, points: FloatArray) -> FloatArray:
        """How far off the plane its points (...,) may be seen: noise grows with the square of depth.

        Only the part of the noise along the normal counts, which is little on a floor seen at a flat angle.
        """
        z = np.maximum(points[..., 2], 0.1)
        return np.asarray(0.02 + 0.006 * z * np.abs(points @ self.normal))


def find_walls(points: FloatArray, areas: FloatArray, *, most: int = 3) -> list[Plane]:
    """Large upright planes with next to nothing behind them.

    A wall must show at least 0.8 m2, more than the flat part of any body.

    Parameters
    ----------
    points : ndarray (n, 3)
        Measured points of a coarse grid.
    areas : ndarray (n,)
        Area each stands for across the line of sight, m2.
    """
    walls: list[Plane] = []
    left = np.ones(len(points), np.bool_)
    while len(walls) < most:
        plane = _best_plane(points[left], axis=1, lowest=0.0, highest=0.5, seed=len(walls))
        if plane is None:
            break
        d, tolerance = plane.distances(points), plane.tolerance(points)
        on = left & (np.abs(d) < tolerance)
        slant = np.abs(points @ plane.normal) / np.linalg.norm(points, axis=1)
        area = float((areas[on] / np.maximum(slant[on], 0.2)).sum())
        behind = float((left & (d > 0.06 + tolerance)).sum()) / max(1, int(left.sum()))
        if area < 0.8 or behind > 0.2:
            break
        walls.append(plane)
        left &= d < -tolerance
    return walls


def find_floor(points: FloatArray, low: BoolArray) -> Plane | None:
    """The floor: a level plane in the lower part of the view, wide and deep, with nothing below it.

    The demands matter: a thigh of a seated person is level and large too.

    Parameters
    ----------
    points : ndarray (n, 3)
    low : ndarray (n,) bool
        Which points lie in the lower part of the image.
    """
    plane = _best_plane(points[low], axis=1, lowest=0.8, highest=1.01, seed=7)
    if plane is None:
        return None
    d, tolerance = plane.distances(points), plane.tolerance(points)
    on = points[np.abs(d) < tolerance]
    if len(on) < _MIN_POINTS // 2:
        return None
    wide, deep = (float(np.subtract(*np.percentile(on[:, k], [95, 5]))) for k in (0, 2))
    below = float((d > 0.04 + tolerance).mean())
    return plane if wide > 1.0 and deep > 0.3 and below < 0.02 else None


def _best_plane(points: FloatArray, *, axis: int, lowest: float, highest: float, seed: int) -> Plane | None:
    """The plane with most points near it among those whose normal's |axis| component is in a range."""
    if len(points) < _MIN_POINTS:
        return None
    rng = np.random.default_rng(seed)
    a, b, c = points[rng.integers(0, len(points), (3, _DRAWN))]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    usable = lengths > 1e-4
    normals, a = normals[usable] / lengths[usable, None], a[usable]
    lean = np.abs(normals[:, axis])
    fits = (lean >= lowest) & (lean <= highest)
    normals, a = normals[fits][:_SCORED], a[fits][:_SCORED]
    if len(normals) == 0:
        return None
    sample = points[:: max(1, len(points) // _SCORED_POINTS)]
    offsets = -(normals * a).sum(1)
    along = sample @ normals.T
    near = np.abs(along + offsets) < 0.02 + 0.006 * sample[:, 2:] * np.abs(along)
    best = int(near.sum(0).argmax())
    plane = _away(normals[best], float(offsets[best]))
    for _ in range(2):
        on = points[np.abs(plane.distances(points)) < plane.tolerance(points)]
        if len(on) < 3:
            return None
        center = on.mean(0)
        normal = np.linalg.svd(on - center, full_matrices=False)[2][2]
        plane = _away(normal, -float(normal @ center))
    return plane if lowest <= abs(plane.normal[axis]) <= highest else None


def _away(normal: FloatArray, offset: float) -> Plane:
    """The plane with its normal away from the camera, which is on the negative side."""
    return Plane(normal, offset) if offset <= 0 else Plane(-normal, -offset)
