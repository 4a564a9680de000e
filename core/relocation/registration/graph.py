"""The deformation graph: a few hundred nodes on the skin that carry all other skin with them.

Embedded deformation (Sumner, Schmid and Pauly 2007): nodes every 45 mm, every place of the skin follows its
five nearest nodes along the skin, so that an arm beside the trunk does not hang on the trunk (METHOD
section 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.spatial import cKDTree

from core.relocation.registration.patches import SkinOwners, near_bones
from core.surface import BodySurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

SPACING_M = 0.045
CARRIERS = 5
"""Nodes that carry a place."""
NEIGHBOURS = 8
SAMPLES = 6500
"""About as many places of the skin are compared with the follow-up."""
JUMP_M = 0.03
BRIDGE_M = 0.12
"""Pieces of skin that the view cut apart are tied together over gaps up to this."""


@dataclass(frozen=True, eq=False)
class DeformationGraph:
    """Nodes over a surface, numbered so that neighbours have near numbers.

    Attributes
    ----------
    surface : BodySurface
    samples : ndarray (s,)
        Vertices of the surface on a coarser grid.
    inner : ndarray (s,) bool
        Samples off the rim.
    nodes : ndarray (m,)
        Samples that are nodes.
    carriers : ndarray (s, 9) int32
        Nearest nodes along the skin, nearest first; -1 where there are fewer.
    edges : ndarray (e, 2) int32
        Node i, node j: both directions.
    """

    surface: BodySurface
    samples: NDArray[np.int64]
    inner: NDArray[np.bool_]
    nodes: IntArray
    carriers: IntArray
    edges: IntArray
    _tree: cKDTree

    @property
    def node_vertices(self) -> NDArray[np.int64]:
        """Surface vertex (m,) of every node."""
        return self.samples[self.nodes]

    def attach(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Nodes (k, 5) that carry places (k, 3) of the rest skin, and their weights (k, 5), sum 1.

        ``w = (1 - d / d_max)^2`` with the distance of the next nearest node as ``d_max``.
        """
        nearest = self._tree.query(places)[1]
        around = self.carriers[nearest, : CARRIERS + 1]
        rest = self.surface.vertices[self.node_vertices]
        distance = np.linalg.norm(rest[np.maximum(around, 0)] - places[:, None], axis=2)
        distance[around < 0] = np.inf
        order = np.argsort(distance, axis=1)
        around = np.take_along_axis(around, order, axis=1)
        distance = np.take_along_axis(distance, order, axis=1)
        finite = np.where(np.isfinite(distance), distance, 0.0)
        farthest = np.where(np.isfinite(distance[:, -1]), distance[:, -1], 1.1 * finite.max(axis=1)) + 1e-6
        weight = np.where(
            around[:, :-1] >= 0, (1.0 - np.minimum(distance[:, :-1] / farthest[:, None], 1.0)) ** 2, 0
        )
        total = weight.sum(axis=1, keepdims=True)
        weight = np.where(total > 0, weight / np.maximum(total, 1e-12), 0.0)
        alone = total[:, 0] <= 0
        weight[alone, 0] = 1.0
        carriers = np.where(around[:, :-1] >= 0, around[:, :-1], around[:, :1])
        return carriers.astype(np.int32), np.ascontiguousarray(weight)


@dataclass(frozen=True, eq=False)
class SkinNet:
    """A surface sampled on a coarser grid, joined along the skin.

    Attributes
    ----------
    surface : BodySurface
    samples : ndarray (s,)
        Vertices.
    edges : ndarray (e, 2), lengths_m : ndarray (e,)
    """

    surface: BodySurface
    samples: NDArray[np.int64]
    edges: IntArray
    lengths_m: FloatArray

    @property
    def places(self) -> FloatArray:
        """Positions (s, 3) of the samples."""
        return self.surface.vertices[self.samples]


def skin_net(surface: BodySurface) -> SkinNet:
    """Sample a surface."""
    from core.relocation.registration.graph_kernels import coarse_edges

    step = max(1, round(np.sqrt(len(surface.vertices) / SAMPLES)))
    samples = np.flatnonzero((surface.pixels % step == 0).all(axis=1))
    number = np.full(len(surface.vertices), -1, np.int32)
    number[samples] = np.arange(len(samples), dtype=np.int32)
    edges, length = coarse_edges(surface.vertices, surface.vertex_of_pixel, number, step, JUMP_M)
    return SkinNet(surface, samples, edges, length)


