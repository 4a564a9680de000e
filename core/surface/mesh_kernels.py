"""Compiled loops that turn a depth grid into a triangle mesh. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_NEVER = -1.0


@njit(cache=True, nogil=True)
def _quality(points: NDArray[np.float64], a: int, b: int, c: int, jump_m: float) -> float:
    """Shape of a triangle: 1 equilateral, 0 a needle, negative if it would cross a depth jump or a hole."""
    za, zb, zc = points[a, 2], points[b, 2], points[c, 2]
    if za <= 0.0 or zb <= 0.0 or zc <= 0.0:
        return _NEVER
    if max(za, zb, zc) - min(za, zb, zc) > jump_m:
        return _NEVER
    p, q = points[b] - points[a], points[c] - points[a]
    nx = p[1] * q[2] - p[2] * q[1]
    ny = p[2] * q[0] - p[0] * q[2]
    nz = p[0] * q[1] - p[1] * q[0]
    r = points[c] - points[b]
    edges = np.sum(p * p) + np.sum(q * q) + np.sum(r * r)
    return float(2.0 * np.sqrt(3.0) * np.sqrt(nx * nx + ny * ny + nz * nz) / edges)


@njit(cache=True, nogil=True)
def triangulate_grid(
    points: NDArray[np.float64], height: int, width: int, jump_m: float
) -> NDArray[np.int32]:
    """Triangles (m, 3) of grid points (h * w, 3), wound to face the camera.

    Of the two diagonals of a quad the one that keeps more triangles, then the better shaped ones, is taken.
    """
    out = np.empty((2 * (height - 1) * (width - 1), 3), np.int32)
    m = 0
    for v in range(height - 1):
        for u in range(width - 1):
            a = v * width + u
            b, c, d = a + 1, a + width, a + width + 1
            if (
                (points[a, 2] > 0.0) + (points[b, 2] > 0.0) + (points[c, 2] > 0.0) + (points[d, 2] > 0.0)
            ) < 3:
                continue
            acb, bcd = _quality(points, a, c, b, jump_m), _quality(points, b, c, d, jump_m)
            acd, adb = _quality(points, a, c, d, jump_m), _quality(points, a, d, b, jump_m)
            first = (acb >= 0.0) + (bcd >= 0.0)
            second = (acd >= 0.0) + (adb >= 0.0)
            if first == 0 and second == 0:
                continue
            if first == 1 and second == 1:
                use_first = max(acb, bcd) >= max(acd, adb)
            elif first == second:
                use_first = min(acb, bcd) >= min(acd, adb)
            else:
                use_first = first > second
            if use_first:
                if acb >= 0.0:
                    out[m, 0], out[m, 1], out[m, 2] = a, c, b
                    m += 1
                if bcd >= 0.0:
                    out[m, 0], out[m, 1], out[m, 2] = b, c, d
                    m += 1
            else:
                if acd >= 0.0:
                    out[m, 0], out[m, 1], out[m, 2] = a, c, d
                    m += 1
                if adb >= 0.0:
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
def mark_bow_ties(triangles: NDArray[np.int32], count: int, alive: NDArray[np.bool_]) -> int:
    """Where fans of triangles meet in a vertex only, keep the largest fan; returns how many triangles went.

    A vertex with two fans is not a surface there: a path could jump from one body part to the other, and
    boundary walks are undefined.
    """
    start, rows = corners_of_vertices(triangles, count)
    removed = 0
    fan = np.empty(64, np.int32)
    size = np.empty(64, np.int32)
    for vertex in range(count):
        lo, n = start[vertex], start[vertex + 1] - start[vertex]
        if n < 2 or n > 64:
            continue
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
    order = np.argsort(-sizes, kind="mergesort")
    rank = np.empty(count, np.int32)
    for i in range(count):
        rank[order[i]] = i
    out = np.empty(count, np.int32)
    for i in range(count):
        out[i] = rank[_root(parents, i)]
    return out


@njit(cache=True, nogil=True, parallel=True)
def normals_and_boundary(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    start: NDArray[np.int32],
    rows: NDArray[np.int32],
    normals: NDArray[np.float64],
    boundary: NDArray[np.bool_],
) -> None:
    """Area-weighted unit normals, and whether a vertex lies on the rim: one neighbour more than triangles."""
    for index in prange(len(vertices)):
        i = np.int64(index)
        nx, ny, nz = 0.0, 0.0, 0.0
        around = np.empty(128, np.int32)
        n = 0
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
            for corner in range(3):
                vertex = triangles[t, corner]
                known = vertex == i
                for j in range(n):
                    known = known or around[j] == vertex
                if not known and n < 128:
                    around[n] = vertex
                    n += 1
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length > 0.0:
            normals[i, 0], normals[i, 1], normals[i, 2] = nx / length, ny / length, nz / length
        boundary[i] = n != start[i + 1] - start[i]
