"""Matching the moles of two visits as a constellation (METHOD sections 3 and 4).

The registration says where every spot of the first visit should appear. What it leaves is a smooth drift:
skin that slid, a limb that turned. The drift is a Gaussian process over the first skin, learned from spots
whose counterpart is beyond doubt and extended to the others; where a whole neighbourhood drifted farther
than that, one pair of spots with its normals gives a local motion, and the neighbours vote on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

LENGTH_M = 0.15
"""Over this distance drifts of the skin are alike."""
NOISE_M = 0.003
"""Of a spot's own place in both visits."""
GATE = 3.5
"""A spot farther than this many standard deviations is another one."""
ROUNDS = 6
FIRST_MARGIN, LAST_MARGIN = 4.0, 0.5
"""How much better than the next one a match must be, in the first round and in the last."""

NEIGHBOURHOOD_M = 0.13
REACH_M = 0.11
MOST_NEIGHBOURS = 24
TURNS_RAD = np.arange(-6, 7) * 0.1
VOTE_FLOOR_M, VOTE_STRETCH = 0.003, 0.03
SEEN = 0.8
DRIFT_M = 0.035
LEAST_SCORE = 3.0
LEAST_VOTES = 2


@dataclass(frozen=True, eq=False)
class Side:
    """Spots of the first visit as they are expected on the follow-up's skin.

    Attributes
    ----------
    coordinates : ndarray (m, d)
        Where a spot is on the first skin, such that near coordinates drift alike.
    predicted, normals : ndarray (m, 3)
    drift_m : ndarray (m,)
        Spread of each one's drift.
    """

    coordinates: FloatArray
    predicted: FloatArray
    normals: FloatArray
    drift_m: FloatArray


@dataclass(frozen=True, eq=False)
class Matching:
    """Which spot of the follow-up each one of the first visit is.

    Attributes
    ----------
    partner : ndarray (m,)
        Row of the follow-up's spots; -1 for none.
    sure : ndarray (m,) bool
        Whether the match is beyond doubt and carries others.
    expected : ndarray (m, 3)
        Mean of the drift process: where the spot should be.
    sigma_m : ndarray (m,)
        Its standard deviation per axis.
    """

    partner: IntArray
    sure: BoolArray
    expected: FloatArray
    sigma_m: FloatArray


def match_spots(
    side: Side,
    spots: FloatArray,
    looks: FloatArray,
    *,
    known: dict[int, int] | None = None,
    held: Mapping[int, FloatArray] | None = None,
) -> Matching:
    """Match by expected place and looks, the surest first.

    Parameters
    ----------
    spots : ndarray (k, 3)
        Of the follow-up.
    looks : ndarray (m, k)
        Cost of looking different, -2 log likelihood ratio.
    known : mapping of first row to follow-up row, optional
        Matches that are certain.
    held : mapping of first row to place (3,), optional
        Rows whose place is certain though it need not be a spot: they carry the drift of the others.
    """
    count = len(side.predicted)
    prior = float(np.median(side.drift_m)) if count else 1.0
    scale = np.maximum(side.drift_m / prior, 1.0)
    expected, sigma = side.predicted.copy(), np.hypot(side.drift_m, NOISE_M)
    partner, sure = np.full(count, -1, np.int32), np.zeros(count, bool)
    fixed = np.array(sorted(held or {}), np.int64)
    places = np.array([(held or {})[int(row)] for row in fixed]).reshape(-1, 3)
    if len(fixed):
        expected, sigma = _drifted(side, fixed, places, prior, scale)
    if count == 0 or len(spots) == 0:
        return Matching(partner, sure, expected, sigma)
    certain = known or {}
    for turn in range(ROUNDS):
        square = ((expected[:, None] - spots[None]) ** 2).sum(axis=2)
        cost = square / sigma[:, None] ** 2 + looks
        partner, sure = mutual_best(cost, max(FIRST_MARGIN - turn, LAST_MARGIN))
        for one, two in certain.items():
            partner[partner == two] = -1
            partner[one], sure[one] = two, True
        sure &= partner >= 0
        rows = _consistent(side, spots, partner, sure, prior, set(certain))
        sure[:] = False
        sure[rows] = True
        free = rows[~np.isin(rows, fixed)]
        every = np.concatenate([free, fixed])
        if len(every):
            goals = np.concatenate([spots[partner[free]], places])
            expected, sigma = _drifted(side, every, goals, prior, scale)
    return Matching(partner, sure, expected, sigma)


