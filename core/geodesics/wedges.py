"""The mesh as the fronts walk it: for every vertex the triangles around it, unfolded, in one flat table.

A *wedge* of vertex ``a`` is a triangle seen from ``a``: its two other corners ``p`` and ``q``, the lengths
of the sides ``ap``, ``aq`` and of the opposite edge ``pq``, and the angle at ``a``. Wedges of one vertex
are contiguous (compressed sparse rows), numbers are unsigned and lengths float32: a front reads them in
order and little memory moves (METHOD, section 2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from core.geodesics.buckets import bucket_sizes
from core.geodesics.meshes import FloatArray, IntArray

UnsignedArray = NDArray[np.uint32]

SADDLE_EXCESS = 0.02
"""How far the angle around a vertex must exceed a full turn (radians) to let shortest paths bend there."""


@dataclass(frozen=True, eq=False)
class WedgeGraph:
    """Wedges of all vertices.

    Attributes
    ----------
    start : ndarray (n + 1,) uint32
        Wedges of vertex ``a`` are rows ``start[a]:start[a + 1]``.
    corners : ndarray (k, 2) uint32
        The other corners ``p, q``.
    shape : ndarray (k, 5) float32
        ``|ap|, |aq|, |pq|, cos, sin`` of the angle at ``a``; lengths in the mesh's unit.
    bends : ndarray (n,) bool
        True where a shortest path may bend: boundary, saddle and non-manifold vertices.
    width : float
        Width of the queue's buckets, and
    buckets : int
        their number (`core.geodesics.buckets`).
    """

    start: UnsignedArray
    corners: UnsignedArray
    shape: NDArray[np.float32]
    bends: NDArray[np.bool_]
    width: float
    buckets: int


@numba.njit(nogil=True, cache=True)
def _count(triangles, start):  # type: ignore[no-untyped-def]
    one = np.uint32(1)
    for f in range(triangles.shape[0]):
        a, b, c = triangles[f, 0], triangles[f, 1], triangles[f, 2]
        if a == b or b == c or c == a:
            continue
        start[a + one] += one
        start[b + one] += one
        start[c + one] += one
    for i in range(start.shape[0] - 1):
        start[i + 1] += start[i]


@numba.njit(nogil=True, cache=True)
def _fill(vertices, triangles, start, corners, shape):  # type: ignore[no-untyped-def]
    place = start[:-1].copy()
    length = np.empty(3)
    for f in range(triangles.shape[0]):
        if (
            triangles[f, 0] == triangles[f, 1]
            or triangles[f, 1] == triangles[f, 2]
            or triangles[f, 2] == triangles[f, 0]
        ):
            continue
        for i in range(3):  # length[i] is the edge opposite corner i
            p, q = triangles[f, (i + 1) % 3], triangles[f, (i + 2) % 3]
            x = vertices[q, 0] - vertices[p, 0]
            y = vertices[q, 1] - vertices[p, 1]
            z = vertices[q, 2] - vertices[p, 2]
            length[i] = math.sqrt(x * x + y * y + z * z)
        # Twice the area from the cross product: accurate for needles, where the law of cosines is not.
        ax = vertices[triangles[f, 1], 0] - vertices[triangles[f, 0], 0]
        ay = vertices[triangles[f, 1], 1] - vertices[triangles[f, 0], 1]
        az = vertices[triangles[f, 1], 2] - vertices[triangles[f, 0], 2]
        bx = vertices[triangles[f, 2], 0] - vertices[triangles[f, 0], 0]
        by = vertices[triangles[f, 2], 1] - vertices[triangles[f, 0], 1]
        bz = vertices[triangles[f, 2], 2] - vertices[triangles[f, 0], 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        area2 = math.sqrt(nx * nx + ny * ny + nz * nz)
        for i in range(3):
            a, p, q = triangles[f, i], triangles[f, (i + 1) % 3], triangles[f, (i + 2) % 3]
            lp, lq, opposite = length[(i + 2) % 3], length[(i + 1) % 3], length[i]
            k = place[a]
            place[a] += 1
            corners[k, 0] = p
            corners[k, 1] = q
            shape[k, 0] = lp
            shape[k, 1] = lq
            shape[k, 2] = opposite
            dot = 0.0
            for j in range(3):
                dot += (vertices[p, j] - vertices[a, j]) * (vertices[q, j] - vertices[a, j])
            size = math.sqrt(dot * dot + area2 * area2)
            shape[k, 3] = dot / size if size > 0.0 else 1.0
            shape[k, 4] = area2 / size if size > 0.0 else 0.0


@numba.njit(nogil=True, cache=True)
def _root(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(nogil=True, cache=True)
def _repeats(corners, first, k):  # type: ignore[no-untyped-def]
    """Whether wedge ``k`` is the same triangle as an earlier wedge of its vertex."""
    for e in range(first, k):
        same = corners[k, 0] == corners[e, 0] and corners[k, 1] == corners[e, 1]
        if same or (corners[k, 0] == corners[e, 1] and corners[k, 1] == corners[e, 0]):
            return True
    return False


@numba.njit(nogil=True, cache=True, error_model="numpy")
def _mark_bends(start, corners, shape, excess, bends):  # type: ignore[no-untyped-def]
    n = bends.shape[0]
    uses = np.zeros(n, np.int32)  # wedges at the present vertex that hold neighbour i
    parent = np.zeros(n, np.uint32)  # fans of the present vertex, as a forest of neighbours
    for a in range(n):
        first, last = start[np.uint32(a)], start[np.uint32(a + 1)]
        crowded = False
        for k in range(first, last):
            for j in range(2):
                uses[corners[k, j]] = 0
                parent[corners[k, j]] = corners[k, j]
        for k in range(first, last):
            p, q = corners[k, 0], corners[k, 1]
            uses[p] += 1
            uses[q] += 1
            crowded = crowded or uses[p] > 2 or uses[q] > 2
            parent[_root(parent, p)] = _root(parent, q)
        # The angles add up as a rotation, with full turns counted: one arc tangent instead of one per wedge.
        turns = 0
        x, y = 1.0, 0.0
        for k in range(first, last):
            if crowded and _repeats(corners, first, k):  # a triangle given twice is neither saddle nor seam
                uses[corners[k, 0]] -= 1
                uses[corners[k, 1]] -= 1
                continue
            cos, sin = np.float64(shape[k, 3]), np.float64(shape[k, 4])
            x, y, below = x * cos - y * sin, x * sin + y * cos, y < 0.0
            if below and y >= 0.0:
                turns += 1
        angle = math.atan2(y, x) + 2.0 * math.pi * (turns + (y < 0.0))
        bend = angle > 2.0 * math.pi + excess
        for k in range(first, last):
            bend = bend or uses[corners[k, 0]] != 2 or uses[corners[k, 1]] != 2
            bend = bend or _root(parent, corners[k, 0]) != _root(parent, corners[first, 0])
        bends[a] = bend


def build_wedges(vertices: FloatArray, triangles: IntArray) -> WedgeGraph:
    """Build the wedge table of a checked mesh (`core.geodesics.meshes.checked_mesh`).

    Triangles that name a vertex twice carry no surface and are left out; those of zero area stay, since their
    edges still join their corners.
    """
    faces = triangles.view(np.uint32)
    start = np.zeros(len(vertices) + 1, dtype=np.uint32)
    _count(faces, start)
    total = int(start[-1])
    corners = np.empty((total, 2), dtype=np.uint32)
    shape = np.empty((total, 5), dtype=np.float32)
    bends = np.zeros(len(vertices), dtype=np.bool_)
    _fill(vertices, faces, start, corners, shape)
    _mark_bends(start, corners, shape, SADDLE_EXCESS, bends)
    width, buckets = bucket_sizes(shape[:, 2])
    return WedgeGraph(start, corners, shape, bends, width, buckets)
