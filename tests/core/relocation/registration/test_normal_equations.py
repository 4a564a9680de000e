"""The compiled normal equations are those of the stated energy, checked by dense finite differences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.relocation.registration.equation_kernels import (
    add_places,
    add_stiffness,
    apply_step,
    turn_normals,
    warp_places,
)

NODES, CARRIERS = 6, 3
STEP = 1e-5
SEEDS = st.integers(0, 2**32 - 1)


@dataclass
class Graph:
    """A few nodes with turns and places of their own."""

    rng: np.random.Generator
    rotation: np.ndarray
    start: np.ndarray
    node_rest: np.ndarray
    node_now: np.ndarray

    @classmethod
    def random(cls, seed: int, *, turned: float = 0.5) -> Graph:
        rng = np.random.default_rng(seed)
        rotation = Rotation.from_rotvec(rng.normal(0, turned / 2, (NODES, 3))).as_matrix()
        start = Rotation.from_rotvec(rng.normal(0, turned / 2, (NODES, 3))).as_matrix()
        rest = rng.normal(0, 0.05, (NODES, 3))
        return cls(rng, np.ascontiguousarray(rotation), np.ascontiguousarray(start), rest,
                   rest + rng.normal(0, 0.02, (NODES, 3)))  # fmt: skip

    def stepped(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rotations and places after unknowns (6 m,): turned from the left, then shifted."""
        parts = step.reshape(-1, 6)
        return Rotation.from_rotvec(parts[:, :3]).as_matrix() @ self.rotation, self.node_now + parts[:, 3:]

    def system(self) -> tuple[np.ndarray, np.ndarray]:
        size = 6 * NODES
        return np.zeros((size, size), order="F"), np.zeros(size)


def dense(band: np.ndarray) -> np.ndarray:
    """The symmetric matrix of a lower band."""
    size = band.shape[1]
    out = np.zeros((size, size))
    for off in range(len(band)):
        rows = np.arange(size - off)
        out[rows + off, rows] = out[rows, rows + off] = band[off, : size - off]
    return out


def jacobian(residuals, size: int) -> np.ndarray:
    columns = []
    for k in range(size):
        step = np.zeros(size)
        step[k] = STEP
        columns.append((residuals(step) - residuals(-step)) / (2 * STEP))
    return np.stack(columns, axis=1)


def gradient(energy, size: int) -> np.ndarray:
    return jacobian(lambda step: np.array([energy(step)]), size)[0]


@given(SEEDS)
@settings(max_examples=15, deadline=None)
def test_places_pull_with_the_gradient_and_the_gauss_newton_matrix_of_their_distances(seed):
    graph = Graph.random(seed)
    rng, count = graph.rng, 9
    rest, target = rng.normal(0, 0.05, (count, 3)), rng.normal(0, 0.05, (count, 3))
    carriers = np.array([rng.permutation(NODES)[:CARRIERS] for _ in range(count)], np.int32)
    weights = rng.dirichlet(np.ones(CARRIERS), count)
    weights[0] = [1.0, 0.0, 0.0]
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across, isotropic = rng.uniform(0, 2, count), rng.uniform(0, 2, count)
    across[1], isotropic[1] = 0.0, 0.0

    def residuals(step):
        rotation, now = graph.stepped(step)
        carried = (
            np.einsum("icrk,ick->icr", rotation[carriers], rest[:, None] - graph.node_rest[carriers])
            + now[carriers]
        )
        off = (weights[..., None] * carried).sum(axis=1) - target
        plane = np.sqrt(across) * np.einsum("ik,ik->i", normal, off)
        return np.concatenate([plane, (np.sqrt(isotropic)[:, None] * off).ravel()])

    band, right = graph.system()
    add_places(
        rest, carriers, weights, normal, target, across, isotropic, graph.rotation, graph.node_rest,
        graph.node_now, band, right,
    )  # fmt: skip
    j = jacobian(residuals, len(right))
    assert dense(band) == pytest.approx(j.T @ j, abs=1e-7)
    assert right == pytest.approx(-j.T @ residuals(np.zeros(len(right))), abs=1e-8)


EDGES = np.array([[0, 1], [1, 2], [4, 2], [0, 5], [3, 5]], np.int32)


def edge_residuals(graph: Graph, step: np.ndarray) -> np.ndarray:
    rotation, now = graph.stepped(step)
    i, j = EDGES.T
    mean = 0.5 * (rotation[i] + rotation[j])
    return np.einsum("ers,es->er", mean, graph.node_rest[j] - graph.node_rest[i]) + now[i] - now[j]


