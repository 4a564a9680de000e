"""The thesis's voting: bands, most voted points, biggest connected cluster, mean, nearest candidate."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from core.relocation.voting import (
    band_membership,
    biggest_cluster,
    grid_edges,
    triangle_edges,
    vote,
)


def test_a_vertex_is_in_a_band_when_its_distance_differs_by_less_than_delta():
    distances = np.array([[0.09, 0.12, 0.139, 0.141, np.inf]])
    assert band_membership(distances, np.array([0.12]), 0.02).tolist() == [[False, True, True, False, False]]


def test_an_anchor_that_the_lesion_is_not_connected_to_does_not_vote():
    assert not band_membership(np.array([[0.1, np.inf]]), np.array([np.inf]), 0.5).any()


def test_a_lesion_is_found_again_on_skin_that_was_rolled_without_stretching(
    flat_sheet, rolled_sheet, anchors
):
    edges = triangle_edges(rolled_sheet.triangles)
    for place in ([0.2, 0.3], [0.45, 0.6], [0.33, 0.12]):
        lesion = np.linalg.norm(anchors - place, axis=1)
        outcome = vote(rolled_sheet.distances(anchors), lesion, rolled_sheet.vertices, edges, 0.02)
        assert outcome is not None
        assert outcome.most_votes == len(anchors)
        assert (
            np.linalg.norm(rolled_sheet.vertices[outcome.vertex] - rolled_sheet.at(np.array(place))) < 0.012
        )


def test_clusters_are_connected_along_the_skin_not_through_the_air():
    # A path 0-1-2-3-4; 1 and 4 are candidates beside 0, yet only 0 and 1 are joined.
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 4]], np.int32)
    cluster, sizes = biggest_cluster(np.array([0, 1, 4], np.int32), edges, 5)
    assert cluster.tolist() == [0, 1]
    assert sizes == (2, 1)


def test_the_answer_is_the_candidate_nearest_to_the_mean_of_the_biggest_cluster():
    # A ring of candidates: the mean is its empty middle, the answer lies on the ring.
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(40)]) + [0.2, 0, 0] * (angle[:, None] < 1)
    edges = np.stack([np.arange(40), (np.arange(40) + 1) % 40], 1).astype(np.int32)
    outcome = vote(np.full((1, 40), 0.5), np.array([0.5]), ring, edges, 0.1)
    assert outcome is not None
    distance = np.linalg.norm(ring - outcome.mean_m, axis=1)
    assert distance[outcome.vertex] == distance.min()


def test_without_any_band_on_the_skin_there_is_no_answer():
    assert vote(np.array([[1.0, 2.0]]), np.array([9.0]), np.zeros((2, 3)), np.array([[0, 1]]), 0.1) is None


def test_the_graph_joins_eight_neighbours_but_not_across_a_depth_jump():
    pixels = np.arange(9, dtype=np.int32).reshape(3, 3)
    x, y = np.meshgrid(np.arange(3) * 0.004, np.arange(3) * 0.004)
    z = np.where(np.arange(9) % 3 == 2, 2.2, 2.0)
    edges = grid_edges(pixels, np.column_stack([x.ravel(), y.ravel(), z]))
    joined = {tuple(sorted(e)) for e in edges.tolist()}
    assert {(0, 1), (0, 3), (0, 4), (1, 3)} <= joined
    assert not any((a % 3 == 2) != (b % 3 == 2) for a, b in joined)
    assert len(joined) == len(edges) == 11 + 2


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.floats(0, 2), min_size=6, max_size=6), min_size=1, max_size=5),
    st.floats(0.01, 0.5),
)
def test_votes_are_sums_of_bands_and_the_answer_is_among_the_most_voted(rows, delta):
    distances = np.array(rows)
    lesion = distances[:, 0]
    edges = np.array([[i, i + 1] for i in range(5)], np.int32)
    outcome = vote(distances, lesion, np.arange(18.0).reshape(6, 3), edges, delta)
    assert outcome is not None
    assert (outcome.votes == band_membership(distances, lesion, delta).sum(axis=0)).all()
    assert outcome.votes[outcome.vertex] == outcome.votes.max() == len(rows)
    assert set(outcome.cluster) <= set(outcome.candidates)
    assert sum(outcome.cluster_sizes) == len(outcome.candidates)
