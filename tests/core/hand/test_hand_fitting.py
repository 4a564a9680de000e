"""The 15 points found together: on gloves whose points are known, and on hands never trained on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.hand.fields import measure_fields
from core.hand.fitting import HandFit, Hint, fit_configuration
from core.hand.hand_model import HandModel
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model import ConfigurationModel, LabelledFrame, learn_configuration
from core.hand.names import FINGER_OF, FINGERS, PAIRS
from core.hand.surface import cut_hand
from tests.core.hand.conftest import Shot
from tests.core.hand.made_up_hands import ON_THE_AXIS, Glove

FloatArray = NDArray[np.float64]

ALIKE = (0.055, 0.062, 0.072, 0.072, 0.062)
"""Lengths of fingers that are the same seen from the left and from the right."""

THUMB, INDEX, LITTLE = (0, 1, 2), (3, 4, 5), (12, 13, 14)


@lru_cache(maxsize=1)
def learned() -> ConfigurationModel:
    """From three gloves of different size."""
    return learn_configuration("flat", [Glove(size).labelled() for size in (0.94, 1.0, 1.06)])


def fitted(glove: Glove, model: ConfigurationModel | None = None, hint: Hint | None = None) -> HandFit:
    fields = glove.fields
    return fit_configuration(
        learned() if model is None else model, fields.surface.vertices, fields.values_m, fields.solver, hint
    )


def off_mm(fit: HandFit, glove: Glove) -> FloatArray:
    return 1000 * np.linalg.norm(fit.points_m - glove.points_m, axis=1)


def found(fit: HandFit) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(fit.points_m).all(axis=1))


def of_finger(*names: str) -> NDArray[np.bool_]:
    return np.isin(FINGER_OF, [FINGERS.index(name) for name in names])


@pytest.mark.parametrize("size", [0.90, 1.0, 1.10])
@pytest.mark.parametrize("distance_m", [0.5, 0.65])
def test_points_of_a_glove_of_another_size_are_found_from_three_frames(
    size: float, distance_m: float
) -> None:
    glove = Glove(size, distance_m=distance_m)
    fit = fitted(glove)
    assert found(fit).all()
    assert np.median(off_mm(fit, glove)) < 2.5
    assert off_mm(fit, glove).max() < 5.0
    larger, _ = learned().expected(fit.b)
    usual, _ = learned().expected(np.zeros(len(fit.b)))
    # the middle fingertip from the marker: the coefficients tell the size
    assert (larger[6, :4] / usual[6, :4]).mean() == pytest.approx(size, abs=0.045)


@pytest.mark.parametrize("missing", [("index",), ("ring", "little"), ("thumb",)])
def test_fingers_that_are_not_there_are_left_out_and_the_others_are_not(missing: Sequence[str]) -> None:
    glove = Glove(1.02, missing=missing)
    fit = fitted(glove)
    beyond_the_knuckle = of_finger(*missing) & (np.arange(15) % 3 < 2)
    np.testing.assert_array_equal(found(fit), ~beyond_the_knuckle)
    assert np.nanmax(off_mm(fit, glove)) < 6.0
    assert (fit.vertices[~found(fit)] == -1).all()
    for values in (fit.cost, fit.anchor_error_m, fit.pair_error_m, fit.spread_m, fit.end_error_m):
        np.testing.assert_array_equal(np.isfinite(values), found(fit))


def test_a_fit_says_how_far_it_strays_from_the_model() -> None:
    glove = Glove(1.0)
    fit = fitted(glove)
    i, j = np.array(PAIRS).T
    apart = np.linalg.norm(fit.points_m[i] - fit.points_m[j], axis=1)
    assert (fit.pair_m > apart - 0.004).all()
    np.testing.assert_allclose(fit.expected_pair_m, learned().expected(fit.b)[1])
    assert np.abs(fit.pair_m - fit.expected_pair_m).mean() < 0.0025
    assert fit.anchor_error_m.max() < 0.004
    assert fit.spread_m.max() < 0.008
    assert fit.unexplained_m < 0.028
    vertices = glove.hand.surface.vertices[fit.vertices]
    assert np.linalg.norm(vertices - fit.points_m, axis=1).max() < 0.008


def test_skin_beyond_the_points_is_said_to_be_unexplained() -> None:
    """A hand learned with the index finger bent away, and one that shows it."""
    bent = [Glove(size, missing=("index",)).labelled() for size in (0.94, 1.0, 1.06)]
    model = learn_configuration("bent", bent)
    without = fitted(Glove(1.0, missing=("index",)), model).unexplained_m
    shown = fitted(Glove(1.0), model).unexplained_m
    assert without < 0.028
    assert shown > without + 0.03


def test_a_missing_anchor_does_no_harm() -> None:
    glove = Glove(1.04)
    anchors = glove.anchors_m.copy()
    anchors[2] = np.nan
    fields = measure_fields(glove.hand, anchors)
    fit = fit_configuration(learned(), fields.surface.vertices, fields.values_m, fields.solver)
    assert found(fit).all()
    assert off_mm(fit, glove).max() < 6.0
    assert np.isfinite(fit.anchor_error_m).all()


@pytest.mark.parametrize(("finger", "other"), [(INDEX, LITTLE), (LITTLE, INDEX)])
def test_of_two_places_that_agree_with_the_anchors_the_other_points_choose(
    finger: tuple[int, ...], other: tuple[int, ...]
) -> None:
    """Anchors in a line do not know left from right; the thumb does."""
    frames = [Glove(size, ALIKE, ON_THE_AXIS).labelled(only=(*THUMB, *finger)) for size in (0.94, 1.0, 1.06)]
    glove = Glove(1.02, ALIKE, ON_THE_AXIS)
    from_anchors = glove.fields.at(glove.points_m)[:, :4]
    np.testing.assert_allclose(from_anchors[list(finger)], from_anchors[list(other)], atol=0.003)
    fit = fitted(glove, learn_configuration("few", frames))
    assert off_mm(fit, glove)[list(finger)].max() < 6.0
    assert not found(fit)[list(other)].any()


def test_points_that_were_hardly_ever_seen_are_not_looked_for() -> None:
    whole, most = Glove(1.0).labelled(), Glove(1.0).labelled(only=range(1, 15))
    frames = [whole] * 2 + [most] * 43
    model = learn_configuration("seldom", frames)
    assert 0.0 < model.seen[0] < 0.05
    assert not found(fitted(Glove(1.0), model))[0]
    assert found(fitted(Glove(1.0), model))[1:].all()


def test_skin_that_hangs_together_with_no_anchor_holds_no_point() -> None:
    """Two parts of a hand, apart: all points are on the part that has the marker."""
    glove = Glove(1.0)
    vertices, values = glove.fields.surface.vertices, glove.fields.values_m.copy()
    apart = glove.hand.surface.vertices[:, 1] < -0.07
    values[:4, apart] = np.inf
    fit = fit_configuration(learned(), vertices, values, glove.fields.solver)
    assert (vertices[fit.vertices[found(fit)], 1] > -0.071).all()
    assert not found(fit)[[3, 6, 9, 12]].any()


def test_what_was_known_before_settles_what_the_surface_leaves_open() -> None:
    """A finger seen by anchors in a line could be either; it is the one it was."""
    only = INDEX
    frames = [Glove(size, ALIKE, ON_THE_AXIS).labelled(only=only) for size in (0.94, 1.0, 1.06)]
    model = learn_configuration("lone", frames)
    glove = Glove(1.0, ALIKE, ON_THE_AXIS)
    for points in (INDEX, LITTLE):
        near = np.full((15, 3), np.nan)
        near[list(only)] = glove.points_m[list(points)]
        fit = fitted(glove, model, Hint(np.zeros(len(model.modes_m)), near))
        off = np.linalg.norm(fit.points_m[list(only)] - glove.points_m[list(points)], axis=1)
        assert off.max() < 0.007, points


def test_a_hint_that_is_wrong_does_not_pull_points_away() -> None:
    """The hand has moved in a way that nobody expected."""
    glove = Glove(1.0)
    wrong = glove.points_m + np.array((0.05, 0.0, 0.0))
    fit = fitted(glove, hint=Hint(fitted(glove).b, wrong))
    assert off_mm(fit, glove).max() < 6.0


@given(size=st.floats(0.93, 1.07), x=st.floats(-0.003, 0.003), y=st.floats(-0.003, 0.003))
@settings(max_examples=5, deadline=None, derandomize=True)
def test_a_marker_that_sits_elsewhere_is_understood(size: float, x: float, y: float) -> None:
    glove = Glove(size, anchors=Glove().plane()[1] + np.array((x, y)))
    fit = fitted(glove)
    assert found(fit).sum() >= 14
    assert np.nanmedian(off_mm(fit, glove)) < 3.0


def measured(shot: Shot, model: HandModel) -> dict[str, HandFit]:
    """Fits of every configuration."""
    anchors = MarkerAnchors(model.marker_m).find(shot.rgb, shot.depth_m, shot.frame.capture.rig)
    hand = cut_hand(shot.depth_m, shot.frame.capture.rig.depth, anchors.places_m)
    fields = measure_fields(hand, anchors.places_m)
    return {
        name: fit_configuration(of, fields.surface.vertices, fields.values_m, fields.solver)
        for name, of in model.configurations.items()
    }


def test_points_of_hands_never_trained_on_are_found_and_hidden_ones_mostly_left_out(
    hand_model: HandModel, shots: Mapping[tuple[str, str], Shot]
) -> None:
    off, told_hidden, hidden = [], 0, 0
    for (name, shape), shot in shots.items():
        fit = measured(shot, hand_model)[name]
        there = found(fit)
        assert there[shot.visible].mean() > 0.8, (name, shape)
        off.append(1000 * np.linalg.norm(fit.points_m - shot.truth_m, axis=1)[shot.visible & there])
        told_hidden += int((there & ~shot.visible).sum())
        hidden += int((~shot.visible).sum())
    every = np.concatenate(off)
    assert np.median(every) < 5.5
    assert np.percentile(every, 90) < 10.0
    assert every.max() < 18.0
    assert hidden > 20
    assert told_hidden < 0.2 * hidden


def test_nothing_learned_is_nothing_found() -> None:
    nothing = LabelledFrame("flat", np.full((15, 6), np.nan), np.full(105, np.nan))
    seen = Glove(1.0).labelled(only=INDEX)
    model = learn_configuration("index", [seen, seen, nothing])
    fit = fitted(Glove(1.0), model)
    np.testing.assert_array_equal(found(fit), np.isin(np.arange(15), INDEX))
