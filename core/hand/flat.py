"""A hand laid flat: where its points and anchors lie if the skin between them were a plane.

Geodesics hardly change when fingers bend, so that learned distances nearly fit a plane. It is used while
learning only, to say how distances change when the marker sits elsewhere, the hand is larger or a finger
is spread: what a few training frames of one person cannot show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.hand.names import FINGER_OF, PAIRS, POINT_NAMES

FloatArray = NDArray[np.float64]

_POINTS = len(POINT_NAMES)
_ROUNDS = 200
_LEAST_KNOWN = 3
_STEP = 1e-3

SIZE_SHARE = 0.10
"""Standard deviation of the size of hands."""

_SHIFT_M = 0.0015
_TURN = np.deg2rad(2.5)
_SPREAD = np.deg2rad(4.0)
_STRETCH = 0.03
_PALM_SHIFT_M = 0.004


@dataclass(frozen=True, eq=False)
class FlatHand:
    """Points and anchors in a plane.

    Attributes
    ----------
    points_m : ndarray (15, 2)
        NaN for those of which too little is known.
    anchors_m : ndarray (a, 2)
    """

    points_m: FloatArray
    anchors_m: FloatArray

    def distances(self) -> FloatArray:
        """All distances (15 a + 105,): dA point by point, then dB pair by pair."""
        anchor = np.linalg.norm(self.points_m[:, None] - self.anchors_m[None], axis=2)
        i, j = np.array(PAIRS).T
        pair = np.linalg.norm(self.points_m[i] - self.points_m[j], axis=1)
        return np.concatenate([anchor.ravel(), pair])

    def change(self, points_m: FloatArray, anchors_m: FloatArray) -> FloatArray:
        """How the distances change if points and anchors move by this much; 0 where they are not known.

        Linear, from a thousandth of the way: a mode of deformation may be taken with either sign.
        """
        moved = FlatHand(self.points_m + _STEP * points_m, self.anchors_m + _STEP * anchors_m)
        return np.nan_to_num((moved.distances() - self.distances()) / _STEP)


def lay_flat(anchor_m: FloatArray, pair_m: FloatArray) -> FlatHand:
    """Plane that agrees best with mean distances (stress majorisation, SMACOF; de Leeuw 1977).

    Parameters
    ----------
    anchor_m : ndarray (15, a)
        dA, NaN where not known.
    pair_m : ndarray (105,)
        dB.
    """
    anchors = anchor_m.shape[1]
    count = _POINTS + anchors
    wanted = np.full((count, count), np.nan)
    for k, (i, j) in enumerate(PAIRS):
        wanted[i, j] = wanted[j, i] = pair_m[k]
    wanted[:_POINTS, _POINTS:] = anchor_m
    wanted[_POINTS:, :_POINTS] = anchor_m.T
    known = np.isfinite(wanted)
    rows = _determined(known)
    places = np.full((count, 2), np.nan)
    if len(rows) >= _LEAST_KNOWN:
        among = np.ix_(rows, rows)
        places[rows] = _majorised(np.where(known[among], wanted[among], 0.0), known[among])
    return FlatHand(places[:_POINTS], places[_POINTS:])


def _determined(known: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows whose place three distances to others of them determine: of the others, nothing can be said."""
    rows = np.arange(len(known))
    while True:
        enough = known[np.ix_(rows, rows)].sum(axis=1) >= _LEAST_KNOWN
        if enough.all():
            return rows
        rows = rows[enough]


def _majorised(wanted: FloatArray, known: NDArray[np.bool_]) -> FloatArray:
    """Places (k, 2) whose distances agree best with those that are known."""
    places = _first_places(wanted, known)
    laplacian = np.diag(known.sum(axis=1).astype(float)) - known
    inverse = np.linalg.pinv(laplacian)
    for _ in range(_ROUNDS):
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        ratio = np.where(known, wanted / np.maximum(apart, 1e-6), 0.0)
        pull = np.diag(ratio.sum(axis=1)) - ratio
        places = np.asarray(inverse @ (pull @ places))
    return places


def _first_places(wanted: FloatArray, known: NDArray[np.bool_]) -> FloatArray:
    """Classical scaling of the distances, gaps filled by the shortest way over others."""
    from scipy.sparse.csgraph import shortest_path

    filled = shortest_path(np.where(known, np.maximum(wanted, 1e-6), 0.0), directed=False)
    filled[~np.isfinite(filled)] = 0.3
    centring = np.eye(len(filled)) - 1.0 / len(filled)
    values, vectors = np.linalg.eigh(-0.5 * centring @ filled**2 @ centring)
    return np.asarray(vectors[:, -2:] * np.sqrt(np.maximum(values[-2:], 1e-8)))


def changes_between_people(flat: FlatHand, *, rigid_anchors: bool) -> FloatArray:
    """How distances differ from one hand and one session to another, each row one standard deviation.

    Size of the hand (10 %: children, men), and a marker that sits 1.5 mm or 2.5 degrees elsewhere. Any number
    of frames of one hand says nothing about it.

    Parameters
    ----------
    flat : FlatHand
    rigid_anchors : bool
        Whether the anchors are corners of one marker.

    Returns
    -------
    ndarray (k, 15 a + 105)
        The size first.
    """
    points, anchors = flat.points_m, flat.anchors_m
    still_points, still = np.zeros_like(points), np.zeros_like(anchors)
    centre = anchors.mean(axis=0)
    size_of_anchors = still if rigid_anchors else SIZE_SHARE * (anchors - centre)
    rows = [flat.change(SIZE_SHARE * (points - centre), size_of_anchors)]
    if rigid_anchors:
        for axis in (0, 1):
            rows.append(flat.change(still_points, still + _SHIFT_M * np.eye(2)[axis]))
        rows.append(flat.change(still_points, _TURN * _quarter(anchors - centre)))
    return np.array(rows)


def changes_between_frames(flat: FlatHand, *, rigid_anchors: bool) -> FloatArray:
    """How distances differ from frame to frame, each row one standard deviation.

    Fingers' spread (4 degrees) and length (3 %: bent skin); palm landmarks that each stray by 4 mm.
    """
    points, anchors = flat.points_m, flat.anchors_m
    still_points, still = np.zeros_like(points), np.zeros_like(anchors)
    rows = []
    if not rigid_anchors:
        for k in range(len(anchors)):
            for axis in (0, 1):
                shift = still.copy()
                shift[k, axis] = _PALM_SHIFT_M
                rows.append(flat.change(still_points, shift))
    finger = np.array(FINGER_OF)
    for number in range(5):
        own = finger == number
        knuckle = points[3 * number + 2]
        rows.append(flat.change(np.where(own[:, None], _SPREAD * _quarter(points - knuckle), 0.0), still))
        rows.append(flat.change(np.where(own[:, None], _STRETCH * (points - knuckle), 0.0), still))
    return np.array(rows)


def _quarter(vectors: FloatArray) -> FloatArray:
    """Vectors turned by a quarter."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)
