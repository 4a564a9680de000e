"""Fast marching on triangle meshes (Kimmel and Sethian 1998): a straight front in every triangle; paths cross faces.

Corners with an obtuse angle need no unfolding: the scheme is label correcting and may visit a vertex again. A
straight front is poor where the true one is a small circle, so the first rings around the source are unfolded
exactly (as in `core.geodesics.virtual_source`).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from core.geodesics.heap import heap_pop, heap_raise
from core.geodesics.wedge_solver import FloatArray, IntArray, WedgeSolver
from core.geodesics.wedges import WedgeGraph

TOLERANCE = 1e-6
EXACT_RINGS = 4.0
"""Radius of the exact start, in longest edges around the source."""


@numba.njit(nogil=True, cache=True, fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def fast_marching_front(start, corners, shape, seeds, starts, rings, tolerance, d):  # type: ignore[no-untyped-def]
    """Fill ``d`` (n,) float64 with distances to one source given by ``seeds`` (3,) and ``starts`` (3,)."""
    n = d.shape[0]
    far = 1e300
    d[:] = far
    place = np.full(n, -1, np.int32)
    heap = np.empty(n, np.int32)
    size = 0
    near = 0.0
    for i in range(seeds.shape[0]):
        v = seeds[i]
        if starts[i] < d[v]:
            d[v] = starts[i]
            size = heap_raise(heap, place, d, size, v)
        for k in range(start[v], start[v + 1]):
            near = max(near, rings * max(shape[k, 0], shape[k, 1]))
    while size > 0:
        a, size = heap_pop(heap, place, d, size)
        da = d[a]
        for k in range(start[a], start[a + 1]):
            for side in range(2):
                t = corners[k, side]
                dt = d[t]
                if dt <= da:
                    continue
                b = corners[k, 1 - side]
                lat = np.float64(shape[k, side])
                candidate = da + lat
                db = d[b]
                if db < far:
                    lab = np.float64(shape[k, 1 - side])
                    lbt = np.float64(shape[k, 2])
                    if db <= da or lat * lat + lbt * lbt < lab * lab:
                        cx = lat * np.float64(shape[k, 3])
                        cy = lat * np.float64(shape[k, 4])
                        if da < near and db < near:
                            sx = ((da - db) * (da + db) + lab * lab) / (2.0 * lab)
                            sy2 = (da - sx) * (da + sx)
                            if sy2 >= 0.0:
                                height = math.sqrt(sy2) + cy
                                crossing = sx * cy + cx * (height - cy)
                                slack = 1e-6 * lab * height
                                if crossing >= -slack and crossing <= lab * height + slack:
                                    straight = math.sqrt((cx - sx) * (cx - sx) + height * height)
                                    candidate = min(candidate, straight)
                        else:
                            gx = (db - da) / lab
                            g2 = 1.0 - gx * gx
                            if g2 > 0.0:
                                gy = math.sqrt(g2)
                                crossing = cx * gy - cy * gx
                                if crossing >= 0.0 and crossing <= lab * gy:
                                    candidate = min(candidate, da + gx * cx + gy * cy)
                if candidate < dt - tolerance * lat:
                    d[t] = candidate
                    size = heap_raise(heap, place, d, size, t)
    for i in range(n):
        if d[i] >= far:
            d[i] = np.inf


class FastMarchingSolver(WedgeSolver):
    """Fast-marching distances on a triangle mesh."""

    method = "fast-marching"

    @staticmethod
    def _front(wedges: WedgeGraph, seeds: IntArray, starts: FloatArray, out: FloatArray) -> None:
        fast_marching_front(
            wedges.start, wedges.corners, wedges.shape, seeds, starts, EXACT_RINGS, TOLERANCE, out
        )
