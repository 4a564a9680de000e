"""Where the 15 points lie on a hand's surface: solved jointly over all points (after thesis eq. 7).

Every vertex has its distances to the anchors, and a point lies where they agree best with the model. Which
place of each point is right is decided together: by the distances between the points, measured along the
skin from where the others were put. What the places say about the size of the hand, the sitting of the
marker and the bend of the fingers goes back into the model's modes, and all is looked for anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics.solver import GeodesicSolver
from core.hand.model import OWN_FIELDS, POINTS, ConfigurationModel, coefficients
from core.hand.names import PAIRS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_I, _J = np.array(PAIRS).T

MEASURED_SIGMA_M = 0.002
"""Of a distance along the skin, measured from an anchor that is seen."""

_PAIR_SIGMA_M = 0.003
_COST_CAP = 60.0
_PAIR_CAP = 9.0
_PAIR_SHARE = 6.0
_PAIR_WEIGHT = 0.1
_ABSENT_COST = 25.0
_SELDOM, _OFTEN = 0.05, 0.5
_ROUNDS = 3
_SWEEPS = 3
_HINTED_SWEEPS = 2
_SIZES = (-0.26, -0.13, 0.0, 0.13)
"""A child's hand is a quarter smaller than what was learned from adults."""

_OTHER_HAND = 0.7
_MOVED_M = 0.002
"""About a vertex: a field is not measured anew for less."""
_LAST_MOVED_M = 0.004
"""After the last sweep of a hand that is followed: nothing is solved with these fields any more."""


_TAIL = 4.0
_REACH_M = 0.008
_NEAR_CAP = 9.0
_FAR_M = 10.0
_STRAIGHT = 0.8
_OWN_CAP = 6.0
_QUICK_OWN_CAP = 30.0


@dataclass(frozen=True, eq=False)
class Hint:
    """What the frames before say.

    Attributes
    ----------
    b : ndarray (k,)
        Mode coefficients.
    near_m : ndarray (15, 3)
        Where points are expected, NaN if not known.
    near_sigma_m : float
    trust : float
        Inverse variance of the coefficients.
    """

    b: FloatArray
    near_m: FloatArray
    near_sigma_m: float = 0.02
    trust: float = 2.0


@dataclass(frozen=True, eq=False)
class HandFit:
    """Answer for one configuration.

    Attributes
    ----------
    configuration : str
    points_m : ndarray (15, 3)
        NaN for points that the surface does not show.
    vertices : ndarray (15,) int64
        Vertex nearest to each point, -1 where absent.
    anchor_error_m : ndarray (15,)
        RMS difference between the point's distances to the anchors and the model's, NaN where absent.
    pair_error_m : ndarray (15,)
        Median absolute difference between its distances to the other points and the model's.
    spread_m : ndarray (15,)
        How far the places reach that are about as likely.
    cost : ndarray (15,)
        Of each point's place, NaN where absent.
    end_error_m : ndarray (15,)
        How much more skin there is beyond the point than by the model, NaN where absent.
    unexplained_m : float
        How far skin goes on beyond the points, away from the anchors.
    pair_m, expected_pair_m : ndarray (105,)
        Distances between the points, measured and by the model.
    b : ndarray (k,)
        Mode coefficients.
    """

    configuration: str
    points_m: FloatArray
    vertices: IntArray
    anchor_error_m: FloatArray
    pair_error_m: FloatArray
    spread_m: FloatArray
    cost: FloatArray
    end_error_m: FloatArray
    unexplained_m: float
    pair_m: FloatArray
    expected_pair_m: FloatArray
    b: FloatArray


def fit_configuration(
    model: ConfigurationModel,
    vertices_m: FloatArray,
    distances_m: FloatArray,
    solver: GeodesicSolver,
    hint: Hint | None = None,
    measured_sigma_m: float = MEASURED_SIGMA_M,
) -> HandFit:
    """Find the points of one configuration.

    Parameters
    ----------
    model : ConfigurationModel
    vertices_m : ndarray (n, 3)
    distances_m : ndarray (a + 2, n)
        Of every vertex (`core.hand.fields`).
    solver : GeodesicSolver
        Of the same surface.
    hint : Hint, optional
        Without it several sizes of hand are tried.
    measured_sigma_m : float
        Of the measured distances; larger where the anchors are less sure than usual.
    """
    search = _Search(model, vertices_m, distances_m, hint, measured_sigma_m)
    if hint is not None:
        return search.jointly(hint.b, solver)
    starts = [search.quickly(sized(model, larger)) for larger in _SIZES]
    tried = [search.jointly(b, solver) for b in _different(sorted(starts, key=search.misfit))]
    return min(tried, key=search.disagreement)


def sized(model: ConfigurationModel, larger: float) -> FloatArray:
    """Mode coefficients (k,) of a hand that is larger than the mean by this share."""
    weight = np.where(np.isfinite(model.sigma_m), model.sigma_m, np.inf) ** -2.0
    return coefficients(larger * model.mean_m, model.modes_m, weight)