def _drifted(
    side: Side, rows: NDArray[np.int64], goals: FloatArray, prior: float, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Expected places (m, 3) and their spread (m,), given where ``rows`` lie."""
    mean, spread = drift_process(side.coordinates, rows, goals - side.predicted[rows], prior)
    return side.predicted + mean, np.hypot(spread * scale, NOISE_M)


def mutual_best(cost: FloatArray, margin: float) -> tuple[IntArray, BoolArray]:
    """Best partner of every row that is also that column's best row, and whether both are so by a margin."""
    rows, columns = cost.shape
    best = cost.argmin(axis=1)
    own = cost[np.arange(rows), best]
    back = cost.argmin(axis=0)
    mutual = (back[best] == np.arange(rows)) & (own < GATE**2)
    second = np.partition(cost, 1, axis=1)[:, 1] if columns > 1 else np.full(rows, np.inf)
    rival = np.partition(cost, 1, axis=0)[1] if rows > 1 else np.full(columns, np.inf)
    clear = mutual & (second - own > margin) & (rival[best] - own > margin)
    return np.where(mutual, best, -1).astype(np.int32), clear


def _consistent(
    side: Side, spots: FloatArray, partner: IntArray, sure: BoolArray, prior: float, certain: set[int]
) -> NDArray[np.int64]:
    """Sure matches that the others bear out (closed-form leave-one-out of the drift process)."""
    rows = np.flatnonzero(sure)
    for _ in range(3):
        if len(rows) < 2:
            break
        drift = spots[partner[rows]] - side.predicted[rows]
        inverse = np.linalg.inv(
            _kernel(side.coordinates[rows], side.coordinates[rows], prior) + np.eye(len(rows)) * NOISE_M**2
        )
        diagonal = np.diag(inverse)
        off = np.linalg.norm(inverse @ drift / diagonal[:, None], axis=1) * np.sqrt(diagonal)
        wrong = (off > GATE) & ~np.isin(rows, list(certain))
        if not wrong.any():
            break
        rows = rows[~wrong]
    return rows


def _kernel(one: FloatArray, two: FloatArray, prior: float) -> FloatArray:
    square = ((one[:, None] - two[None]) ** 2).sum(axis=2)
    return np.asarray(prior**2 * np.exp(-square / (2.0 * LENGTH_M**2)))


def drift_process(
    coordinates: FloatArray, rows: NDArray[np.int64], drift: FloatArray, prior: float
) -> tuple[FloatArray, FloatArray]:
    """Mean (m, 3) and standard deviation (m,) of the drift everywhere, given it at ``rows``."""
    gram = _kernel(coordinates[rows], coordinates[rows], prior) + np.eye(len(rows)) * NOISE_M**2
    cross = _kernel(coordinates, coordinates[rows], prior)
    solved = np.linalg.solve(gram, np.concatenate([drift, cross.T], axis=1))
    mean = cross @ solved[:, :3]
    variance = prior**2 - np.einsum("ij,ji->i", cross, solved[:, 3:])
    return mean, np.sqrt(np.maximum(variance, 1e-9))


def vote_locally(
    side: Side, spots: FloatArray, spot_normals: FloatArray, looks: FloatArray
) -> dict[int, int]:
    """Matches that whole neighbourhoods agree on, for drifts beyond the gate of `match_spots`."""
    from scipy.spatial import cKDTree

    from core.relocation.constellation_kernels import vote_motions

    count = len(side.predicted)
    if count < 3 or len(spots) < 3:
        return {}
    start, neighbours = _neighbourhoods(side)
    reach = np.array([len(g) for g in cKDTree(spots).query_ball_point(spots, 0.06)])
    density = float(np.median(reach)) / (np.pi * 0.06**2)
    best, score, margin, partner = vote_motions(
        side.predicted,
        side.normals,
        start,
        neighbours,
        np.ascontiguousarray(spots),
        np.ascontiguousarray(spot_normals),
        looks.astype(np.float32),
        REACH_M,
        TURNS_RAD,
        VOTE_FLOOR_M,
        VOTE_STRETCH,
        density,
        SEEN,
        DRIFT_M,
    )
    votes: dict[tuple[int, int], float] = {}
    for i in np.flatnonzero((best >= 0) & (score > LEAST_SCORE) & (margin > LEAST_SCORE)):
        own = (int(i), int(best[i]))
        votes[own] = votes.get(own, 0.0) + 1.0
        for place in range(start[i], start[i + 1]):
            if partner[place] >= 0:
                key = (int(neighbours[place]), int(partner[place]))
                votes[key] = votes.get(key, 0.0) + 1.0
    out: dict[int, int] = {}
    taken: set[int] = set()
    for (one, two), number in sorted(votes.items(), key=lambda item: -item[1]):
        if number > LEAST_VOTES and one not in out and two not in taken:
            out[one] = two
            taken.add(two)
    return out


def _neighbourhoods(side: Side) -> tuple[IntArray, IntArray]:
    """Nearest spots of every spot on the first skin, in compressed rows."""
    from scipy.spatial import cKDTree

    tree = cKDTree(side.coordinates)
    distance, index = tree.query(
        side.coordinates,
        k=min(MOST_NEIGHBOURS + 1, len(side.coordinates)),
        distance_upper_bound=NEIGHBOURHOOD_M,
    )
    keep = np.isfinite(distance) & (index != np.arange(len(index))[:, None])
    start = np.concatenate([[0], np.cumsum(keep.sum(axis=1))]).astype(np.int32)
    return start, index[keep].astype(np.int32)
