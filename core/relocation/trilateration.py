"""Robust trilateration of geodesics, finer than a vertex (METHOD section 3).

The residual ``r_i(x) = d_i(x) - d0_i`` of every anchor has a heavy tail: a joint may be tracked wrongly, a
path may run round an arm that was not there before. Its cost is that of a Student-t law with three degrees of
freedom, ``cost(x) = sum_i 4 ln(1 + r_i^2 / (3 sigma_i^2))``, ``sigma_i^2 = a_i^2 + (stretch d_i)^2``. The
answer is the mean of the skin around the minimum weighted by ``exp(-(cost - min) / 2)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

STRETCH = 0.02
"""Share of a distance that is lost or gained when the body moves: the second term of sigma_i."""
MEAN_RADIUS_M = 0.06
"""The mean of the answer is taken over skin within this distance of the minimum."""
FREEDOM = 3.0
MAX_SQUARED = 200.0
"""Normalised squared residuals are cut here: a farther anchor says no more than "elsewhere"."""
UNKNOWN = np.float32(1.5 / np.sqrt(FREEDOM))
"""An unknown distance costs as much as one 1.5 sigma off: no reason to go there, none to stay away."""
AMBIGUOUS_COST = 2.0
"""Two places whose costs differ by less explain the distances equally well."""


@dataclass(frozen=True, eq=False)
class SkinField:
    """What trilateration needs of a surface, prepared once and asked for many lesions.

    Attributes
    ----------
    distances : ndarray (a, n) float32
        Geodesic distances of the follow-up; inf where unreachable, NaN where the true one is unknown.
    vertices : ndarray (n, 3)
    areas : ndarray (n,)
        Skin area of every vertex: a slanted patch has fewer depth pixels than it deserves.
    boundary : ndarray (n,) bool
        Rim of the seen skin.
    """

    distances: NDArray[np.float32]
    vertices: FloatArray
    areas: FloatArray
    boundary: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fix:
    """One trilaterated place.

    Attributes
    ----------
    point_m : ndarray (3,)
        Weighted mean, not yet on the skin.
    best_vertex : int
        Vertex of least cost.
    cost : float
        Least cost.
    covariance : ndarray (3, 3)
        Of the posterior's main part, square metres.
    spread_m : float
        Half width of the posterior: 95 % of its mass lies within this distance of `point_m`.
    mass : float
        Share of the whole posterior within `MEAN_RADIUS_M` of the minimum.
    inliers : int
        Anchors whose residual at the minimum is below two sigma.
    used : int
        Anchors that reach both the lesion and the place.
    others : tuple of (vertex, excess cost)
        Best vertices of other places that explain the distances almost as well.
    """

    point_m: FloatArray
    best_vertex: int
    cost: float
    covariance: FloatArray
    spread_m: float
    mass: float
    inliers: int
    used: int
    others: tuple[tuple[int, float], ...]


def vertex_areas(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Skin area (n,) of each vertex in square metres: a third of its triangles'."""
    from core.relocation.trilateration_kernels import sum_areas

    out = np.zeros(len(vertices))
    sum_areas(np.ascontiguousarray(vertices), np.ascontiguousarray(triangles), out)
    return out


def cost_field(
    distances: NDArray[np.float32], lesion: FloatArray, sigma_m: FloatArray
) -> NDArray[np.float32]:
    """Cost (n,) of every vertex: ``sum_i 4 ln(1 + r_i^2 / (3 sigma_i^2))``.

    Anchors with an infinite `lesion` distance take no part; a vertex an anchor does not reach pays the cut of
    `MAX_SQUARED`.
    """
    return _costs(distances, lesion, sigma_m)[0]


