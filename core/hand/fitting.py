"""Where the 15 points lie on a hand's surface: solved jointly over all points (after thesis eq. 7).

Every vertex has its distances to the anchors. A point's candidates are the places whose distances agree best
with the model; which candidate of each point is right is decided together, by the distances between the
points; what the chosen ones say about the size of the hand and the sitting of the marker goes back into the
model's modes, and the candidates are found anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics.solver import GeodesicSolver
from core.hand.model import POINTS, ConfigurationModel, coefficients
from core.hand.names import PAIRS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CANDIDATES = 4
_APART_M = 0.008
_MEASURED_SIGMA_M = 0.002
_PAIR_SIGMA_M = 0.003
_COST_CAP = 60.0
_PAIR_CAP = 9.0
_ABSENT_COST = 30.0
_SELDOM = 0.2
_ROUNDS = 4
_SWEEPS = 5
_STARTS = (-1.5, 0.0, 1.5)


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
    cost : float
        Mean cost of a point that the configuration should show; comparable between configurations.
    b : ndarray (k,)
        Mode coefficients.
    """

    configuration: str
    points_m: FloatArray
    vertices: IntArray
    anchor_error_m: FloatArray
    cost: float
    b: FloatArray


def fit_configuration(
    model: ConfigurationModel,
    vertices_m: FloatArray,
    distances_m: FloatArray,
    solver: GeodesicSolver,
    *,
    b: FloatArray | None = None,
    near_m: FloatArray | None = None,
    near_sigma_m: float = 0.03,
) -> HandFit:
    """Find the points of one configuration.

    Parameters
    ----------
    model : ConfigurationModel
    vertices_m : ndarray (n, 3)
    distances_m : ndarray (a, n)
        Geodesic fields of the anchors.
    solver : GeodesicSolver
        Of the same surface.
    b : ndarray (k,), optional
        Coefficients of the frame before; without it several sizes of hand are tried.
    near_m : ndarray (15, 3), optional
        Where the points were (NaN: unknown), already moved with the marker: temporal continuity.
    near_sigma_m : float
    """
    starts = [b] if b is not None else [np.eye(len(model.modes_m))[0] * s for s in _STARTS]
    tries = []
    for start in starts:
        search = _Search(model, vertices_m, distances_m, near_m, near_sigma_m)
        quick = search.run(start, None)
        tries.append((search.unary_total(quick), quick))
    best = min(tries, key=lambda t: t[0])[1]
    search = _Search(model, vertices_m, distances_m, near_m, near_sigma_m)
    return search.finish(search.run(best, solver))