def size_share(model: ConfigurationModel, b: FloatArray) -> float:
    """By which share a hand of these coefficients is larger than the mean."""
    usual, own = model.expected(np.zeros(len(b)))[0], model.expected(b)[0]
    hard = slice(None, -OWN_FIELDS)
    return float(np.nanmean(own[:, hard]) / np.nanmean(usual[:, hard]) - 1.0)


def _different(starts: list[FloatArray]) -> list[FloatArray]:
    """The best start, and the best of those that mean another hand: fingers may have changed places."""
    others = [b for b in starts[1:] if np.linalg.norm(b - starts[0]) > _OTHER_HAND]
    return [starts[0], *others[:1]]


class _Search:
    def __init__(
        self,
        model: ConfigurationModel,
        vertices: FloatArray,
        distances: FloatArray,
        hint: Hint | None,
        measured_sigma_m: float,
    ) -> None:
        self._model = model
        self._vertices = np.ascontiguousarray(vertices)
        missing = np.asarray(np.isnan(distances).all(axis=1))
        self._distances = np.ascontiguousarray(np.where(missing[:, None], 0.0, distances))
        self._values = np.ascontiguousarray(np.minimum(self._distances, _FAR_M).T)
        self._hint = hint
        variance = model.anchor_sigma_m**2 + measured_sigma_m**2
        self._weight = np.where(np.isfinite(variance) & ~missing, 1.0 / variance, 0.0)
        self._missing = missing
        self._likely = (model.seen > _SELDOM) & (self._weight > 0).any(axis=1)
        variance = model.sigma_m**2 + measured_sigma_m**2
        self._inverse = np.where(np.isfinite(variance), 1.0 / variance, 0.0)
        self._inverse[POINTS * model.fields :] *= _PAIR_WEIGHT  # pairs repeat what the points say
        self._cost = np.empty((POINTS, len(vertices)))

    def _anchor_costs(self, b: FloatArray, own_cap: float = 0.0) -> FloatArray:
        """Cost (15, n) of every vertex for every point by the anchors; overwritten by the next call."""
        from core.hand.fit_kernels import anchor_costs

        near, near_weight = np.full((POINTS, 3), np.nan), 0.0
        if self._hint is not None:
            near, near_weight = self._hint.near_m, 1.0 / self._hint.near_sigma_m**2
        expected = np.nan_to_num(self._model.expected(b)[0])
        anchor_costs(
            self._values,
            expected,
            self._weight,
            self._likely,
            self._vertices,
            near,
            near_weight,
            _NEAR_CAP,
            OWN_FIELDS,
            own_cap or _OWN_CAP,
            _COST_CAP,
            self._cost,
        )
        return self._cost

    def misfit(self, b: FloatArray) -> float:
        """How badly a hand of these coefficients fits at all."""
        cost = self._anchor_costs(b, _QUICK_OWN_CAP)[self._likely]
        return float(np.minimum(cost.min(axis=1), _COST_CAP).sum() + b @ b) if len(cost) else np.inf

    def disagreement(self, fit: HandFit) -> float:
        """How badly a joint answer agrees with the model, with its absent points."""
        due = self._likely & (self._model.seen > _OFTEN)
        cost = np.where(np.isfinite(fit.cost), fit.cost, np.where(due, _ABSENT_COST, 0.0))
        return float(cost.sum() + fit.b @ fit.b)

    def quickly(self, b: FloatArray) -> FloatArray:
        """Coefficients by the anchors alone, from a start."""
        for _ in range(_ROUNDS):
            cost = self._anchor_costs(b, _QUICK_OWN_CAP)
            chosen = cost.argmin(axis=1)
            there = cost[np.arange(POINTS), chosen] < _COST_CAP
            b = self._update(b, np.where(there, chosen, -1), np.full(len(PAIRS), np.nan))
        return b

    def jointly(self, b: FloatArray, solver: GeodesicSolver) -> HandFit:
        """Points and coefficients by anchors and by one another."""
        from core.hand.fit_kernels import joint_costs, steady_vertex

        cost = self._anchor_costs(b)
        vertex = cost.argmin(axis=1)
        chosen = cost[np.arange(POINTS), vertex] < _ABSENT_COST
        for p in np.flatnonzero(chosen):
            vertex[p] = steady_vertex(cost[p], self._vertices, vertex[p], _REACH_M)
        fields = np.full(cost.shape, np.inf)
        source = np.full(POINTS, -1, np.int64)
        total = np.full(cost.shape, np.inf)
        weight = self._pair_weight()
        for sweep in range(_SWEEPS if self._hint is None else _HINTED_SWEEPS):
            self._renew(fields, source, vertex, chosen, solver)
            if sweep:
                b = self._update(b, np.where(chosen, vertex, -1), self._pairs(fields, vertex, chosen))
                cost = self._anchor_costs(b)
            expected = self._pair_table(b)
            for p in np.flatnonzero(self._likely):
                best = joint_costs(
                    p, cost[p], _COST_CAP, fields, chosen, expected, weight, _PAIR_CAP, _PAIR_SHARE, total[p]
                )
                chosen[p] = best >= 0 and total[p, best] < _ABSENT_COST
                if best >= 0:
                    vertex[p] = steady_vertex(total[p], self._vertices, best, _REACH_M)
        self._renew(fields, source, vertex, chosen, solver, _MOVED_M if self._hint is None else _LAST_MOVED_M)
        return self._answer(b, vertex, chosen, fields, total)

    def _renew(
        self,
        fields: FloatArray,
        source: IntArray,
        vertex: IntArray,
        chosen: NDArray[np.bool_],
        solver: GeodesicSolver,
        tolerance_m: float = _MOVED_M,
    ) -> None:
        """Distance fields from the points that have moved since their field was made."""
        moved = np.linalg.norm(self._vertices[vertex] - self._vertices[source], axis=1) > tolerance_m
        rows = np.flatnonzero(chosen & (moved | (source < 0)))
        if len(rows):
            # a field takes half a millisecond: handing it to another thread takes longer
            fields[rows] = solver.distances([int(v) for v in vertex[rows]], threads=1)
            source[rows] = vertex[rows]

    def _pairs(self, fields: FloatArray, vertex: IntArray, chosen: NDArray[np.bool_]) -> FloatArray:
        """Distances (105,) between the chosen places; NaN where there is none."""
        between = fields[:, vertex]
        with np.errstate(invalid="ignore"):
            mean = 0.5 * (between[_I, _J] + between[_J, _I])
        return np.where(chosen[_I] & chosen[_J] & np.isfinite(mean), mean, np.nan)

    def _pair_table(self, b: FloatArray) -> FloatArray:
        table = np.zeros((POINTS, POINTS))
        table[_I, _J] = table[_J, _I] = np.nan_to_num(self._model.expected(b)[1])
        return table

    def _pair_weight(self) -> FloatArray:
        variance = self._model.pair_sigma_m**2 + _PAIR_SIGMA_M**2
        weight = np.where(np.isfinite(variance), 1.0 / variance, 0.0)
        table = np.zeros((POINTS, POINTS))
        table[_I, _J] = table[_J, _I] = weight
        return table

    def _update(self, b: FloatArray, vertex: IntArray, pair_m: FloatArray) -> FloatArray:
        """Coefficients by what was measured at the places; distances that stray count little."""
        model = self._model
        measured = np.full((POINTS, model.fields), np.nan)
        there = vertex >= 0
        measured[there] = self._distances[:, vertex[there]].T
        measured[:, self._missing] = np.nan
        measured[~np.isfinite(measured)] = np.nan
        difference = np.concatenate([measured.ravel(), pair_m]) - model.mean_m
        for _ in range(2):
            off = (difference - b @ model.modes_m) ** 2 * self._inverse
            weight = self._inverse / (1.0 + np.nan_to_num(off) / _TAIL)
            if self._hint is None:
                b = coefficients(difference, model.modes_m, weight)
            else:
                b = coefficients(difference, model.modes_m, weight, self._hint.b, self._hint.trust)
        return b

    def _unexplained(self, fields: FloatArray, vertex: IntArray) -> float:
        """Largest distance from all points of skin that lies straight beyond one of them."""
        if len(vertex) == 0:
            return 0.0
        away = self._distances[:-OWN_FIELDS][~self._missing[:-OWN_FIELDS]].mean(axis=0)
        with np.errstate(invalid="ignore"):
            beyond = (away[None] - away[vertex, None] >= _STRAIGHT * fields).any(axis=0)
        nearest = fields.min(axis=0)
        reached = beyond & np.isfinite(nearest)
        return float(nearest[reached].max()) if reached.any() else 0.0

    def _answer(
        self,
        b: FloatArray,
        vertex: IntArray,
        chosen: NDArray[np.bool_],
        fields: FloatArray,
        total: FloatArray,
    ) -> HandFit:
        """Places between vertices, and how sure they are."""
        from core.hand.fit_kernels import weighted_place

        points = np.full((POINTS, 3), np.nan)
        anchor_error, spread, cost, end = (np.full(POINTS, np.nan) for _ in range(4))
        expected, expected_pair = self._model.expected(b)
        for p in np.flatnonzero(chosen):
            v = int(vertex[p])
            *place, spread[p] = weighted_place(total[p], self._vertices, v, _REACH_M)
            points[p] = place
            cost[p] = total[p, v]
            off = self._distances[:, v] - expected[p]
            anchor_error[p] = np.sqrt(np.nanmean(off[:-OWN_FIELDS][~self._missing[:-OWN_FIELDS]] ** 2))
            end[p] = off[-1]
        pair = self._pairs(fields, vertex, chosen)
        off = np.abs(pair - expected_pair)
        pair_error = np.full(POINTS, np.nan)
        for p in np.flatnonzero(chosen):
            own = off[(p == _I) | (p == _J)]
            if np.isfinite(own).any():
                pair_error[p] = np.nanmedian(own)
        return HandFit(
            self._model.name,
            points,
            np.where(chosen, vertex, -1),
            anchor_error,
            pair_error,
            spread,
            cost,
            end,
            self._unexplained(fields[chosen], vertex[chosen]),
            pair,
            np.where(np.isfinite(pair), expected_pair, np.nan),
            b,
        )
