"""Corners of a seen marker to a tenth of a pixel, from the whole length of its four sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_CELLS = 6
"""Of the smallest dictionary's marker: its black border and white rim are at least a sixth of its side."""

_OFF_CORNER = 0.04
_LEAST_CONTRAST = 12.0
_STIFFNESS = np.array([0.0, 0.0, 0.0005, 0.0005])
"""Holds the bend of a side back a little: the whole side must tell it, not noise at its ends."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The four sides of a marker as they run over the skin.

    Attributes
    ----------
    corners_px : ndarray (4, 2)
    along : ndarray (4, 2)
        From each corner to the next, of the corners that the search began with (`start`).
    start, outward : ndarray (4, 2)
    sides : ndarray (4, 4)
        Coefficients of each side's way outward, a cubic in share - 1/2.
    """

    corners_px: FloatArray
    start: FloatArray
    along: FloatArray
    outward: FloatArray
    sides: FloatArray

    def places(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Picture places (n, 2) of shares (n,) across and down the marker: the patch that the sides span.

        Coons 1967: sides blended linearly.
        """
        top, right = self._on(0, u), self._on(1, v)
        bottom, left = self._on(2, 1.0 - u), self._on(3, 1.0 - v)
        a, b, c, d = self.corners_px
        u, v = u[:, None], v[:, None]
        flat = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
        return np.asarray((1 - v) * top + v * bottom + (1 - u) * left + u * right - flat)

    def _on(self, side: int, share: FloatArray) -> FloatArray:
        rows = np.full(len(share), side)
        return _curve(self.start[rows], self.along[rows], self.outward[rows], self.sides[rows], share)[0]


def trace_outline(gray: NDArray[np.uint8], corners_px: FloatArray, rounds: int = 2) -> Outline | None:
    """Sides of a marker, each fitted over its whole length; None where one cannot be made out.

    The usual refinement looks at a window about the corner; where a cell of the marker is four
    pixels wide the pattern's own edges disturb it (0.5 px). A side is 25 pixels long: its course from black
    to white is located on every one of them. It may be bent, for skin is.

    Parameters
    ----------
    gray : ndarray (h, w) uint8
    corners_px : ndarray (4, 2)
        In order around the marker.
    """
    given = np.asarray(corners_px, dtype=float)
    shortest = float(np.linalg.norm(given - np.roll(given, -1, axis=0), axis=1).min())
    if shortest < 2 * _CELLS:
        return None
    cell = shortest / _CELLS
    outline, corners = None, given
    for _ in range(rounds):
        outline = _fit_outline(gray, corners, cell)
        if outline is None or np.abs(outline.corners_px - given).max() > 0.8 * cell:
            return None
        corners = outline.corners_px
    return outline


def refine_corners(gray: NDArray[np.uint8], corners_px: FloatArray) -> FloatArray:
    """Corners (4, 2) where the traced sides meet; as given where a side cannot be made out."""
    outline = trace_outline(gray, corners_px)
    return np.asarray(corners_px, dtype=float) if outline is None else outline.corners_px


def _fit_outline(gray: NDArray[np.uint8], corners: FloatArray, cell: float) -> Outline | None:
    from core.hand.marker_kernels import fit_sides

    along = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(along[:, 0], along[:, 1])
    clockwise = along[0, 0] * along[1, 1] - along[0, 1] * along[1, 0] > 0
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None] * (1.0 if clockwise else -1.0)
    shares = np.linspace(_OFF_CORNER, 1.0 - _OFF_CORNER, int(np.clip(length.max(), 16, 64)))
    reach = min(max(0.75 * cell, 1.5), 6.0)
    sides = fit_sides(gray, corners, along, outward, shares, reach, _LEAST_CONTRAST, len(shares) * _STIFFNESS)
    if np.isnan(sides).any():
        return None
    before = np.roll(np.arange(4), 1)
    end, begin = np.ones(4), np.zeros(4)
    for _ in range(2):
        p, dp = _curve(corners[before], along[before], outward[before], sides[before], end)
        q, dq = _curve(corners, along, outward, sides, begin)
        across = dp[:, 1] * dq[:, 0] - dp[:, 0] * dq[:, 1]
        if np.abs(across).min() < 0.1 * length.min() ** 2:
            return None
        gap = q - p
        end = end + (gap[:, 1] * dq[:, 0] - gap[:, 0] * dq[:, 1]) / across
        begin = begin + (gap[:, 1] * dp[:, 0] - gap[:, 0] * dp[:, 1]) / across
    met = _curve(corners, along, outward, sides, begin)[0]
    return Outline(met, corners, along, outward, sides)


def _curve(
    start: FloatArray, along: FloatArray, outward: FloatArray, side: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Places (4, 2) on the four sides, and the curves' directions there."""
    s = (share - 0.5)[:, None]
    c = side[:, :, None]
    way = c[:, 0] + s * (c[:, 1] + s * (c[:, 2] + s * c[:, 3]))
    slope = c[:, 1] + s * (2.0 * c[:, 2] + 3.0 * s * c[:, 3])
    return start + share[:, None] * along + way * outward, along + slope * outward
