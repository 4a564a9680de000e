"""An indexed 4-ary heap with decrease-key, as functions over plain arrays that kernels inline.

``heap`` holds vertices, ``place[v]`` is the position of ``v`` in it (-1 outside), keys are ``distance[v]``.
Four children per node keep the tree shallow and one node's children in one cache line.
"""

from __future__ import annotations

import numba


@numba.njit(nogil=True, cache=True, error_model="numpy")
def heap_raise(heap, place, distance, size, v):  # type: ignore[no-untyped-def]
    """Insert ``v`` or move it up after its key became smaller; returns the heap's new size."""
    i = place[v]
    if i < 0:
        i = size
        size += 1
    key = distance[v]
    while i > 0:
        up = (i - 1) >> 2
        w = heap[up]
        if distance[w] <= key:
            break
        heap[i] = w
        place[w] = i
        i = up
    heap[i] = v
    place[v] = i
    return size


@numba.njit(nogil=True, cache=True, error_model="numpy")
def heap_pop(heap, place, distance, size):  # type: ignore[no-untyped-def]
    """Take the vertex with the smallest key; returns it and the heap's new size."""
    top = heap[0]
    place[top] = -1
    size -= 1
    if size > 0:
        v = heap[size]
        key = distance[v]
        i = 0
        while True:
            child = 4 * i + 1
            if child >= size:
                break
            best = child
            smallest = distance[heap[child]]
            end = min(child + 4, size)
            for j in range(child + 1, end):
                other = distance[heap[j]]
                if other < smallest:
                    smallest = other
                    best = j
            if smallest >= key:
                break
            w = heap[best]
            heap[i] = w
            place[w] = i
            i = best
        heap[i] = v
        place[v] = i
    return top, size
