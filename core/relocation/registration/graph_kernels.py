"""Compiled loops that lay a deformation graph over the depth grid. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

_STEPS = np.array([[1, 0], [0, 1], [1, 1], [1, -1], [2, 1], [1, 2], [2, -1], [1, -2]], np.int32)


@njit(cache=True, nogil=True)
def coarse_edges(
    vertices: FloatArray, vertex_of_pixel: IntArray, sample_of_vertex: IntArray, step: int, jump_m: float
) -> tuple[IntArray, FloatArray]:
    """Edges (e, 2) between samples of the grid, and their lengths (e,).

    Samples are joined where the pixels between them are skin without a depth jump: a path of the skin itself.
    """
    height, width = vertex_of_pixel.shape
    rows_v, rows_u = (height + step - 1) // step, (width + step - 1) // step
    out = np.empty((rows_v * rows_u * len(_STEPS), 2), np.int32)
    length = np.empty(len(out))
    count = 0
    for v in range(0, height, step):
        for u in range(0, width, step):
            one = vertex_of_pixel[v, u]
            if one < 0 or sample_of_vertex[one] < 0:
                continue
            for k in range(len(_STEPS)):
                du, dv = _STEPS[k, 0] * step, _STEPS[k, 1] * step
                if not (0 <= u + du < width and 0 <= v + dv < height):
                    continue
                two = vertex_of_pixel[v + dv, u + du]
                if two < 0 or sample_of_vertex[two] < 0:
                    continue
                parts = max(abs(du), abs(dv))
                joined = True
                before = one
                for m in range(1, parts + 1):
                    inner = vertex_of_pixel[v + round(m * dv / parts), u + round(m * du / parts)]
                    if inner < 0 or abs(vertices[inner, 2] - vertices[before, 2]) > jump_m:
                        joined = False
                        break
                    before = inner
                if not joined:
                    continue
                d = 0.0
                for c in range(3):
                    d += (vertices[one, c] - vertices[two, c]) ** 2
                out[count, 0], out[count, 1] = sample_of_vertex[one], sample_of_vertex[two]
                length[count] = np.sqrt(d)
                count += 1
    return out[:count], length[:count]


@njit(cache=True, nogil=True)
def poisson_nodes(points: FloatArray, order: NDArray[np.int64], spacing_m: float) -> IntArray:
    """Greedy choice of points (n, 3) no two of which are nearer than ``spacing_m``, in the given order."""
    low = np.array([points[:, 0].min(), points[:, 1].min(), points[:, 2].min()])
    cells = np.empty(3, np.int64)
    for c in range(3):
        cells[c] = int((points[:, c].max() - low[c]) / spacing_m) + 3
    head = np.full(cells[0] * cells[1] * cells[2], -1, np.int32)
    following = np.full(len(points), -1, np.int32)
    out = np.empty(len(points), np.int32)
    count = 0
    for i in order:
        a = int((points[i, 0] - low[0]) / spacing_m) + 1
        b = int((points[i, 1] - low[1]) / spacing_m) + 1
        c = int((points[i, 2] - low[2]) / spacing_m) + 1
        free = True
        for x in range(a - 1, a + 2):
            for y in range(b - 1, b + 2):
                for z in range(c - 1, c + 2):
                    j = head[(x * cells[1] + y) * cells[2] + z]
                    while j >= 0 and free:
                        d = 0.0
                        for k in range(3):
                            d += (points[i, k] - points[j, k]) ** 2
                        free = d >= spacing_m * spacing_m
                        j = following[j]
        if free:
            cell = (a * cells[1] + b) * cells[2] + c
            following[i] = head[cell]
            head[cell] = i
            out[count] = i
            count += 1
    return out[:count]


@njit(cache=True, nogil=True)
def nearest_nodes(
    start: IntArray, neighbour: IntArray, length: FloatArray, nodes: IntArray, count: int, reach_m: float
) -> tuple[IntArray, FloatArray]:
    """The geodesically nearest nodes (n, count) of every sample and their distances, -1 and inf where none.

    ``start``, ``neighbour``, ``length``: adjacency in compressed rows.
    """
    samples = len(start) - 1
    near = np.full((samples, count), -1, np.int32)
    far = np.full((samples, count), np.inf)
    distance = np.full(samples, np.inf)
    touched = np.empty(samples, np.int32)
    heap_d = np.empty(8 * samples + 64)
    heap_i = np.empty(8 * samples + 64, np.int32)
    for n in range(len(nodes)):
        marks = 1
        touched[0] = nodes[n]
        distance[nodes[n]] = 0.0
        size = 1
        heap_d[0], heap_i[0] = 0.0, nodes[n]
        while size > 0:
            d, i = heap_d[0], heap_i[0]
            size -= 1
            last_d, last_i = heap_d[size], heap_i[size]
            k = 0
            while 2 * k + 1 < size:
                child = 2 * k + 1
                if child + 1 < size and heap_d[child + 1] < heap_d[child]:
                    child += 1
                if heap_d[child] >= last_d:
                    break
                heap_d[k], heap_i[k] = heap_d[child], heap_i[child]
                k = child
            heap_d[k], heap_i[k] = last_d, last_i
            if d > distance[i]:
                continue
            slot = count - 1
            if d < far[i, slot]:
                while slot > 0 and far[i, slot - 1] > d:
                    far[i, slot], near[i, slot] = far[i, slot - 1], near[i, slot - 1]
                    slot -= 1
                far[i, slot], near[i, slot] = d, n
            for e in range(start[i], start[i + 1]):
                j = neighbour[e]
                longer = d + length[e]
                if longer < distance[j] and longer <= reach_m:
                    if distance[j] == np.inf:
                        touched[marks] = j
                        marks += 1
                    distance[j] = longer
                    k = size
                    size += 1
                    while k > 0 and heap_d[(k - 1) // 2] > longer:
                        heap_d[k], heap_i[k] = heap_d[(k - 1) // 2], heap_i[(k - 1) // 2]
                        k = (k - 1) // 2
                    heap_d[k], heap_i[k] = longer, j
        for k in range(marks):
            distance[touched[k]] = np.inf
    return near, far
