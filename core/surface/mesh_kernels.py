"""Compiled loops that turn a depth grid into a triangle mesh. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_MOST_AROUND = 64


@njit(cache=True, nogil=True)
def _joined(za: float, zb: float, zc: float, jump_m: float) -> bool:
    """Whether three depths are measured and belong to one piece of skin."""
    low, high = min(za, zb, zc), max(za, zb, zc)
    return low > 0.0 and high - low <= jump_m


@njit(cache=True, nogil=True)
def _squared_distance(points: NDArray[np.float64], i: int, j: int) -> float:
    total = 0.0
    for k in range(3):
        total += (points[i, k] - points[j, k]) ** 2
    return total


@njit(cache=True, nogil=True)
def triangulate_grid(
    points: NDArray[np.float64], height: int, width: int, jump_m: float
) -> NDArray[np.int32]:
    """Triangles (m, 3) of grid points (h * w, 3), wound to face the camera.

    Of the two diagonals of a quad the one that keeps more triangles is taken, of equal ones the shorter,
    which gives the better shaped triangles.
    """
    out = np.empty((2 * (height - 1) * (width - 1), 3), np.int32)
    m = 0
    for v in range(height - 1):
        for u in range(width - 1):
            a = v * width + u
            b, c, d = a + 1, a + width, a + width + 1
            za, zb, zc, zd = points[a, 2], points[b, 2], points[c, 2], points[d, 2]
            if (za > 0.0) + (zb > 0.0) + (zc > 0.0) + (zd > 0.0) < 3:
                continue
            acb, bcd = _joined(za, zc, zb, jump_m), _joined(zb, zc, zd, jump_m)
            acd, adb = _joined(za, zc, zd, jump_m), _joined(za, zd, zb, jump_m)
            first, second = acb + bcd, acd + adb
            if first == second and first > 0:
                use_first = _squared_distance(points, b, c) <= _squared_distance(points, a, d)
            else:
                use_first = first > second
            if use_first:
                if acb:
                    out[m, 0], out[m, 1], out[m, 2] = a, c, b
                    m += 1
                if bcd:
                    out[m, 0], out[m, 1], out[m, 2] = b, c, d
                    m += 1
            else:
                if acd:
                    out[m, 0], out[m, 1], out[m, 2] = a, c, d
                    m += 1
                if adb:
                    out[m, 0], out[m, 1], out[m, 2] = a, d, b
                    m += 1
    return out[:m].copy()


@njit(cache=True, nogil=True)
def corners_of_vertices(
    triangles: NDArray[np.int32], count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """For each of ``count`` vertices the triangles around it: starts (count + 1,) and triangle rows."""
    start = np.zeros(count + 1, np.int32)
    for t in range(len(triangles)):
        for k in range(3):
            start[triangles[t, k] + 1] += 1
    for i in range(count):
        start[i + 1] += start[i]
    place = start[:-1].copy()
    rows = np.empty(3 * len(triangles), np.int32)
    for t in range(len(triangles)):
        for k in range(3):
            vertex = triangles[t, k]
            rows[place[vertex]] = t
            place[vertex] += 1
    return start, rows


@njit(cache=True, nogil=True)
def _neighbours(
    triangles: NDArray[np.int32], rows: NDArray[np.int32], vertex: int, around: NDArray[np.int32]
) -> int:
    """Number of vertices joined to ``vertex`` by the triangles ``rows``; ``around`` is scratch space."""
    n = 0
    for k in range(len(rows)):
        for corner in range(3):
            other = triangles[rows[k], corner]
            known = other == vertex
            for j in range(n):
                known = known or around[j] == other
            if not known and n < len(around):
                around[n] = other
                n += 1
    return n


@njit(cache=True, nogil=True)
def mark_bow_ties(triangles: NDArray[np.int32], count: int, alive: NDArray[np.bool_]) -> int:
    """Where fans of triangles meet in a vertex only, keep the largest fan; returns how many triangles went.

    A vertex with two fans is not a surface there: a path could jump from one body part to the other, and
    boundary walks are undefined.
    """
    start, rows = corners_of_vertices(triangles, count)
    removed = 0
    fan = np.empty(_MOST_AROUND, np.int32)
    size = np.empty(_MOST_AROUND, np.int32)
    around = np.empty(2 * _MOST_AROUND, np.int32)
    for vertex in range(count):
        lo, n = start[vertex], start[vertex + 1] - start[vertex]
        if n < 2 or n > _MOST_AROUND:
            continue
        if _neighbours(triangles, rows[lo : lo + n], vertex, around) <= n + 1:
            continue  # one fan
        for i in range(n):
            fan[i] = i
        changed = True
        while changed:
            changed = False
            for i in range(n):
                if not alive[rows[lo + i]]:
                    continue
                for j in range(i):
                    if not alive[rows[lo + j]] or fan[i] == fan[j]:
                        continue
                    shared = 0
                    for p in range(3):
                        for q in range(3):
                            shared += triangles[rows[lo + i], p] == triangles[rows[lo + j], q]
                    if shared >= 2:
                        low = min(fan[i], fan[j])
                        fan[i] = low
                        fan[j] = low
                        changed = True
        size[:n] = 0
        best = -1
        for i in range(n):
            if alive[rows[lo + i]]:
                size[fan[i]] += 1
                if best < 0 or size[fan[i]] > size[best]:
                    best = fan[i]
        for i in range(n):
            if alive[rows[lo + i]] and fan[i] != best:
                alive[rows[lo + i]] = False
                removed += 1
    return removed


@njit(cache=True, nogil=True)
def _root(parents: NDArray[np.int32], i: int) -> int:
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True, nogil=True)
def vertex_components(triangles: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Connected component of each vertex, numbered from the largest (0) down."""
    parents = np.arange(count).astype(np.int32)
    for t in range(len(triangles)):
        a = _root(parents, triangles[t, 0])
        for k in range(1, 3):
            b = _root(parents, triangles[t, k])
            if a != b:
                parents[max(a, b)] = min(a, b)
                a = min(a, b)
    sizes = np.zeros(count, np.int32)
    for i in range(count):
        sizes[_root(parents, i)] += 1
    roots = np.flatnonzero(sizes)
    order = np.argsort(-sizes[roots], kind="mergesort")
    rank = np.zeros(count, np.int32)
    for i in range(len(order)):
        rank[roots[order[i]]] = i
    out = np.empty(count, np.int32)
    for i in range(count):
        out[i] = rank[_root(parents, i)]
    return out


