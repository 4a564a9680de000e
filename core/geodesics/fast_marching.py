"""Fast marching on triangle meshes (Kimmel and Sethian 1998): a straight front in every triangle.

Corners with an obtuse angle need no unfolding: the scheme is label correcting and may visit a vertex again. A
straight front is poor where the true one is a small circle, so the first rings around the source are unfolded
exactly (as in `core.geodesics.virtual_source`).
"""

from __future__ import annotations

import math

import numba
import numpy as np

from core.geodesics.buckets import append, new_queue, remove
from core.geodesics.meshes import FloatArray, IntArray
from core.geodesics.wedge_solver import WedgeSolver

TOLERANCE = 1e-6
NEAR = 4.0
"""Radius of the exact start, in longest edges around the source."""


@numba.njit(nogil=True, cache=True, fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def fast_marching_front(  # type: ignore[no-untyped-def]
    start, corners, shape, width, buckets, seeds, starts, rings, tolerance, d
):
    """Fill ``d`` (n,) float64 with distances to one source given by ``seeds`` (3,) and ``starts`` (3,)."""
    n = d.shape[0]
    far = 1e300
    d[:] = far
    ring, link = new_queue(n, buckets)
    queued = 0
    per_width = 1.0 / width
    near = 0.0
    for i in range(seeds.shape[0]):
        v = np.uint32(seeds[i])
        if starts[i] < d[v]:
            d[v] = starts[i]
            if link[v, 2] >= 0:
                remove(ring, link, v)
                queued -= 1
            append(ring, link, v, np.uint32(np.int64(starts[i] * per_width) & (buckets - 1)))
            queued += 1
        for k in range(start[v], start[v + np.uint32(1)]):
            near = max(near, rings * max(shape[k, 0], shape[k, 1]))
    present = np.int64(0)
    while queued > 0:
        first = ring[np.uint32(present & (buckets - 1)), 0]
        if first < 0:
            present += 1
            continue
        a = np.uint32(first)
        remove(ring, link, a)
        queued -= 1
        da = d[a]
        reach = da * da
        for k in range(start[a], start[a + np.uint32(1)]):
            for side in range(2):
                t = corners[k, side]
                b = corners[k, 1 - side]
                dt = d[t]
                lat = np.float64(shape[k, side])
                lab = np.float64(shape[k, 1 - side])
                lbt = np.float64(shape[k, 2])
                if dt <= da:  # due before the edge's end: see core.geodesics.virtual_source
                    narrow = lat * lat + lbt * lbt - lab * lab
                    if (dt * dt + lat * lat) * lbt - dt * narrow < reach * lbt:
                        continue
                candidate = da + lat
                db = d[b]
                if db < far and link[b, 2] < 0:
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
                                candidate = min(candidate, math.sqrt((cx - sx) * (cx - sx) + height * height))
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
                    # Behind the front only by rounding or by a wide corner: then its turn is now.
                    bucket = np.uint32(max(np.int64(candidate * per_width), present) & (buckets - 1))
                    if link[t, 2] != np.int32(bucket):
                        if link[t, 2] >= 0:
                            remove(ring, link, t)
                            queued -= 1
                        append(ring, link, t, bucket)
                        queued += 1
    for i in range(n):
        if d[i] >= far:
            d[i] = np.inf


class FastMarchingSolver(WedgeSolver):
    """Fast-marching distances on a triangle mesh."""

    method = "fast-marching"

    def _front(self, seeds: IntArray, starts: FloatArray, out: FloatArray) -> None:
        w = self.wedges
        fast_marching_front(
            w.start, w.corners, w.shape, w.width, w.buckets, seeds, starts, NEAR, TOLERANCE, out
        )
