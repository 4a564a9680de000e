"""Compiled voting of neighbouring spots for a local motion of the skin. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]


@njit(cache=True, nogil=True)
def _onto(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    """The smallest rotation (3, 3) that turns unit vector a into b (not its opposite)."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    c = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    k = 1.0 / (1.0 + c)
    out[0, 0], out[0, 1], out[0, 2] = c + k * x * x, k * x * y - z, k * x * z + y
    out[1, 0], out[1, 1], out[1, 2] = k * x * y + z, c + k * y * y, k * y * z - x
    out[2, 0], out[2, 1], out[2, 2] = k * x * z - y, k * y * z + x, c + k * z * z


@njit(cache=True, nogil=True)
def _about(n: FloatArray, angle: float, out: FloatArray) -> None:
    """Rotation (3, 3) about a unit axis."""
    c, s = np.cos(angle), np.sin(angle)
    k = 1.0 - c
    x, y, z = n[0], n[1], n[2]
    out[0, 0], out[0, 1], out[0, 2] = c + k * x * x, k * x * y - s * z, k * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = k * x * y + s * z, c + k * y * y, k * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = k * x * z - s * y, k * y * z + s * x, c + k * z * z


@njit(cache=True, nogil=True)
def vote_motions(
    predicted: FloatArray,
    normals: FloatArray,
    neighbour_start: IntArray,
    neighbours: IntArray,
    spots: FloatArray,
    spot_normals: FloatArray,
    looks: NDArray[np.float32],
    reach_m: float,
    angles: FloatArray,
    floor_m: float,
    stretch: float,
    density: float,
    seen: float,
    drift_m: float,
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """For every first-visit spot, the local rigid motion that its neighbourhood explains best.

    A pair of spots and their normals give the motion up to a turn about the normal, which is tried in
    steps. Under the motion each neighbour either lands on a spot of the follow-up (log-likelihood ratio of
    hit against chance: ``log(seen / chance)`` minus its misfit) or does not (``log(1 - seen)``).

    Parameters
    ----------
    predicted, normals : (m, 3)
        Where the first visit's spots are expected, and their normals there.
    neighbour_start, neighbours
        Neighbours of each spot in compressed rows.
    spots, spot_normals : (k, 3)
        Of the follow-up.
    looks : (m, k)
        Cost of looking different, as -2 log likelihood ratio.
    reach_m : float
        Farthest drift from the prediction that is tried.
    density : float
        Spots per square metre of the follow-up.
    seen : float
        Probability that a spot is detected again.
    drift_m : float
        Spread of drifts expected beforehand.

    Returns
    -------
    best : (m,)
        Chosen spot, -1 for none.
    score, margin : (m,)
        Its log-likelihood ratio, and how much better than with any other spot.
    partner : (len(neighbours),)
        Spot on which each neighbour landed under the chosen motion, -1 for none.
    """
    count = len(predicted)
    best = np.full(count, -1, np.int32)
    score = np.full(count, -1e9)
    margin = np.zeros(count)
    partner = np.full(len(neighbours), -1, np.int32)
    first, second, both = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    close = np.empty(len(spots), np.int32)
    landed = np.empty(512, np.int32)
    kept = np.empty(512, np.int32)
    taken = np.full(len(spots), -1, np.int64)
    stamp = 0
    for i in range(count):
        start, stop = neighbour_start[i], neighbour_start[i + 1]
        group = min(stop - start, 512)
        if group < 2:
            continue
        far = 0.0
        for g in range(group):
            j = neighbours[start + g]
            d = 0.0
            for c in range(3):
                d += (predicted[j, c] - predicted[i, c]) ** 2
            far = max(far, d)
        limit = (reach_m + np.sqrt(far) + 0.03) ** 2
        near = 0
        for b in range(len(spots)):
            d = 0.0
            for c in range(3):
                d += (spots[b, c] - predicted[i, c]) ** 2
            if d < limit:
                close[near] = b
                near += 1
        runner = -1e9
        for q in range(near):
            b = close[q]
            drift = 0.0
            facing = 0.0
            for c in range(3):
                drift += (spots[b, c] - predicted[i, c]) ** 2
                facing += normals[i, c] * spot_normals[b, c]
            if drift > reach_m * reach_m or facing < 0.1 or looks[i, b] > 9.0:
                continue
            _onto(normals[i], spot_normals[b], first)
            own = -1e9
            for a in range(len(angles)):
                _about(spot_normals[b], angles[a], second)
                for r in range(3):
                    for c in range(3):
                        both[r, c] = (
                            second[r, 0] * first[0, c]
                            + second[r, 1] * first[1, c]
                            + second[r, 2] * first[2, c]
                        )
                total = -0.5 * drift / (drift_m * drift_m) - 0.5 * (angles[a] / 0.25) ** 2 - 0.5 * looks[i, b]
                stamp += 1
                taken[b] = stamp
                for g in range(group):
                    j = neighbours[start + g]
                    x = y = z = 0.0
                    size = 0.0
                    for c in range(3):
                        d = predicted[j, c] - predicted[i, c]
                        size += d * d
                        x += both[0, c] * d
                        y += both[1, c] * d
                        z += both[2, c] * d
                    sigma = floor_m + stretch * np.sqrt(size)
                    x += spots[b, 0]
                    y += spots[b, 1]
                    z += spots[b, 2]
                    least, who = 9.0, -1
                    for k in range(near):
                        e = close[k]
                        dx = spots[e, 0] - x
                        if dx > 3.0 * sigma or dx < -3.0 * sigma:
                            continue
                        dy, dz = spots[e, 1] - y, spots[e, 2] - z
                        misfit = (dx * dx + dy * dy + dz * dz) / (sigma * sigma)
                        if misfit >= 9.0 or taken[e] == stamp:
                            continue
                        misfit += looks[j, e]
                        if misfit < least:
                            least, who = misfit, e
                    landed[g] = -1
                    gain = np.log(1.0 - seen)
                    if who >= 0:
                        hit = np.log(seen / (2.0 * np.pi * sigma * sigma * density)) - 0.5 * least
                        if hit > gain:
                            gain = hit
                            landed[g] = who
                            taken[who] = stamp
                    total += gain
                if total > own:
                    own = total
                    if total > score[i]:
                        for g in range(group):
                            kept[g] = landed[g]
            if own > score[i]:
                runner = score[i]
                score[i] = own
                best[i] = b
                for g in range(group):
                    partner[start + g] = kept[g]
            elif own > runner:
                runner = own
        margin[i] = score[i] - runner
    return best, score, margin, partner
