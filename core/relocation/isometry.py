"""Shifting the follow-up's nodes so that their mutual geodesics agree with the first visit's.

Skin hardly stretches, so the geodesic between two anchors is the same in both visits; where it is not, a
joint was tracked somewhere else. The shifts ``e_i`` in the tangent planes minimise ``sum_ij rho((D2_ij + g_ij
. e_i + g_ji . e_j - D1_ij) / s_ij) + sum_i |e_i|^2 / a_i^2`` with the Student-t ``rho`` of trilateration,
``g_ij`` the slope of node j's field at node i. Nodes are anchors and, beside them, further skin points that
trilateration has placed: they tie far anchors together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FREEDOM = 3.0
ROUNDS = 12


def residual_sigma(first: FloatArray, stretch: float, floor_m: float) -> FloatArray:
    """Spread (m, m) of an inter-node distance between visits."""
    return np.hypot(floor_m, stretch * np.where(np.isfinite(first), first, 0.0))


def solve_shifts(
    first: FloatArray,
    followup: FloatArray,
    slopes: FloatArray,
    prior_m: FloatArray,
    spread: FloatArray,
    expected: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Shifts of the follow-up's nodes and what is left of their uncertainty.

    Parameters
    ----------
    first, followup : ndarray (m, m)
        Distances between nodes; not finite where a pair is not connected.
    slopes : ndarray (m, m, 2)
        ``slopes[i, j]``: slope of node j's field at node i in i's tangent basis; NaN where unknown.
    prior_m : ndarray (m,)
        Standard deviation of each node's own place.
    spread : ndarray (m, m)
        Standard deviation of each distance.
    expected : ndarray (m, 2), optional
        Shifts that the nodes' own evidence asks for; zero by default.

    Returns
    -------
    shifts : ndarray (m, 2)
        In each node's tangent basis, metres.
    sigma_m : ndarray (m,)
        Standard deviation of a node's place after the shift.
    """
    count = len(prior_m)
    one, two = np.triu_indices(count, 1)
    with np.errstate(invalid="ignore"):  # a pair that is connected in neither visit: inf - inf
        residual = 0.5 * (followup[one, two] + followup[two, one] - first[one, two] - first[two, one])
    usable = (
        np.isfinite(residual)
        & np.isfinite(slopes[one, two]).all(axis=1)
        & np.isfinite(slopes[two, one]).all(axis=1)
    )
    one, two, residual = one[usable], two[usable], residual[usable]
    scale = spread[one, two]
    jacobian = np.zeros((len(one), count, 2))
    rows = np.arange(len(one))
    jacobian[rows, one] = slopes[one, two]
    jacobian[rows, two] = slopes[two, one]
    flat = jacobian.reshape(len(one), 2 * count)
    prior = np.repeat(1.0 / prior_m**2, 2)
    wished = np.zeros(2 * count) if expected is None else expected.reshape(2 * count)
    shift = wished.copy()
    normal = np.diag(prior)
    for _ in range(ROUNDS):
        left = (residual + flat @ shift) / scale
        weight = (FREEDOM + 1.0) / (FREEDOM + left**2) / scale**2
        normal = flat.T @ (weight[:, None] * flat) + np.diag(prior)
        step = np.linalg.solve(normal, prior * wished - flat.T @ (weight * residual)) - shift
        shift = shift + step
        if float(np.abs(step).max(initial=0.0)) < 1e-5:
            break
    shifts = shift.reshape(count, 2)
    length = np.linalg.norm(shifts, axis=1, keepdims=True)
    shifts = shifts * np.minimum(1.0, 2.5 * prior_m[:, None] / np.maximum(length, 1e-12))
    covariance = np.diag(np.linalg.inv(normal)).reshape(count, 2)
    return shifts, np.sqrt(covariance.mean(axis=1))