def _costs(
    distances: NDArray[np.float32], lesion: FloatArray, sigma_m: FloatArray
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """`cost_field`, and which vertices (n,) an anchor of the lesion reaches."""
    from core.relocation.trilateration_kernels import sum_costs

    rows = np.flatnonzero(np.isfinite(lesion))
    scales = (1.0 / (sigma_m[rows] * np.sqrt(FREEDOM))).astype(np.float32)
    limit = np.float32(np.sqrt(MAX_SQUARED / FREEDOM))
    cost = np.empty(distances.shape[1], np.float32)
    reached = np.empty(distances.shape[1], np.bool_)
    single = np.ascontiguousarray(distances, dtype=np.float32)
    sum_costs(single, rows, lesion[rows].astype(np.float32), scales, limit, UNKNOWN, cost, reached)
    return cost, reached


def neighbourhood_cost(vertices: FloatArray, place: FloatArray, sigma_m: float) -> NDArray[np.float32]:
    """Cost (n,) of lying away from where the skeleton carries a lesion: one more, very blunt, robust ruler.

    It decides between places that mirror each other and hardly moves an answer that is near.
    """
    from core.relocation.trilateration_kernels import place_costs

    cost = np.empty(len(vertices), np.float32)
    place_costs(np.ascontiguousarray(vertices), np.asarray(place, float), 1.0 / (FREEDOM * sigma_m**2), cost)
    return cost


def trilaterate(
    field: SkinField,
    lesion: FloatArray,
    sigma_m: FloatArray,
    *,
    extra_cost: NDArray[np.float32] | None = None,
    max_others: int = 3,
) -> Fix | None:
    """Place of one lesion from its distances to the anchors.

    Parameters
    ----------
    field : SkinField
        Follow-up surface and its distance fields.
    lesion : ndarray (a,)
        Distances of the first visit; inf for an anchor that takes no part.
    sigma_m : ndarray (a,)
        Standard deviation of each residual.
    extra_cost : ndarray (n,), optional
        Cost from other knowledge, for example `neighbourhood_cost`.

    Returns
    -------
    Fix or None
        None when no vertex is reached by any anchor of the lesion.
    """
    use = np.isfinite(lesion)
    cost, reached = _costs(field.distances, lesion, sigma_m)
    if extra_cost is not None:
        cost = cost + extra_cost
    if not use.any() or not reached.any():
        return None
    cost = np.where(reached, cost, np.float32(np.inf))
    best = int(cost.argmin())
    least = float(cost[best])
    kept = np.flatnonzero(cost < least + 20.0)
    position = field.vertices[kept]
    weight = np.exp(-(cost[kept].astype(float) - least) / 2) * np.maximum(field.areas[kept], 1e-12)
    offset = np.linalg.norm(position - field.vertices[best], axis=1)
    near = offset < MEAN_RADIUS_M
    total, inside = float(weight.sum()), float(weight[near].sum())
    point = (weight[near, None] * position[near]).sum(axis=0) / inside
    centred = position[near] - point
    covariance = (weight[near, None] * centred).T @ centred / inside
    residual = (field.distances[use, best] - lesion[use]) / sigma_m[use]
    finite = np.isfinite(residual)
    return Fix(
        point_m=point,
        best_vertex=best,
        cost=least,
        covariance=covariance,
        spread_m=_weighted_quantile(np.linalg.norm(position - point, axis=1), weight, 0.95),
        mass=inside / total,
        inliers=int((np.abs(residual[finite]) < 2).sum()),
        used=int(finite.sum()),
        others=_other_places(cost[kept], position, kept, field.vertices[best], least, max_others),
    )


def _weighted_quantile(values: FloatArray, weights: FloatArray, share: float) -> float:
    order = np.argsort(values)
    mass = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(mass, share * mass[-1])])


def _other_places(
    cost: NDArray[np.float32],
    position: FloatArray,
    index: NDArray[np.intp],
    best: FloatArray,
    least: float,
    count: int,
) -> tuple[tuple[int, float], ...]:
    """Minima within `AMBIGUOUS_COST` of the best that a ridge or a gap separates from it, best first."""
    low = np.flatnonzero(cost < least + AMBIGUOUS_COST)
    far = low[np.linalg.norm(position[low] - best, axis=1) > MEAN_RADIUS_M]
    out: list[tuple[int, float]] = []
    places = [best]
    for k in far[np.argsort(cost[far])]:
        if len(out) == count:
            break
        if min(float(np.linalg.norm(position[k] - p)) for p in places) < MEAN_RADIUS_M:
            continue
        around = np.linalg.norm(position - position[k], axis=1) < MEAN_RADIUS_M / 4
        if cost[around].min() < cost[k]:
            continue
        places.append(position[k])
        out.append((int(index[k]), float(cost[k]) - least))
    return tuple(out)
