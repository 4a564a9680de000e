"""Compiled sums over a hand's vertices. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def anchor_costs(
    values: NDArray[np.float64],
    expected: NDArray[np.float64],
    weight: NDArray[np.float64],
    active: NDArray[np.bool_],
    vertices: NDArray[np.float64],
    near: NDArray[np.float64],
    near_weight: float,
    near_cap: float,
    capped: int,
    cap: float,
    most: float,
    out: NDArray[np.float64],
) -> None:
    """Squared, weighted difference (p, n) between every vertex's distances and those expected of a point.

    Parameters
    ----------
    values : ndarray (n, f)
        Distances of every vertex, row by row, as they lie in memory.
    expected, weight : ndarray (p, a)
        Weight 0 for a distance that does not count; ``values`` must be finite there.
    active : ndarray (p,) bool
        Other rows of ``out`` become inf.
    vertices : ndarray (n, 3)
    near : ndarray (p, 3)
        Where a point was, NaN if not known; straying costs ``near_weight`` per square metre up to
        ``near_cap``.
    capped : int
        The last so many fields cost ``cap`` each at most.
    cap : float
    most : float
        A vertex whose distances to the anchors alone cost more gets inf.
    out : ndarray (p, n)
    """
    count, fields = values.shape
    hard = fields - capped
    for p in range(len(expected)):
        if not active[p]:
            out[p] = np.inf
            continue
        drawn = not np.isnan(near[p, 0])
        for v in range(count):
            cost = 0.0
            for a in range(hard):
                off = values[v, a] - expected[p, a]
                cost += weight[p, a] * off * off
            if cost > most:
                out[p, v] = np.inf
                continue
            for a in range(hard, fields):
                off = values[v, a] - expected[p, a]
                cost += min(weight[p, a] * off * off, cap)
            if drawn:
                x = vertices[v, 0] - near[p, 0]
                y = vertices[v, 1] - near[p, 1]
                z = vertices[v, 2] - near[p, 2]
                cost += min(near_weight * (x * x + y * y + z * z), near_cap)
            out[p, v] = cost


@njit(cache=True, nogil=True)
def joint_costs(
    point: int,
    anchor_cost: NDArray[np.float64],
    most: float,
    fields: NDArray[np.float64],
    chosen: NDArray[np.bool_],
    expected: NDArray[np.float64],
    weight: NDArray[np.float64],
    cap: float,
    share: float,
    out: NDArray[np.float64],
) -> int:
    """Cost (n,) of every vertex for one point with the others fixed (thesis eq. 7), and the cheapest vertex.

    Parameters
    ----------
    point : int
    anchor_cost : ndarray (n,)
        Vertices above ``most`` are left at inf.
    fields : ndarray (p, n)
        Distances from where the other points are.
    chosen : ndarray (p,) bool
        Which of the others count.
    expected, weight : ndarray (p, p)
        Distances between points; weight 0 for a pair that does not count.
    cap : float
        Most that one pair may cost.
    share : float
        Weight of the pairs' mean against the anchors' sum.
    out : ndarray (n,)

    Returns
    -------
    int
        -1 if no vertex is below ``most``.
    """
    best, found = np.inf, -1
    for v in range(len(anchor_cost)):
        out[v] = np.inf
        if anchor_cost[v] > most:
            continue
        total, pairs = 0.0, 0
        for q in range(len(fields)):
            if chosen[q] and q != point and weight[point, q] > 0.0:
                off = fields[q, v] - expected[point, q]
                total += min(off * off * weight[point, q], cap)
                pairs += 1
        cost = anchor_cost[v] + (share * total / pairs if pairs > 0 else 0.0)
        out[v] = cost
        if cost < best:
            best, found = cost, v
    return found


@njit(cache=True, nogil=True)
def weighted_place(
    cost: NDArray[np.float64], vertices: NDArray[np.float64], centre: int, reach_m: float
) -> tuple[float, float, float, float]:
    """Mean place, weighted by likelihood exp(-cost / 2), of the vertices around one, and its spread (m)."""
    total = x = y = z = 0.0
    square = reach_m * reach_m
    for v in range(len(cost)):
        if not cost[v] < np.inf:
            continue
        dx = vertices[v, 0] - vertices[centre, 0]
        dy = vertices[v, 1] - vertices[centre, 1]
        dz = vertices[v, 2] - vertices[centre, 2]
        if dx * dx + dy * dy + dz * dz > square:
            continue
        w = np.exp(-0.5 * min(cost[v] - cost[centre], 60.0))
        total += w
        x += w * vertices[v, 0]
        y += w * vertices[v, 1]
        z += w * vertices[v, 2]
    x, y, z = x / total, y / total, z / total
    spread = 0.0
    for v in range(len(cost)):
        if not cost[v] < np.inf:
            continue
        dx, dy, dz = vertices[v, 0] - x, vertices[v, 1] - y, vertices[v, 2] - z
        d = dx * dx + dy * dy + dz * dz
        if d <= square:
            spread += np.exp(-0.5 * min(cost[v] - cost[centre], 60.0)) * d
    return x, y, z, np.sqrt(spread / total)


@njit(cache=True, nogil=True)
def steady_vertex(
    cost: NDArray[np.float64], vertices: NDArray[np.float64], cheapest: int, reach_m: float
) -> int:
    """Vertex nearest to the likely place around the cheapest one.

    The cheapest vertex itself jumps between neighbours with the noise, the place does not.
    """
    x, y, z, _ = weighted_place(cost, vertices, cheapest, reach_m)
    best, found = np.inf, cheapest
    for v in range(len(cost)):
        if cost[v] < np.inf:
            dx, dy, dz = vertices[v, 0] - x, vertices[v, 1] - y, vertices[v, 2] - z
            d = dx * dx + dy * dy + dz * dz
            if d < best:
                best, found = d, v
    return found


@njit(cache=True, nogil=True)
def farthest_beyond(
    away: NDArray[np.float64],
    order: NDArray[np.int64],
    start: NDArray[np.int64],
    neighbours: NDArray[np.int32],
    out: NDArray[np.float64],
) -> None:
    """Largest value (n,) of ``away`` that can be reached from each vertex by going up all the way.

    Parameters
    ----------
    away : ndarray (n,)
    order : ndarray (n,) int64
        Vertices from the largest value to the smallest.
    start : ndarray (n + 1,) int64
        First neighbour of each vertex in ``neighbours``.
    neighbours : ndarray (m,) int32
    out : ndarray (n,)
    """
    for v in order:
        best = away[v]
        for k in range(start[v], start[v + 1]):
            w = neighbours[k]
            if away[w] > away[v] and out[w] > best:
                best = out[w]
        out[v] = best
