"""Distances that every place on a hand is known by, on surfaces whose distances are known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.hand.fields import HandFields, end_distance, measure_fields, rim_distance
from core.hand.names import KNUCKLES, POINT_INDEX
from core.hand.surface import HandSurface
from core.surface.body_surface import BodySurface
from tests.core.hand.made_up_hands import CAMERA, Glove

FloatArray = NDArray[np.float64]

PIXEL_M = 0.6 / CAMERA.fx


def surface(skin: NDArray[np.bool_], distance_m: float = 0.6) -> BodySurface:
    return BodySurface.from_depth(np.where(skin, distance_m, 0.0), CAMERA, jump_m=0.012)


def plane(distance_m: float = 0.6) -> tuple[FloatArray, FloatArray]:
    """Where every pixel meets the plane."""
    return distance_m * CAMERA.pixel_rays[..., 0], distance_m * CAMERA.pixel_rays[..., 1]


def strip(length_m: float = 0.15, width_m: float = 0.03) -> BodySurface:
    x, y = plane()
    return surface((np.abs(x) < 0.5 * width_m) & (np.abs(y) < 0.5 * length_m))


def fields(skin: BodySurface, anchors_m: list[tuple[float, float, float]]) -> HandFields:
    return measure_fields(HandSurface(skin, (0, 0), 1), np.array(anchors_m))


@given(width_m=st.floats(0.02, 0.036), distance_m=st.floats(0.45, 0.8))
@settings(max_examples=8, deadline=None)
def test_the_rim_of_a_finger_is_half_its_width_from_its_middle(width_m: float, distance_m: float) -> None:
    x, y = plane(distance_m)
    skin = surface((np.abs(x) < 0.5 * width_m) & (np.abs(y) < 0.06), distance_m)
    far_from_ends = np.abs(skin.vertices[:, 1]) < 0.03
    to_side = 0.5 * width_m - np.abs(skin.vertices[far_from_ends, 0])
    pixel_m = distance_m / CAMERA.fx
    np.testing.assert_allclose(rim_distance(skin)[far_from_ends], to_side, atol=1.05 * pixel_m)


def test_the_rim_counts_no_farther_than_two_centimetres() -> None:
    x, y = plane()
    skin = surface(np.hypot(x, y) < 0.06)
    rim = rim_distance(skin)
    away = np.hypot(*skin.vertices[:, :2].T)
    assert (rim[away < 0.035] == 0.02).all()
    assert (rim[away > 0.045] < 0.02).all()
    assert (rim[skin.boundary] == 0.0).all()


def test_a_hole_has_a_rim() -> None:
    x, y = plane()
    skin = surface((np.hypot(x, y) < 0.06) & (np.hypot(x, y) > 0.01))
    nearest = np.hypot(*skin.vertices[:, :2].T).argmin()
    assert rim_distance(skin)[nearest] < 2 * PIXEL_M


def test_a_strip_goes_on_to_its_end() -> None:
    skin = strip()
    found = fields(skin, [(-0.01, 0.07, 0.6), (0.01, 0.07, 0.6), (0.0, 0.06, 0.6)])
    beyond = skin.vertices[:, 1] < 0.04
    left = skin.vertices[beyond, 1] - skin.vertices[:, 1].min()
    np.testing.assert_allclose(found.values_m[-1][beyond], left, atol=0.004)
    assert found.values_m[-1][skin.vertices[:, 1].argmin()] < 0.002


def test_the_end_of_a_finger_is_its_own_and_not_that_of_a_longer_neighbour() -> None:
    glove = Glove()
    found = glove.fields.at(glove.points_m)[:, -1]
    for finger, length in zip(("index", "middle", "ring", "little"), glove.lengths_m[1:], strict=True):
        for part, share in (("tip", 0.88), ("pip", 0.5)):
            left = (1.0 - share) * length
            assert found[POINT_INDEX[f"{finger}_{part}"]] == pytest.approx(left, abs=0.0045), finger
    # the palm goes on to the longest finger
    middle = glove.fields.at(np.array([(0.0, -0.035, 0.6)]))[0, -1]
    assert middle == pytest.approx(0.01 + glove.lengths_m[2], abs=0.008)


def test_skin_that_falls_toward_the_anchors_is_no_way_to_the_end() -> None:
    """Beyond a place is only what is reached by going away from the anchors all the time."""
    x, y = plane()
    limbs = (np.abs(np.abs(x) - 0.04) < 0.008) & (y < 0.0) & (y > -0.08)
    skin = surface((np.abs(x) < 0.05) & (y > -0.005) & (y < 0.03) | limbs & ~((x > 0) & (y < -0.03)))
    found = fields(skin, [(0.0, 0.01, 0.6), (0.0, 0.02, 0.6), (0.01, 0.015, 0.6)])
    short, long = found.at(np.array([(0.04, -0.01, 0.6), (-0.04, -0.01, 0.6)]))[:, -1]
    assert short == pytest.approx(0.02, abs=0.004)
    assert long == pytest.approx(0.07, abs=0.004)


def test_the_end_is_at_most_twenty_centimetres_away() -> None:
    skin = strip(length_m=0.48)
    away = skin.vertices[:, 1].max() - skin.vertices[:, 1]
    end = end_distance(skin, away)
    assert end.max() == 0.2
    assert end.min() == 0.0


def test_distances_from_anchors_are_those_along_the_skin() -> None:
    glove = Glove()
    values = glove.fields.at(glove.points_m)[:, :4]
    straight = np.linalg.norm(glove.points_m[:, None] - glove.anchors_m[None], axis=2)
    assert (values > straight - 0.001).all()
    knuckles = list(KNUCKLES)
    np.testing.assert_allclose(values[knuckles], straight[knuckles], atol=0.001)
    # the way to the index finger's nail goes round the gap beside the finger
    assert values[POINT_INDEX["index_tip"], 1] > straight[POINT_INDEX["index_tip"], 1] + 0.005
    np.testing.assert_allclose(glove.fields.anchors_m, glove.anchors_m, atol=0.001)


def test_a_missing_anchor_leaves_the_others_as_they_were() -> None:
    glove = Glove()
    anchors = glove.anchors_m.copy()
    anchors[1] = np.nan
    found = measure_fields(glove.hand, anchors)
    assert np.isnan(found.values_m[1]).all()
    assert np.isnan(found.anchors_m[1]).all()
    kept = [0, 2, 3, 4]
    np.testing.assert_allclose(found.values_m[kept], glove.fields.values_m[kept], atol=1e-12)
    at = found.at(glove.points_m)
    # the end is looked for away from the anchors there are
    np.testing.assert_allclose(at[:, -1], glove.fields.at(glove.points_m)[:, -1], atol=0.006)
    assert np.isnan(at[:, 1]).all()
    assert np.isfinite(np.delete(at, 1, axis=1)).all()


def test_skin_that_no_anchor_reaches_is_infinitely_far_and_nothing_else() -> None:
    x, y = plane()
    skin = surface((np.abs(x) < 0.03) & (np.abs(y) < 0.05) | (np.abs(x - 0.08) < 0.02) & (np.abs(y) < 0.02))
    found = fields(skin, [(-0.02, 0.0, 0.6), (0.02, 0.0, 0.6), (0.0, 0.03, 0.6)])
    apart = skin.vertices[:, 0] > 0.05
    assert apart.any()
    assert np.isinf(found.values_m[:3, apart]).all()
    assert np.isfinite(found.values_m[:3, ~apart]).all()
    assert np.isfinite(found.values_m[3:]).all()


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_values_between_vertices_are_between_their_values(seed: int) -> None:
    glove = Glove()
    rng = np.random.default_rng(seed)
    corners = glove.hand.surface.triangles[rng.integers(0, len(glove.hand.surface.triangles), 5)]
    weights = rng.dirichlet(np.ones(3), 5)
    places = np.einsum("kc,kcx->kx", weights, glove.hand.surface.vertices[corners])
    wanted = np.einsum("kc,akc->ka", weights, glove.fields.values_m[:, corners])
    np.testing.assert_allclose(glove.fields.at(places), wanted, atol=1e-9)
