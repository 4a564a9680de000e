"""The thesis's own way to the points (chapter 4): bands, candidates, clusters, and eq. 7 point after point.

Kept for comparison: a model's means are taken as they are, without its modes. A vertex has a vote from every
anchor whose distance agrees to within a band. The most voted vertices are a point's candidates; they are
clustered, and the centre of the biggest cluster is its place. Where candidates of one finger fall on
another, the candidate is taken that minimises eq. 7, ``f = || C'_t - dB ||_1``: the sum over the other points
of how far its distances to their centres stray from the learned ones, with the others fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics.solver import GeodesicSolver
from core.hand.fitting import MEASURED_SIGMA_M, HandFit, Hint
from core.hand.model import OWN_FIELDS, POINTS, ConfigurationModel
from core.hand.names import FINGER_OF, PAIRS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BAND_M = 0.008
"""Half width of a band; the learned deviation comes to it."""

_CLUSTER_M = 0.006
_MOST_CANDIDATES = 400
_LEAST_VOTE_SHARE = 0.75
_SELDOM = 0.2
_NEIGHBOUR_M = 0.012
_SWEEPS = 2
_ALIKE = 0.8

_I, _J = np.array(PAIRS).T


@dataclass
class _Point:
    """Candidates of one point, and which one is taken."""

    candidates: IntArray
    clusters: int
    vertex: int


def fit_sequentially(
    model: ConfigurationModel,
    vertices_m: FloatArray,
    distances_m: FloatArray,
    solver: GeodesicSolver,
    hint: Hint | None = None,
    measured_sigma_m: float = MEASURED_SIGMA_M,
) -> HandFit:
    """Find the points of one configuration as the thesis does; as `fitting.fit_configuration`.

    ``hint`` only breaks ties: among clusters of about the same size, the one nearest to where the point was.
    """
    expected, expected_pair = model.expected(np.zeros(len(model.modes_m)))
    anchors = np.asarray(~np.isnan(distances_m).all(axis=1))
    anchors[-OWN_FIELDS:] = False
    extra = max(measured_sigma_m - MEASURED_SIGMA_M, 0.0)
    found: dict[int, _Point] = {}
    for p in np.flatnonzero(model.seen > _SELDOM):
        point = _vote(model, vertices_m, distances_m, anchors, int(p), hint, BAND_M + extra)
        if point is not None:
            found[int(p)] = point
    fields = {p: solver.distances([point.vertex])[0] for p, point in found.items()}
    table = np.full((POINTS, POINTS), np.nan)
    table[_I, _J] = table[_J, _I] = expected_pair
    for _ in range(_SWEEPS):
        moved = [_refine(p, found, fields, table, vertices_m, solver) for p in sorted(found)]
        if not any(moved):
            break
    return _answer(model, found, fields, vertices_m, distances_m, expected, expected_pair, anchors)


def _vote(
    model: ConfigurationModel,
    vertices_m: FloatArray,
    distances_m: FloatArray,
    anchors: NDArray[np.bool_],
    p: int,
    hint: Hint | None,
    band_m: float,
) -> _Point | None:
    """Candidates (the histogram's highest bin), and the centre of the biggest cluster."""
    wanted = model.expected(np.zeros(len(model.modes_m)))[0][p, anchors]
    known = np.isfinite(wanted)
    if not known.any():
        return None
    band = band_m + np.nan_to_num(model.anchor_sigma_m[p, anchors][known])
    off = np.abs(distances_m[anchors][known] - wanted[known, None])
    votes = (off < band[:, None]).sum(axis=0)
    most = int(votes.max())
    if most < _LEAST_VOTE_SHARE * known.sum():
        return None
    candidates = np.flatnonzero(votes == most)
    if len(candidates) > _MOST_CANDIDATES:
        nearest = off[:, candidates].sum(axis=0).argsort(kind="stable")[:_MOST_CANDIDATES]
        candidates = candidates[nearest]
    labels = _clusters(vertices_m[candidates])
    sizes = np.bincount(labels).astype(float)
    if hint is not None and np.isfinite(hint.near_m[p]).all():
        centres = np.array([vertices_m[candidates[labels == k]].mean(axis=0) for k in range(len(sizes))])
        off = np.linalg.norm(centres - hint.near_m[p], axis=1)
        sizes = np.where(sizes > _ALIKE * sizes.max(), 1.0 / (off + 1e-3), 0.0)
    biggest = candidates[labels == int(np.argmax(sizes))]
    return _Point(candidates, len(sizes), _central(vertices_m, biggest))


def _clusters(places_m: FloatArray) -> IntArray:
    """Number (n,) of the cluster of each place: those within reach of one another, step by step."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(places_m).query_pairs(_CLUSTER_M, output_type="ndarray")
    ones = np.ones(len(pairs))
    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(len(places_m),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _central(vertices_m: FloatArray, members: IntArray) -> int:
    """The member nearest to the mean."""
    off = vertices_m[members] - vertices_m[members].mean(axis=0)
    return int(members[np.argmin((off**2).sum(axis=1))])


def _refine(
    p: int,
    found: dict[int, _Point],
    fields: dict[int, FloatArray],
    table: FloatArray,
    vertices_m: FloatArray,
    solver: GeodesicSolver,
) -> bool:
    """Eq. 7 for one point, if its candidates lie on more than one finger; whether it has moved."""
    point = found[p]
    others = [q for q in found if q != p and np.isfinite(table[p, q])]
    if not others or not (point.clusters > 1 or _beside_another(p, found, vertices_m)):
        return False
    off = np.array([np.abs(fields[q][point.candidates] - table[p, q]) for q in others])
    best = int(point.candidates[np.argmin(np.minimum(off, 1.0).sum(axis=0))])
    if best == point.vertex:
        return False
    point.vertex = best
    fields[p] = solver.distances([best])[0]
    return True


def _beside_another(p: int, found: dict[int, _Point], vertices_m: FloatArray) -> bool:
    """Whether the point's place is that of a point of another finger."""
    place = vertices_m[found[p].vertex]
    return any(
        FINGER_OF[q] != FINGER_OF[p]
        and float(np.linalg.norm(vertices_m[point.vertex] - place)) < _NEIGHBOUR_M
        for q, point in found.items()
    )


def _answer(
    model: ConfigurationModel,
    found: dict[int, _Point],
    fields: dict[int, FloatArray],
    vertices_m: FloatArray,
    distances_m: FloatArray,
    expected: FloatArray,
    expected_pair: FloatArray,
    anchors: NDArray[np.bool_],
) -> HandFit:
    points = np.full((POINTS, 3), np.nan)
    vertex = np.full(POINTS, -1, np.int64)
    anchor_error, pair_error, spread, cost, end = (np.full(POINTS, np.nan) for _ in range(5))
    between = np.full((POINTS, POINTS), np.nan)
    sigma = model.anchor_sigma_m
    for p, point in found.items():
        points[p], vertex[p] = vertices_m[point.vertex], point.vertex
        for q, other in found.items():
            between[p, q] = fields[p][other.vertex]
        off = distances_m[:, point.vertex] - expected[p]
        anchor_error[p] = np.sqrt(np.nanmean(off[anchors] ** 2))
        cost[p] = float(np.nansum((off[anchors] / (sigma[p, anchors] + BAND_M)) ** 2))
        end[p] = off[-1]
        places = vertices_m[point.candidates] - points[p]
        spread[p] = float(np.sqrt((places**2).sum(axis=1).mean()))
    mean = 0.5 * (between[_I, _J] + between[_J, _I])
    pair = np.where(np.isfinite(mean), mean, np.nan)
    for p in found:
        own = np.abs(pair - expected_pair)[(p == _I) | (p == _J)]
        if np.isfinite(own).any():
            pair_error[p] = np.nanmedian(own)
    return HandFit(
        model.name,
        points,
        vertex,
        anchor_error,
        pair_error,
        spread,
        cost,
        end,
        0.0,
        pair,
        np.where(np.isfinite(pair), expected_pair, np.nan),
        np.zeros(len(model.modes_m)),
    )
