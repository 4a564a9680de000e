"""The queue of the fronts: vertices in buckets of equal distance, first in, first out, each in at most one.

A front only ever queues vertices less than one edge ahead of it, so a short ring of buckets replaces a
heap: taking and moving a vertex costs a few writes to memory. Order inside a bucket is free because every
method here corrects its labels. Vertex numbers are unsigned in the kernels: the compiler then need not care
for negative indices, which alone makes the fronts a third faster.

``ring`` is (b, 2) int32: first and last vertex of a bucket, -1 when empty; ``link`` is (n, 4) int32:
following vertex, preceding vertex, bucket (-1 when the vertex is not queued), and nothing, to fill 16
bytes.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

SHARE_OF_EDGE = 1.0
"""Width of a bucket, as a share of a short edge (tenth percentile)."""

MOST_BUCKETS = 1 << 16


def bucket_sizes(lengths: NDArray[np.float32]) -> tuple[float, int]:
    """Width of the buckets and how many make a ring (a power of two), from all edge lengths of a graph."""
    longest = float(lengths.max()) if len(lengths) else 0.0
    if longest <= 0.0:
        return 1.0, 4
    sample = lengths[:: max(1, len(lengths) // 4096)]
    width = SHARE_OF_EDGE * float(np.quantile(sample, 0.1))
    width = max(width, longest / (MOST_BUCKETS - 4))
    return width, 1 << int(np.ceil(np.log2(longest / width + 4.0)))


@numba.njit(nogil=True, cache=True)
def new_queue(count, buckets):  # type: ignore[no-untyped-def]
    """An empty queue for ``count`` vertices: ``ring`` and ``link``."""
    return np.full((buckets, 2), -1, np.int32), np.full((count, 4), -1, np.int32)


@numba.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def remove(ring, link, v):  # type: ignore[no-untyped-def]
    """Take vertex ``v`` (unsigned) out of its bucket."""
    following, preceding, bucket = link[v, 0], link[v, 1], np.uint32(link[v, 2])
    if preceding >= 0:
        link[np.uint32(preceding), 0] = following
    else:
        ring[bucket, 0] = following
    if following >= 0:
        link[np.uint32(following), 1] = preceding
    else:
        ring[bucket, 1] = preceding
    link[v, 2] = -1


@numba.njit(nogil=True, cache=True, error_model="numpy", inline="always")
def append(ring, link, v, bucket):  # type: ignore[no-untyped-def]
    """Queue vertex ``v`` (unsigned, not queued) last in ``bucket`` (unsigned)."""
    last = ring[bucket, 1]
    link[v, 0] = -1
    link[v, 1] = last
    link[v, 2] = np.int32(bucket)
    if last >= 0:
        link[np.uint32(last), 0] = np.int32(v)
    else:
        ring[bucket, 0] = np.int32(v)
    ring[bucket, 1] = np.int32(v)
