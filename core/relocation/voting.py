"""Voting by geodesic bands: the thesis's relocation, kept exactly (METHOD section 1, eq. 1, 5, 6).

A skin point x of the follow-up gets one vote from every anchor i whose geodesic distance agrees with the
lesion's: ``v_i(x) = 1 if |d_i(x) - d0_i| < delta``. The most voted points are clustered by their connection
on the surface graph, the biggest cluster is kept, its 3D mean taken, and the candidate nearest to that mean
is the answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class VotingOutcome:
    """The steps of one vote, kept so that they can be shown.

    Attributes
    ----------
    votes : ndarray (n,) int16
        Number of bands that hold each vertex (eq. 5).
    candidates : ndarray (m,) int32
        The most voted vertices.
    cluster : ndarray (k,) int32
        The biggest connected cluster of candidates.
    mean_m : ndarray (3,)
        Its mean in space.
    vertex : int
        The candidate nearest to that mean: the answer (eq. 6).
    cluster_sizes : tuple of int
        All clusters' sizes, descending.
    """

    votes: NDArray[np.int16]
    candidates: IntArray
    cluster: IntArray
    mean_m: FloatArray
    vertex: int
    cluster_sizes: tuple[int, ...]

    @property
    def most_votes(self) -> int:
        """Votes of the candidates."""
        return int(self.votes[self.candidates[0]])


def band_membership(distances: FloatArray, lesion: FloatArray, delta_m: float) -> NDArray[np.bool_]:
    """Bands of eq. 1, (a, n): whether vertex x lies within ``delta_m`` of anchor i's ring.

    Parameters
    ----------
    distances : ndarray (a, n)
        Geodesic distance of every vertex to every anchor, metres; inf where unreachable.
    lesion : ndarray (a,)
        The lesion's distances in the first visit; an anchor with inf there takes no part.
    """
    reached = np.isfinite(lesion)
    d0 = np.where(reached, lesion, 0.0)[:, None]
    return np.asarray((np.abs(distances - d0) < delta_m) & reached[:, None])


def biggest_cluster(candidates: IntArray, edges: IntArray, count: int) -> tuple[IntArray, tuple[int, ...]]:
    """The biggest set of candidates connected by edges between candidates, and the sizes of all sets.

    Parameters
    ----------
    candidates : ndarray (m,)
        Vertex numbers.
    edges : ndarray (e, 2)
        Edges of the surface graph.
    count : int
        Number of vertices of the graph.
    """
    local = np.full(count, -1, np.int32)
    local[candidates] = np.arange(len(candidates), dtype=np.int32)
    ends = local[edges]
    ends = ends[(ends >= 0).all(axis=1)]
    graph = coo_matrix(
        (np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(len(candidates), len(candidates))
    )
    _, label = connected_components(graph, directed=False)
    sizes = np.bincount(label)
    chosen = int(sizes.argmax())
    return candidates[label == chosen], tuple(int(s) for s in np.sort(sizes)[::-1])


def vote(
    distances: FloatArray, lesion: FloatArray, vertices: FloatArray, edges: IntArray, delta_m: float
) -> VotingOutcome | None:
    """Relocate one lesion by voting.

    Parameters
    ----------
    distances : ndarray (a, n)
        Distance fields of the follow-up, metres.
    lesion : ndarray (a,)
        The lesion's distances in the first visit.
    vertices : ndarray (n, 3)
        The follow-up's skin points.
    edges : ndarray (e, 2)
        Edges of the graph (or mesh) that the distances were computed on.
    delta_m : float
        Half width of a band.

    Returns
    -------
    VotingOutcome or None
        None when no vertex got a single vote.
    """
    votes = band_membership(distances, lesion, delta_m).sum(axis=0).astype(np.int16)
    most = int(votes.max(initial=0))
    if most == 0:
        return None
    candidates = np.flatnonzero(votes == most).astype(np.int32)
    cluster, sizes = biggest_cluster(candidates, edges, len(vertices))
    mean = vertices[cluster].mean(axis=0)
    nearest = int(((vertices[candidates] - mean) ** 2).sum(axis=1).argmin())
    return VotingOutcome(votes, candidates, cluster, mean, int(candidates[nearest]), sizes)


def triangle_edges(triangles: IntArray) -> IntArray:
    """Edges (e, 2) of a mesh, each once."""
    pairs = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    width = int(pairs.max(initial=0)) + 1
    keys = np.unique(pairs[:, 0].astype(np.int64) * width + pairs[:, 1])
    return np.stack([keys // width, keys % width], axis=1).astype(np.int32)


_HALF_NEIGHBOURS: Sequence[tuple[int, int]] = ((0, 1), (1, 0), (1, 1), (1, -1))


def grid_edges(vertex_of_pixel: IntArray, vertices: FloatArray, jump_m: float = 0.05) -> IntArray:
    """Edges (e, 2) of the 8-neighbour graph of depth pixels (thesis fig. 6), none across a depth jump.

    Parameters
    ----------
    vertex_of_pixel : ndarray (height, width)
        Vertex at each depth pixel, -1 where there is none.
    vertices : ndarray (n, 3)
        Metres.
    jump_m : float
        Longer edges are left out.
    """
    height, width = vertex_of_pixel.shape
    parts = []
    for dy, dx in _HALF_NEIGHBOURS:
        rows = slice(0, height - dy), slice(dy, height)
        columns = (
            (slice(0, width - dx), slice(dx, width)) if dx >= 0 else (slice(-dx, width), slice(0, width + dx))
        )
        pair = np.stack([vertex_of_pixel[rows[0], columns[0]], vertex_of_pixel[rows[1], columns[1]]], axis=-1)
        parts.append(pair[(pair >= 0).all(axis=-1)])
    edges = np.concatenate(parts)
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    return np.asarray(edges[length < jump_m], dtype=np.int32)