def build_graph(
    net: SkinNet, owners: SkinOwners, *, spacing_m: float = SPACING_M, seed: int = 0
) -> DeformationGraph:
    """Lay a graph over a surface; skin of bones that are no neighbours is not joined, though it may touch."""
    from core.relocation.registration.graph_kernels import nearest_nodes, poisson_nodes

    places, owner = net.places, owners.of_samples
    near_bone = near_bones(owners.skeleton)
    joined = near_bone[owner[net.edges[:, 0]], owner[net.edges[:, 1]]]
    adjacency = _adjacency(net.edges[joined], net.lengths_m[joined], len(places))
    order = np.random.default_rng(seed).permutation(len(places))
    nodes = poisson_nodes(places, order, spacing_m)
    near, _ = nearest_nodes(
        adjacency.indptr, adjacency.indices, adjacency.data, nodes, NEIGHBOURS + 1, 4 * spacing_m
    )
    lost = np.flatnonzero(near[:, 0] < 0)
    if len(lost):
        near[lost, 0] = cKDTree(places[nodes]).query(places[lost])[1]
    links = _links(near[nodes], places[nodes], owner[nodes], near_bone)
    rank = _short_band(links, near, len(nodes))
    renumbered = np.where(near >= 0, rank[np.maximum(near, 0)], -1).astype(np.int32)
    kept = np.empty_like(nodes)
    kept[rank] = nodes
    return DeformationGraph(
        net.surface,
        net.samples,
        ~net.surface.boundary[net.samples],
        kept,
        renumbered,
        np.ascontiguousarray(rank[links].astype(np.int32)),
        cKDTree(places),
    )


def _adjacency(edges: IntArray, length: FloatArray, count: int) -> csr_matrix:
    both = np.concatenate([edges, edges[:, ::-1]])
    out = coo_matrix((np.tile(length, 2), (both[:, 0], both[:, 1])), shape=(count, count)).tocsr()
    out.indptr, out.indices = out.indptr.astype(np.int32), out.indices.astype(np.int32)
    return out


def _links(
    near: IntArray, places: FloatArray, owner: NDArray[np.intp], near_bone: NDArray[np.bool_]
) -> IntArray:
    """Edges between nodes, both directions: neighbours along the skin, and bridges between its pieces."""
    count = len(near)
    one = np.repeat(np.arange(count), near.shape[1])
    two = near.ravel()
    keep = (two >= 0) & (two != one)
    pairs = np.stack([one[keep], two[keep]], axis=1)
    pairs = np.concatenate([pairs, pairs[:, ::-1], _bridges(pairs, places, owner, near_bone)])
    return np.unique(pairs, axis=0).astype(np.int32)


def _bridges(
    pairs: NDArray[np.int64], places: FloatArray, owner: NDArray[np.intp], near_bone: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Edges from nodes of smaller pieces to the nearest nodes of others, of the same or the next bone."""
    from scipy.sparse.csgraph import connected_components

    count = len(places)
    linked = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    pieces, piece = connected_components(linked, directed=False)
    if pieces < 2:
        return np.empty((0, 2), np.int64)
    largest = np.bincount(piece).argmax()
    out = []
    for i in np.flatnonzero(piece != largest):
        other = (piece != piece[i]) & near_bone[owner[i], owner]
        distance = np.where(other, np.linalg.norm(places - places[i], axis=1), np.inf)
        for j in np.argsort(distance)[:2]:
            if distance[j] < BRIDGE_M:
                out += [(i, j), (j, i)]
    return np.array(out, np.int64).reshape(-1, 2)


def _short_band(links: IntArray, near: IntArray, count: int) -> NDArray[np.int64]:
    """New number of every node such that nodes that meet in an equation have near numbers."""
    group = near[:, :CARRIERS]
    one = np.repeat(group[:, :1], CARRIERS - 1, axis=1).ravel()
    two = group[:, 1:].ravel()
    keep = (one >= 0) & (two >= 0)
    rows = np.concatenate([links[:, 0], one[keep], two[keep]])
    columns = np.concatenate([links[:, 1], two[keep], one[keep]])
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
    order = np.asarray(reverse_cuthill_mckee(graph, symmetric_mode=True), np.int64)
    rank = np.empty(count, np.int64)
    rank[order] = np.arange(count)
    return rank