class _Search:
    def __init__(
        self,
        model: ConfigurationModel,
        vertices: FloatArray,
        distances: FloatArray,
        near: FloatArray | None,
        near_sigma: float,
    ) -> None:
        self._model, self._vertices, self._distances = model, vertices, distances
        variance = model.anchor_sigma_m**2 + _MEASURED_SIGMA_M**2
        self._weight = np.where(np.isfinite(variance), 1.0 / variance, 0.0)
        self._likely = (model.seen > _SELDOM) & (self._weight > 0).all(axis=1)
        self._pull = np.zeros((POINTS, len(vertices)))
        if near is not None:
            for p in np.flatnonzero(np.isfinite(near).all(axis=1)):
                off = ((vertices - near[p]) ** 2).sum(axis=1) / near_sigma**2
                self._pull[p] = np.minimum(off, 9.0)
        self._chosen = np.full(POINTS, -1, np.int64)

    def unary(self, b: FloatArray) -> FloatArray:
        """Cost (15, n) of every vertex for every point; large for points the configuration never shows."""
        expected, _ = self._model.expected(b)
        cost = np.full((POINTS, len(self._vertices)), np.inf)
        for p in np.flatnonzero(self._likely):
            off = self._distances - expected[p][:, None]
            cost[p] = np.minimum((off**2 * self._weight[p][:, None]).sum(axis=0), 1e6) + self._pull[p]
        return cost

    def unary_total(self, b: FloatArray) -> float:
        """Sum of each point's best cost, capped: how well a hand of these coefficients fits at all."""
        cost = self.unary(b)[self._likely]
        return float(np.minimum(cost.min(axis=1), _COST_CAP).sum() + b @ b) if len(cost) else np.inf

    def run(self, b: FloatArray, solver: GeodesicSolver | None) -> FloatArray:
        """Alternate between candidates, choice and coefficients; without a solver pairs do not count."""
        for _ in range(_ROUNDS):
            cost = self.unary(b)
            candidates, values = self._candidates(cost)
            pair = None if solver is None else self._pair_distances(candidates, solver)
            self._chosen, pair_m = self._choose(b, candidates, values, pair)
            b = self._update(pair_m)
        return b

    def _candidates(self, cost: FloatArray) -> tuple[IntArray, FloatArray]:
        """Vertices (15, c) of the best separate places of every point, -1 for none, and their costs."""
        chosen = np.full((POINTS, CANDIDATES), -1, np.int64)
        values = np.full((POINTS, CANDIDATES), np.inf)
        for p in np.flatnonzero(self._likely):
            left = cost[p].copy()
            for c in range(CANDIDATES):
                v = int(np.argmin(left))
                if left[v] > _COST_CAP:
                    break
                chosen[p, c], values[p, c] = v, left[v]
                close = ((self._vertices - self._vertices[v]) ** 2).sum(axis=1) < _APART_M**2
                left[close] = np.inf
        return chosen, values

    def _pair_distances(self, candidates: IntArray, solver: GeodesicSolver) -> FloatArray:
        """Geodesics (15 c, 15 c) between candidates; NaN where there is none."""
        flat = candidates.ravel()
        there = np.flatnonzero(flat >= 0)
        out = np.full((len(flat), len(flat)), np.nan)
        if len(there):
            unique, back = np.unique(flat[there], return_inverse=True)
            fields = solver.distances([int(v) for v in unique])
            out[np.ix_(there, there)] = fields[back][:, flat[there]]
        return out

    def _choose(
        self, b: FloatArray, candidates: IntArray, values: FloatArray, pair: FloatArray | None
    ) -> tuple[IntArray, FloatArray]:
        """One candidate or none (-1) for every point, by sweeps over the points with the others fixed."""
        pick = np.where(values[:, 0] < _ABSENT_COST, 0, -1)
        pair_m = np.full(len(PAIRS), np.nan)
        rows = np.arange(POINTS)
        if pair is not None:
            _, expected = self._model.expected(b)
            sigma = np.sqrt(self._model.pair_sigma_m**2 + _PAIR_SIGMA_M**2)
            blocks = pair.reshape(POINTS, CANDIDATES, POINTS, CANDIDATES)
            table = np.full((POINTS, POINTS), np.nan)
            spread = np.full((POINTS, POINTS), np.nan)
            for k, (i, j) in enumerate(PAIRS):
                table[i, j] = table[j, i] = expected[k]
                spread[i, j] = spread[j, i] = sigma[k]
            for _ in range(_SWEEPS):
                before = pick.copy()
                for p in rows[self._likely]:
                    others = np.flatnonzero((pick >= 0) & (rows != p))
                    seen = blocks[p][:, others, pick[others]]
                    off = ((seen - table[p, others]) / spread[p, others]) ** 2
                    pairs = (
                        np.nanmean(np.where(np.isfinite(off), np.minimum(off, _PAIR_CAP), np.nan), axis=1)
                        if len(others)
                        else np.zeros(CANDIDATES)
                    )
                    total = values[p] + 4.0 * np.nan_to_num(pairs, nan=_PAIR_CAP)
                    best = int(np.argmin(total))
                    pick[p] = best if total[best] < _ABSENT_COST else -1
                if (pick == before).all():
                    break
            for k, (i, j) in enumerate(PAIRS):
                if pick[i] >= 0 and pick[j] >= 0:
                    pair_m[k] = blocks[i, pick[i], j, pick[j]]
        return np.where(pick >= 0, candidates[rows, np.maximum(pick, 0)], -1), pair_m

    def _update(self, pair_m: FloatArray) -> FloatArray:
        model = self._model
        measured = np.full((POINTS, model.anchors), np.nan)
        there = self._chosen >= 0
        measured[there] = self._distances[:, self._chosen[there]].T
        difference = np.concatenate([measured.ravel(), pair_m]) - model.mean_m
        variance = model.sigma_m**2 + _MEASURED_SIGMA_M**2
        weight = 1.0 / variance
        weight[POINTS * model.anchors :] *= 0.1  # pairs repeat what the points say
        b = coefficients(difference, model.modes_m, weight)
        for _ in range(2):
            off = (difference - b @ model.modes_m) ** 2 * weight
            b = coefficients(difference, model.modes_m, weight / (1.0 + np.nan_to_num(off) / 4.0))
        return b

    def finish(self, b: FloatArray) -> HandFit:
        """Points between vertices: the mean of the vertices around the chosen one, by likelihood."""
        cost = self.unary(b)
        points, error = np.full((POINTS, 3), np.nan), np.full(POINTS, np.nan)
        expected, _ = self._model.expected(b)
        for p in np.flatnonzero(self._chosen >= 0):
            v = self._chosen[p]
            near = np.flatnonzero(((self._vertices - self._vertices[v]) ** 2).sum(axis=1) < _APART_M**2)
            w = np.exp(-0.5 * (cost[p, near] - cost[p, near].min()))
            points[p] = w @ self._vertices[near] / w.sum()
            off = self._distances[:, near] @ w / w.sum() - expected[p]
            error[p] = np.sqrt(np.mean(off**2))
        shown = self._likely & (self._model.seen > 0.6)
        best = np.where(self._chosen >= 0, cost[np.arange(POINTS), np.maximum(self._chosen, 0)], _ABSENT_COST)
        total = float(np.minimum(best[shown], _ABSENT_COST).mean() + b @ b / 4.0) if shown.any() else np.inf
        return HandFit(self._model.name, points, self._chosen.copy(), error, total, b)