@njit(cache=True, nogil=True)
def normals_and_boundary(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    start: NDArray[np.int32],
    rows: NDArray[np.int32],
    normals: NDArray[np.float64],
    boundary: NDArray[np.bool_],
) -> None:
    """Area-weighted unit normals, and whether a vertex lies on the rim: one neighbour more than triangles."""
    for i in range(len(vertices)):
        nx, ny, nz = 0.0, 0.0, 0.0
        around = np.empty(2 * _MOST_AROUND, np.int32)
        for k in range(start[i], start[i + 1]):
            t = rows[k]
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            px, py, pz = (
                vertices[b, 0] - vertices[a, 0],
                vertices[b, 1] - vertices[a, 1],
                vertices[b, 2] - vertices[a, 2],
            )
            qx, qy, qz = (
                vertices[c, 0] - vertices[a, 0],
                vertices[c, 1] - vertices[a, 1],
                vertices[c, 2] - vertices[a, 2],
            )
            nx += py * qz - pz * qy
            ny += pz * qx - px * qz
            nz += px * qy - py * qx
        n = _neighbours(triangles, rows[start[i] : start[i + 1]], i, around)
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length > 0.0:
            normals[i, 0], normals[i, 1], normals[i, 2] = nx / length, ny / length, nz / length
        boundary[i] = n != start[i + 1] - start[i]
