"""Virtual-source propagation: fronts that remember where they came from (METHOD, section 2).

Every vertex keeps its distance ``d`` and ``s``, the distance already travelled when the path last bent (zero while
it is straight). Across an edge ``(a, b)`` the pair of remaining distances ``d - s`` places the (pseudo-)source in
the plane of the next triangle, so a circular front stays circular: on a plane the answer is exact up to rounding,
where fast marching flattens the front in every triangle. After Trettner, Bommes and Kobbelt (2021), with the rule
that ``s`` restarts only at boundary and saddle vertices, the only ones where a shortest path can bend.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from core.geodesics.heap import heap_pop, heap_raise
from core.geodesics.wedge_solver import FloatArray, IntArray, WedgeSolver
from core.geodesics.wedges import WedgeGraph

TOLERANCE = 1e-6
"""A vertex is only visited again when its distance shrinks by more than this share of the edge."""


@numba.njit(nogil=True, cache=True, fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def virtual_source_front(start, corners, shape, bends, seeds, starts, tolerance, d):  # type: ignore[no-untyped-def]
    """Fill ``d`` (n,) float64 with distances to one source given by ``seeds`` (3,) and ``starts`` (3,)."""
    n = d.shape[0]
    far = 1e300
    d[:] = far
    s = np.zeros(n)
    place = np.full(n, -1, np.int32)
    heap = np.empty(n, np.int32)
    size = 0
    for i in range(seeds.shape[0]):
        v = seeds[i]
        if starts[i] < d[v]:
            d[v] = starts[i]
            size = heap_raise(heap, place, d, size, v)
    while size > 0:
        a, size = heap_pop(heap, place, d, size)
        da = d[a]
        sa = s[a]
        inherited = da if bends[a] else sa
        for k in range(start[a], start[a + 1]):
            for side in range(2):
                t = corners[k, side]
                dt = d[t]
                if dt <= da:
                    continue
                b = corners[k, 1 - side]
                lat = np.float64(shape[k, side])
                candidate = da + lat
                origin = inherited
                db = d[b]
                if db < far:
                    lab = np.float64(shape[k, 1 - side])
                    lbt = np.float64(shape[k, 2])
                    # An edge whose second end is not settled is used when that end is, unless the corner at the
                    # target is obtuse: then the target may be due first.
                    if db <= da or lat * lat + lbt * lbt < lab * lab:
                        cx = lat * np.float64(shape[k, 3])
                        cy = lat * np.float64(shape[k, 4])
                        sg = min(sa, s[b])
                        ra = da - sg
                        rb = db - sg
                        sx = ((ra - rb) * (ra + rb) + lab * lab) / (2.0 * lab)
                        sy2 = (ra - sx) * (ra + sx)
                        if sy2 >= 0.0:
                            height = math.sqrt(sy2) + cy
                            crossing = sx * cy + cx * (height - cy)
                            slack = 1e-6 * lab * height
                            if crossing >= -slack and crossing <= lab * height + slack:
                                straight = sg + math.sqrt((cx - sx) * (cx - sx) + height * height)
                                if straight <= candidate + 1e-9 * lab:
                                    candidate = straight
                                    origin = sg
                if candidate < dt - tolerance * lat:
                    d[t] = candidate
                    s[t] = origin
                    size = heap_raise(heap, place, d, size, t)
    for i in range(n):
        if d[i] >= far:
            d[i] = np.inf


class VirtualSourceSolver(WedgeSolver):
    """Virtual-source distances on a triangle mesh."""

    method = "virtual-source"

    @staticmethod
    def _front(wedges: WedgeGraph, seeds: IntArray, starts: FloatArray, out: FloatArray) -> None:
        virtual_source_front(
            wedges.start, wedges.corners, wedges.shape, wedges.bends, seeds, starts, TOLERANCE, out
        )