def turn_residuals(graph: Graph, step: np.ndarray) -> np.ndarray:
    rotation, _ = graph.stepped(step)
    own = rotation @ graph.start.transpose(0, 2, 1)
    i, j = EDGES.T
    return Rotation.from_matrix(own[i] @ own[j].transpose(0, 2, 1)).as_rotvec()


@given(SEEDS)
@settings(max_examples=15, deadline=None)
def test_edges_resist_with_the_gauss_newton_matrix_of_their_stretch(seed):
    graph = Graph.random(seed)
    band, right = graph.system()
    add_stiffness(
        EDGES, 3.0, 1e6, 0.0, graph.rotation, graph.start, graph.node_rest, graph.node_now, band, right
    )
    j = jacobian(lambda step: edge_residuals(graph, step).ravel(), len(right))
    assert dense(band) == pytest.approx(3.0 * j.T @ j, abs=1e-7)
    assert right == pytest.approx(-3.0 * j.T @ edge_residuals(graph, np.zeros(len(right))).ravel(), abs=1e-8)


@given(SEEDS, st.floats(0.002, 0.2), st.floats(0.0, 1.0))
@settings(max_examples=15, deadline=None)
def test_the_right_side_is_downhill_also_where_edges_let_go_and_nodes_turn(seed, slip_m, turning):
    graph = Graph.random(seed)

    def energy(step):
        square = (edge_residuals(graph, step) ** 2).sum(axis=1)
        return 2.0 * (
            (square / (1.0 + square / slip_m**2)).sum() + turning * (turn_residuals(graph, step) ** 2).sum()
        )

    band, right = graph.system()
    add_stiffness(
        EDGES, 2.0, slip_m, turning, graph.rotation, graph.start, graph.node_rest, graph.node_now, band, right
    )
    assert right == pytest.approx(-0.5 * gradient(energy, len(right)), abs=1e-6)
    assert np.linalg.eigvalsh(dense(band)).min() > -1e-9


def test_neighbours_that_turn_alike_resist_turning_apart_exactly():
    graph = Graph.random(4)
    common = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    graph.rotation = np.ascontiguousarray(common @ graph.start)
    edge, right = graph.system()
    add_stiffness(
        EDGES, 2.0, 1.0, 0.0, graph.rotation, graph.start, graph.node_rest, graph.node_now, edge, right
    )
    both, right = graph.system()
    add_stiffness(
        EDGES, 2.0, 1.0, 0.7, graph.rotation, graph.start, graph.node_rest, graph.node_now, both, right
    )
    j = jacobian(lambda step: turn_residuals(graph, step).ravel(), len(right))
    assert dense(both) - dense(edge) == pytest.approx(2.0 * 0.7 * j.T @ j, abs=1e-6)


def test_an_edge_over_a_bent_joint_costs_nothing():
    """Two nodes that stay on their own bones: half of the edge turns with each."""
    bend = np.stack([np.eye(3), Rotation.from_rotvec([0.0, 0.0, 1.4]).as_matrix()])
    rest = np.array([[-0.02, 0.0, 0.0], [0.02, 0.0, 0.0]])
    now = np.array([rest[0], bend[1] @ rest[1]])
    band, right = np.zeros((12, 12), order="F"), np.zeros(12)
    add_stiffness(np.array([[0, 1]], np.int32), 1.0, 1.0, 0.0, bend, bend, rest, now, band, right)
    assert right == pytest.approx(np.zeros(12), abs=1e-12)


@given(SEEDS, st.floats(1e-9, 3.0))
@settings(max_examples=20, deadline=None)
def test_a_step_turns_and_shifts_the_nodes(seed, size):
    graph = Graph.random(seed)
    step = graph.rng.normal(0, size, 6 * NODES)
    rotation, now = graph.stepped(step)
    apply_step(step, graph.rotation, graph.node_now)
    assert graph.rotation == pytest.approx(rotation, abs=1e-9)
    assert graph.node_now == pytest.approx(now)


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_nodes_that_move_alike_carry_everything_rigidly(seed):
    graph = Graph.random(seed)
    rotation, shift = Rotation.from_rotvec(graph.rng.normal(size=3)).as_matrix(), graph.rng.normal(size=3)
    places, normals = graph.rng.normal(size=(20, 3)), graph.rng.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    carriers = graph.rng.integers(0, NODES, (20, CARRIERS)).astype(np.int32)
    weights = graph.rng.dirichlet(np.ones(CARRIERS), 20)
    turned = np.ascontiguousarray(np.tile(rotation, (NODES, 1, 1)))
    carried = warp_places(
        places, carriers, weights, turned, graph.node_rest, graph.node_rest @ rotation.T + shift
    )
    assert carried == pytest.approx(places @ rotation.T + shift)
    assert turn_normals(normals, carriers, weights, turned) == pytest.approx(normals @ rotation.T)
