"""The deformation graph: nodes all over the skin, each place carried by nodes of its own skin."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from core.relocation.registration.graph import DeformationGraph
from tests.core.relocation.shapes import CAMERA, Capsule, graph_on, near_to, still_bone, surface_of

SPACING = 0.045
TRUNK = Capsule(np.array([0.0, -0.2, 1.5]), np.array([0.0, 0.2, 1.5]), 0.14)
ARM = Capsule(np.array([0.22, -0.2, 1.5]), np.array([0.22, 0.25, 1.5]), 0.05)
"""Hangs beside the trunk with 3 cm of air between."""
LEANING = Capsule(np.array([0.20, -0.2, 1.5]), np.array([0.17, 0.25, 1.44]), 0.05)
"""Hangs against the trunk: one skin for the camera."""

ALONE = (still_bone("trunk", TRUNK),)
"""A skeleton that tells no skin from other skin."""


def pieces(graph: DeformationGraph) -> np.ndarray:
    one, two = graph.edges.T
    count = len(graph.nodes)
    return connected_components(coo_matrix((np.ones(len(one)), (one, two)), shape=(count, count)))[1]


def own_carriers(graph: DeformationGraph, part: Capsule, other: Capsule) -> float:
    """Share of weight with which skin well on a part hangs on nodes of that part."""
    surface = graph.surface
    places = surface.vertices[near_to(surface, part)]
    carriers, weights = graph.attach(places)
    nodes = surface.vertices[graph.node_vertices]
    own = part.distance(nodes) < other.distance(nodes)
    return float((weights * own[carriers]).sum() / weights.sum())


@pytest.fixture(scope="module")
def beside():
    return graph_on(surface_of([TRUNK, ARM]), ALONE, spacing_m=SPACING)


@pytest.fixture(scope="module")
def leaning():
    return surface_of([TRUNK, LEANING])


def test_every_place_has_five_carriers_whose_weights_sum_to_one(beside):
    surface = beside.surface
    rng = np.random.default_rng(2)
    places = surface.vertices + rng.normal(0, 0.002, surface.vertices.shape)
    carriers, weights = beside.attach(places)
    assert carriers.shape == weights.shape == (len(places), 5)
    assert weights.sum(axis=1) == pytest.approx(np.ones(len(places)))
    assert weights.min() >= 0
    assert carriers.min() >= 0
    assert carriers.max() < len(beside.nodes)
    away = np.linalg.norm(surface.vertices[beside.node_vertices][carriers] - places[:, None], axis=2)
    assert (weights * away).sum(axis=1).max() < 1.5 * SPACING


def test_weights_change_smoothly_over_the_skin(beside):
    """No crease: places a millimetre apart hang on their nodes alike."""
    surface = beside.surface
    inner = np.flatnonzero(~surface.boundary)[::13]
    step = np.array([0.0, 0.001, 0.0])
    count = len(beside.nodes)
    rows = np.repeat(np.arange(len(inner)), 5)
    dense = []
    for places in (surface.vertices[inner], surface.vertices[inner] + step):
        carriers, weights = beside.attach(places)
        table = np.zeros((len(inner), count))
        np.add.at(table, (rows, carriers.ravel()), weights.ravel())
        dense.append(table)
    change = np.abs(dense[0] - dense[1]).sum(axis=1)
    assert np.median(change) < 0.1
    assert np.quantile(change, 0.99) < 0.4


def test_nodes_keep_their_distance_and_leave_no_skin_bare(beside):
    nodes = beside.surface.vertices[beside.node_vertices]
    assert pdist(nodes).min() >= SPACING
    away, _ = cKDTree(nodes).query(beside.surface.vertices[beside.samples])
    assert away.max() <= SPACING


def test_an_arm_beside_the_trunk_does_not_hang_on_the_trunk(beside):
    assert own_carriers(beside, ARM, TRUNK) == pytest.approx(1.0)
    assert own_carriers(beside, TRUNK, ARM) == pytest.approx(1.0)


def test_skin_that_touches_is_told_apart_by_the_skeleton(leaning):
    upper = still_bone("upper", Capsule(LEANING.start, LEANING.start + np.array([0.0, 0.02, 0.0]), 0.05), 0)
    fore = still_bone("fore", Capsule(LEANING.start + np.array([0.0, 0.02, 0.0]), LEANING.end, 0.05), 1)
    trunk = still_bone("trunk", TRUNK)
    blind = graph_on(leaning, ALONE, spacing_m=SPACING)
    knowing = graph_on(leaning, (trunk, upper, fore), spacing_m=SPACING)
    assert own_carriers(knowing, LEANING, TRUNK) > 0.9
    assert own_carriers(blind, LEANING, TRUNK) < own_carriers(knowing, LEANING, TRUNK) - 0.02


def test_edges_go_both_ways_and_never_to_oneself(beside):
    pairs = {(int(a), int(b)) for a, b in beside.edges}
    assert all((b, a) in pairs and a != b for a, b in pairs)


def strip(rows: int) -> np.ndarray:
    """A strap across the picture without measurement, so many pixels high."""
    hidden = np.zeros((CAMERA.height, CAMERA.width), bool)
    hidden[60 : 60 + rows] = True
    return hidden


def test_pieces_that_the_view_cut_apart_are_tied_together():
    whole = Capsule(np.array([0.0, -0.3, 1.5]), np.array([0.0, 0.3, 1.5]), 0.10)
    cut = surface_of([whole], hidden=strip(5))
    assert cut.component.max() == 1
    assert pieces(graph_on(cut, ALONE, spacing_m=SPACING)).max() == 0
    bones = (still_bone("trunk", whole),)
    assert pieces(graph_on(cut, bones, spacing_m=SPACING)).max() == 0


def test_a_wide_gap_is_not_bridged():
    whole = Capsule(np.array([0.0, -0.3, 1.5]), np.array([0.0, 0.3, 1.5]), 0.10)
    graph = graph_on(surface_of([whole], hidden=strip(25)), ALONE, spacing_m=SPACING)
    assert pieces(graph).max() == 1


def test_pieces_of_bones_that_are_no_neighbours_stay_apart():
    """The forearm beside the trunk may come near; only over the upper arm is it joined to it."""
    trunk, fore = still_bone("trunk", TRUNK), still_bone("fore", ARM, 1)
    upper = still_bone("upper", Capsule(np.array([0.9, -0.3, 1.5]), np.array([0.9, -0.2, 1.5]), 0.05), 0)
    graph = graph_on(surface_of([TRUNK, ARM]), (trunk, upper, fore), spacing_m=SPACING)
    assert pieces(graph).max() == 1
    joined = graph_on(surface_of([TRUNK, ARM]), (trunk, still_bone("upper", ARM, 0)), spacing_m=SPACING)
    assert pieces(joined).max() == 0


def test_neighbours_have_near_numbers(beside):
    count = len(beside.nodes)
    off = np.abs(beside.edges[:, 0] - beside.edges[:, 1])
    assert off.max() < count / 2
    assert off.mean() < count / 6


def test_the_same_seed_chooses_the_same_nodes(beside):
    again = graph_on(beside.surface, ALONE, spacing_m=SPACING)
    other = graph_on(beside.surface, ALONE, spacing_m=SPACING, seed=1)
    assert (again.nodes == beside.nodes).all()
    assert (again.edges == beside.edges).all()
    assert set(other.nodes.tolist()) != set(beside.nodes.tolist())
