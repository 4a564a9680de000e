"""Compiled ray and nearest-point queries in a pyramid of boxes over the depth grid. Imported only when used.

The triangles of a depth surface are already sorted in space by the image: tiles of the grid are the leaves,
and four neighbouring boxes make their parent. Building it is one pass, and rays from any camera can be traced
through it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_STACK = 128


@njit(cache=True, nogil=True)
def build_tree(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    pixels: NDArray[np.int32],
    tile: int,
    dims: NDArray[np.int32],
    offsets: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Triangles sorted by tile and the boxes of all levels.

    ``dims`` (levels, 2) are rows and columns per level, finest first; ``offsets`` where each level's boxes
    begin. Returns start (tiles + 1,), order (m,) and boxes (sum of levels, 6: low x y z, high x y z).
    """
    rows, columns = dims[0, 0], dims[0, 1]
    m = len(triangles)
    tile_of = np.empty(m, np.int32)
    start = np.zeros(rows * columns + 1, np.int32)
    boxes = np.empty((offsets[-1], 6))
    boxes[:, :3] = np.inf
    boxes[:, 3:] = -np.inf
    for t in range(m):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        u = min(pixels[a, 0], pixels[b, 0], pixels[c, 0])
        v = min(pixels[a, 1], pixels[b, 1], pixels[c, 1])
        k = (v // tile) * columns + u // tile
        tile_of[t] = k
        start[k + 1] += 1
        for q in range(3):
            boxes[k, q] = min(boxes[k, q], vertices[a, q], vertices[b, q], vertices[c, q])
            boxes[k, 3 + q] = max(boxes[k, 3 + q], vertices[a, q], vertices[b, q], vertices[c, q])
    for k in range(rows * columns):
        start[k + 1] += start[k]
    place = start[:-1].copy()
    order = np.empty(m, np.int32)
    for t in range(m):
        order[place[tile_of[t]]] = t
        place[tile_of[t]] += 1
    for level in range(1, len(dims)):
        below = dims[level - 1, 1]
        for r in range(dims[level - 1, 0]):
            for c in range(below):
                child = offsets[level - 1] + r * below + c
                parent = offsets[level] + (r // 2) * dims[level, 1] + c // 2
                for q in range(3):
                    boxes[parent, q] = min(boxes[parent, q], boxes[child, q])
                    boxes[parent, 3 + q] = max(boxes[parent, 3 + q], boxes[child, 3 + q])
    return start, order, boxes


@njit(cache=True, nogil=True)
def _enter(box: NDArray[np.float64], o: NDArray[np.float64], inverse: NDArray[np.float64]) -> float:
    """Ray parameter at which a box is entered, infinite if it is missed or empty."""
    if box[0] > box[3]:  # nothing in it: from infinity to minus infinity, which every ray would cross
        return np.inf
    near, far = 0.0, np.inf
    for q in range(3):
        a, b = (box[q] - o[q]) * inverse[q], (box[3 + q] - o[q]) * inverse[q]
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near if near <= far * (1.0 + 1e-12) + 1e-12 else np.inf


@njit(cache=True, nogil=True)
def cast_rays(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    start: NDArray[np.int32],
    order: NDArray[np.int32],
    boxes: NDArray[np.float64],
    dims: NDArray[np.int32],
    offsets: NDArray[np.int32],
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    t_out: NDArray[np.float64],
    triangle_out: NDArray[np.int32],
    weights_out: NDArray[np.float64],
) -> None:
    """First hit of each ray: parameter (inf = none), triangle (-1 = none), barycentric weights."""
    for i in range(len(directions)):
        d = directions[i]
        inverse = np.empty(3)
        for q in range(3):
            inverse[q] = 1.0 / d[q] if abs(d[q]) > 1e-30 else 1e30
        best, hit, hit_b, hit_c = np.inf, -1, 0.0, 0.0
        levels = np.empty(_STACK, np.int32)
        nodes = np.empty(_STACK, np.int32)
        levels[0], nodes[0] = len(dims) - 1, 0
        size = 1
        while size > 0:
            size -= 1
            level, node = levels[size], nodes[size]
            if _enter(boxes[offsets[level] + node], origin, inverse) >= best:
                continue
            if level > 0:
                columns, finer = dims[level, 1], dims[level - 1]
                r, c = 2 * (node // columns), 2 * (node % columns)
                for k in range(4):
                    rr, cc = r + k // 2, c + k % 2
                    if rr < finer[0] and cc < finer[1] and size < _STACK:
                        levels[size], nodes[size] = level - 1, rr * finer[1] + cc
                        size += 1
                continue
            for k in range(start[node], start[node + 1]):
                t = order[k]
                a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
                e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                px, py, pz = d[1] * e2z - d[2] * e2y, d[2] * e2x - d[0] * e2z, d[0] * e2y - d[1] * e2x
                det = e1x * px + e1y * py + e1z * pz
                if det == 0.0:
                    continue
                sx, sy, sz = origin[0] - a[0], origin[1] - a[1], origin[2] - a[2]
                wb = (sx * px + sy * py + sz * pz) / det
                if wb < -1e-9 or wb > 1.0 + 1e-9:
                    continue
                qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
                wc = (d[0] * qx + d[1] * qy + d[2] * qz) / det
                if wc < -1e-9 or wb + wc > 1.0 + 1e-9:
                    continue
                along = (e2x * qx + e2y * qy + e2z * qz) / det
                if 1e-9 < along < best:
                    best, hit, hit_b, hit_c = along, t, wb, wc
        t_out[i], triangle_out[i] = best, hit
        weights_out[i, 0], weights_out[i, 1], weights_out[i, 2] = 1.0 - hit_b - hit_c, hit_b, hit_c


@njit(cache=True, nogil=True)
def _closest(
    p: NDArray[np.float64],
    vertices: NDArray[np.float64],
    a: int,
    b: int,
    c: int,
    weights: NDArray[np.float64],
) -> float:
    """Squared distance to a triangle, and the weights of its nearest point (Ericson 2005, 5.1.5)."""
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        ab, ac = vertices[b, k] - vertices[a, k], vertices[c, k] - vertices[a, k]
        ap, bp, cp = p[k] - vertices[a, k], p[k] - vertices[b, k], p[k] - vertices[c, k]
        d1 += ab * ap
        d2 += ac * ap
        d3 += ab * bp
        d4 += ac * bp
        d5 += ab * cp
        d6 += ac * cp
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        wb, wc = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        wb, wc = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        wb, wc = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        wb, wc = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        wb, wc = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        wc = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        wb = 1.0 - wc
    else:
        wb, wc = vb / (va + vb + vc), vc / (va + vb + vc)
    wa = 1.0 - wb - wc
    weights[0], weights[1], weights[2] = wa, wb, wc
    total = 0.0
    for k in range(3):
        total += (p[k] - wa * vertices[a, k] - wb * vertices[b, k] - wc * vertices[c, k]) ** 2
    return total


@njit(cache=True, nogil=True)
def _box_distance(box: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    total = 0.0
    for q in range(3):
        away = max(box[q] - p[q], 0.0, p[q] - box[3 + q])
        total += away * away
    return total


@njit(cache=True, nogil=True)
def nearest_points(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    start: NDArray[np.int32],
    order: NDArray[np.int32],
    boxes: NDArray[np.float64],
    dims: NDArray[np.int32],
    offsets: NDArray[np.int32],
    points: NDArray[np.float64],
    triangle_out: NDArray[np.int32],
    weights_out: NDArray[np.float64],
) -> None:
    """Exactly nearest point of the surface to each of ``points``, by branch and bound."""
    for i in range(len(points)):
        p = points[i]
        best = np.inf
        weights = np.empty(3)
        levels = np.empty(_STACK, np.int32)
        nodes = np.empty(_STACK, np.int32)
        bounds = np.empty(_STACK)
        levels[0], nodes[0], bounds[0] = len(dims) - 1, 0, 0.0
        size = 1
        while size > 0:
            size -= 1
            level, node = levels[size], nodes[size]
            if bounds[size] >= best:
                continue
            if level > 0:
                columns, finer = dims[level, 1], dims[level - 1]
                r, c = 2 * (node // columns), 2 * (node % columns)
                bottom = size
                for k in range(4):
                    rr, cc = r + k // 2, c + k % 2
                    if rr >= finer[0] or cc >= finer[1] or size >= _STACK:
                        continue
                    child = rr * finer[1] + cc
                    bound = _box_distance(boxes[offsets[level - 1] + child], p)
                    if bound >= best:
                        continue
                    place = size
                    while place > bottom and bounds[place - 1] < bound:  # the nearest ends on top
                        levels[place], nodes[place] = levels[place - 1], nodes[place - 1]
                        bounds[place] = bounds[place - 1]
                        place -= 1
                    levels[place], nodes[place], bounds[place] = level - 1, child, bound
                    size += 1
                continue
            for k in range(start[node], start[node + 1]):
                t = order[k]
                d = _closest(p, vertices, triangles[t, 0], triangles[t, 1], triangles[t, 2], weights)
                if d < best:
                    best = d
                    triangle_out[i] = t
                    for q in range(3):
                        weights_out[i, q] = weights[q]
