"""Places numbered labels beside a picture so that none overlaps and no two leader lines cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class LabelPlace:
    """A label in the margin: which mark it names, where the mark and the label are (y downward).

    Attributes
    ----------
    index : int
        Row of the mark in the input.
    mark : (float, float)
    label : (float, float)
        Centre of the label.
    on_left : bool
    """

    index: int
    mark: tuple[float, float]
    label: tuple[float, float]
    on_left: bool


def spread(wanted: Sequence[float], gap: float, low: float, high: float) -> FloatArray:
    """Positions at least ``gap`` apart inside ``low..high`` with the least squared shift from ``wanted``.

    ``wanted`` is ascending. Isotonic regression (pool adjacent violators) of ``wanted - i * gap``. If there
    is no room, the gap is reduced to what fits.
    """
    d = np.asarray(wanted, dtype=float)
    n = len(d)
    if n == 0:
        return d
    if n > 1:
        gap = min(gap, (high - low) / (n - 1))
    offsets = np.arange(n) * gap
    blocks: list[list[float]] = []
    for value in d - offsets:
        blocks.append([value, 1.0])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            mean, count = blocks.pop()
            blocks[-1] = [
                (blocks[-1][0] * blocks[-1][1] + mean * count) / (blocks[-1][1] + count),
                blocks[-1][1] + count,
            ]
    level = np.concatenate([np.full(int(count), mean) for mean, count in blocks])
    return np.asarray(np.clip(level, low, high - offsets[-1]) + offsets)


def place_labels(
    marks: FloatArray, *, left_x: float, right_x: float, top: float, bottom: float, gap: float
) -> list[LabelPlace]:
    """Labels for marks (n, 2) in two columns at ``left_x`` and ``right_x``.

    Each mark goes to its nearer column while there is room; within a column the leader lines do not cross.
    """
    marks = np.asarray(marks, dtype=float).reshape(-1, 2)
    left = _choose_side(marks[:, 0], (left_x + right_x) / 2, room=max(1, int((bottom - top) / gap) + 1))
    places: list[LabelPlace] = []
    for on_left in (True, False):
        column = [int(i) for i in np.flatnonzero(left == on_left)]
        column.sort(key=lambda i: (marks[i, 1], marks[i, 0]))
        ys = spread([float(marks[i, 1]) for i in column], gap, top, bottom)
        x = left_x if on_left else right_x
        placed = [
            LabelPlace(i, (float(marks[i, 0]), float(marks[i, 1])), (x, float(y)), on_left)
            for i, y in zip(column, ys, strict=True)
        ]
        places += _uncrossed(placed)
    return places


def _choose_side(x: FloatArray, middle: float, room: int) -> NDArray[np.bool_]:
    """Which marks are labelled on the left: those left of the middle, evened out if a column is full."""
    order = np.argsort(x, kind="stable")
    wanted = int((x < middle).sum())
    count = int(np.clip(wanted, max(0, len(x) - room), room)) if len(x) <= 2 * room else len(x) // 2
    left = np.zeros(len(x), dtype=bool)
    left[order[:count]] = True
    return left


def _uncrossed(places: list[LabelPlace]) -> list[LabelPlace]:
    """Swap labels whose leader lines cross; every swap makes the lines shorter, so it ends."""
    places = list(places)
    changed = True
    while changed:
        changed = False
        for i in range(len(places)):
            for j in range(i + 1, len(places)):
                a, b = places[i], places[j]
                if segments_cross(a.mark, a.label, b.mark, b.label) and (
                    _length(a.mark, b.label) + _length(b.mark, a.label)
                    < _length(a.mark, a.label) + _length(b.mark, b.label) - 1e-9
                ):
                    places[i], places[j] = replace(a, label=b.label), replace(b, label=a.label)
                    changed = True
    return places


def _length(a: tuple[float, float], b: tuple[float, float]) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


def segments_cross(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], d: tuple[float, float]
) -> bool:
    """Whether the open segments ab and cd have a point in common."""

    def turn(p: tuple[float, float], q: tuple[float, float], r: tuple[float, float]) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
