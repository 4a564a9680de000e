"""Virtual-source propagation: fronts that remember where they came from (METHOD, section 2).

Every vertex keeps its distance ``d`` and ``s``, the distance already travelled when the path last bent
(zero while it is straight). Across an edge ``(a, b)`` the pair of remaining distances ``d - s`` places the
(pseudo-)source in the plane of the next triangle, so a circular front stays circular: on a plane the answer
is exact up to rounding, where fast marching flattens the front in every triangle. After Trettner, Bommes
and Kobbelt (2021), with the rule that ``s`` restarts only at boundary and saddle vertices, the only ones
where a shortest path can bend.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from core.geodesics.buckets import append, new_queue, remove
from core.geodesics.meshes import FloatArray, IntArray
from core.geodesics.wedge_solver import WedgeSolver

TOLERANCE = 1e-6
"""A vertex is only visited again when its distance shrinks by more than this share of the edge."""


@numba.njit(nogil=True, cache=True, fastmath={"nsz", "arcp", "contract"}, error_model="numpy")
def virtual_source_front(  # type: ignore[no-untyped-def]
    start, corners, shape, bends, width, buckets, seeds, starts, tolerance, d
):
    """Fill ``d`` (n,) float64 with distances to one source given by ``seeds`` (3,) and ``starts`` (3,)."""
    n = d.shape[0]
    far = 1e300
    state = np.empty((n, 2))  # d, s of a vertex side by side
    for i in range(n):
        state[i, 0] = far
        state[i, 1] = 0.0
    ring, link = new_queue(n, buckets)
    queued = 0
    per_width = 1.0 / width
    for i in range(seeds.shape[0]):
        v = np.uint32(seeds[i])
        if starts[i] < state[v, 0]:
            state[v, 0] = starts[i]
            if link[v, 2] >= 0:
                remove(ring, link, v)
                queued -= 1
            append(ring, link, v, np.uint32(np.int64(starts[i] * per_width) & (buckets - 1)))
            queued += 1
    present = np.int64(0)
    while queued > 0:
        first = ring[np.uint32(present & (buckets - 1)), 0]
        if first < 0:
            present += 1
            continue
        a = np.uint32(first)
        remove(ring, link, a)
        queued -= 1
        da = state[a, 0]
        sa = state[a, 1]
        inherited = da if bends[a] else sa
        reach = (da - sa) * (da - sa)
        for k in range(start[a], start[a + np.uint32(1)]):
            for side in range(2):
                t = corners[k, side]
                b = corners[k, 1 - side]
                dt = state[t, 0]
                lat = np.float64(shape[k, side])
                lab = np.float64(shape[k, 1 - side])
                lbt = np.float64(shape[k, 2])
                if dt <= da:
                    # The target was due before the edge's end: at wide corners, and close to the source. If
                    # the straight way to t crosses ab, the law of cosines in (source, a, t) bounds da.
                    rt = dt - sa
                    narrow = lat * lat + lbt * lbt - lab * lab
                    if (rt * rt + lat * lat) * lbt - rt * narrow < reach * lbt:
                        continue
                candidate = da + lat
                origin = inherited
                db = state[b, 0]
                # While the edge's other end waits in the queue, its own turn will come for this triangle.
                if db < far and link[b, 2] < 0:
                    cx = lat * np.float64(shape[k, 3])
                    cy = lat * np.float64(shape[k, 4])
                    sg = min(sa, state[b, 1])
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
                    state[t, 0] = candidate
                    state[t, 1] = origin
                    # Behind the front only by rounding or by a wide corner: then its turn is now.
                    bucket = np.uint32(max(np.int64(candidate * per_width), present) & (buckets - 1))
                    if link[t, 2] != np.int32(bucket):
                        if link[t, 2] >= 0:
                            remove(ring, link, t)
                            queued -= 1
                        append(ring, link, t, bucket)
                        queued += 1
    for i in range(n):
        d[i] = state[i, 0] if state[i, 0] < far else np.inf


class VirtualSourceSolver(WedgeSolver):
    """Virtual-source distances on a triangle mesh."""

    method = "virtual-source"

    def _front(self, seeds: IntArray, starts: FloatArray, out: FloatArray) -> None:
        w = self.wedges
        virtual_source_front(
            w.start, w.corners, w.shape, w.bends, w.width, w.buckets, seeds, starts, TOLERANCE, out
        )
