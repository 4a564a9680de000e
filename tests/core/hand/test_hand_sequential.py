"""The thesis's own way: bands, candidates, clusters, and eq. 7 where candidates fall on another finger."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

import core.hand.sequential as room
from core.hand.fields import measure_fields
from core.hand.fitting import HandFit, Hint
from core.hand.hand_model import HandModel
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model import ConfigurationModel, learn_configuration
from core.hand.names import PAIRS
from core.hand.sequential import fit_sequentially
from core.hand.surface import cut_hand
from tests.core.hand.conftest import Shot
from tests.core.hand.made_up_hands import ON_THE_AXIS, Glove

FloatArray = NDArray[np.float64]

ALIKE = (0.055, 0.062, 0.072, 0.072, 0.062)
THUMB, INDEX, LITTLE = (0, 1, 2), (3, 4, 5), (12, 13, 14)
SIZES = (0.98, 1.0, 1.02)


@lru_cache(maxsize=1)
def learned() -> ConfigurationModel:
    return learn_configuration("flat", [Glove(size).labelled() for size in SIZES])


def fitted(glove: Glove, model: ConfigurationModel | None = None, hint: Hint | None = None) -> HandFit:
    fields = glove.fields
    return fit_sequentially(
        learned() if model is None else model, fields.surface.vertices, fields.values_m, fields.solver, hint
    )


def off_mm(fit: HandFit, glove: Glove) -> FloatArray:
    return 1000 * np.linalg.norm(fit.points_m - glove.points_m, axis=1)


def found(fit: HandFit) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(fit.points_m).all(axis=1))


def test_points_of_the_learned_hand_are_found() -> None:
    glove = Glove(1.0, distance_m=0.55)
    fit = fitted(glove)
    assert found(fit).all()
    assert np.median(off_mm(fit, glove)) < 2.5
    assert off_mm(fit, glove).max() < 6.0
    i, j = np.array(PAIRS).T
    apart = np.linalg.norm(fit.points_m[i] - fit.points_m[j], axis=1)
    assert (fit.pair_m > apart - 0.004).all()
    np.testing.assert_allclose(fit.expected_pair_m, learned().mean_m[-105:])


def test_it_knows_no_other_size_than_the_mean() -> None:
    """Unlike the joint fit, which has modes: fingertips of a larger hand are found too near."""
    glove = Glove(1.10)
    fit = fitted(glove)
    tips = [3, 6, 9, 12]
    assert not fit.b.any()
    assert np.nanmedian(off_mm(fit, glove)[tips]) > 5.0


def test_a_thumb_that_is_not_there_is_left_out() -> None:
    glove = Glove(1.0, missing=("thumb",))
    fit = fitted(glove)
    assert not found(fit)[[0, 1]].any()
    assert found(fit)[2:].all()
    assert off_mm(fit, glove)[2:].max() < 9.0
    assert (fit.vertices[:2] == -1).all()


def test_a_finger_between_others_that_is_not_there_disagrees() -> None:
    """Bands put its points on its neighbours; their distances to the other points tell."""
    fit = fitted(Glove(1.0, missing=("ring",)))
    lost = np.isin(np.arange(15), (9, 10))
    error = np.fmax(fit.anchor_error_m, fit.pair_error_m)
    assert np.nanmin(error[lost], initial=1.0) > 2.0 * np.nanmedian(error[~lost])


@pytest.mark.parametrize(("finger", "other"), [(INDEX, LITTLE), (LITTLE, INDEX)])
def test_eq_7_chooses_between_two_fingers(finger: tuple[int, ...], other: tuple[int, ...]) -> None:
    """Both have the same votes of anchors in a line; the distances to the thumb are those of one only."""
    model = _of_one_tip(finger)
    glove = Glove(1.0, ALIKE, ON_THE_AXIS)
    fit = fitted(glove, model)
    assert off_mm(fit, glove)[finger[0]] < 9.0
    assert not found(fit)[other[0]]
    tip = fit.points_m[finger[0]]
    assert np.linalg.norm(tip - glove.points_m[other[0]]) > 0.05


def test_without_eq_7_one_of_them_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "_SWEEPS", 0)
    glove = Glove(1.0, ALIKE, ON_THE_AXIS)
    off = [off_mm(fitted(glove, _of_one_tip(finger)), glove)[finger[0]] for finger in (INDEX, LITTLE)]
    assert max(off) > 50.0


@lru_cache(maxsize=2)
def _of_one_tip(finger: tuple[int, ...]) -> ConfigurationModel:
    """A model of the thumb and one fingertip."""
    only = (*THUMB, finger[0])
    return learn_configuration("few", [Glove(s, ALIKE, ON_THE_AXIS).labelled(only=only) for s in SIZES])


@pytest.mark.parametrize("finger", [INDEX, LITTLE])
def test_of_two_clusters_alike_the_one_where_the_point_was_is_taken(finger: tuple[int, ...]) -> None:
    lone = [Glove(s, ALIKE, ON_THE_AXIS).labelled(only=INDEX[:1]) for s in SIZES]
    model = learn_configuration("lone", lone)
    glove = Glove(1.0, ALIKE, ON_THE_AXIS)
    near = np.full((15, 3), np.nan)
    near[INDEX[0]] = glove.points_m[finger[0]]
    fit = fitted(glove, model, Hint(np.zeros(len(model.modes_m)), near))
    assert np.linalg.norm(fit.points_m[INDEX[0]] - glove.points_m[finger[0]]) < 0.009


def test_a_missing_anchor_does_no_harm() -> None:
    glove = Glove(1.0)
    anchors = glove.anchors_m.copy()
    anchors[0] = np.nan
    fields = measure_fields(glove.hand, anchors)
    fit = fit_sequentially(learned(), fields.surface.vertices, fields.values_m, fields.solver)
    assert found(fit).all()
    assert off_mm(fit, glove).max() < 8.0
    assert np.isfinite(fit.anchor_error_m).all()
    assert np.isfinite(fit.cost).all()


def test_hands_never_trained_on_are_found_less_exactly(
    hand_model: HandModel, shots: Mapping[tuple[str, str], Shot]
) -> None:
    off = []
    for (name, shape), shot in shots.items():
        if name not in ("open", "point"):
            continue
        anchors = MarkerAnchors(hand_model.marker_m).find(shot.rgb, shot.depth_m, shot.frame.capture.rig)
        fields = measure_fields(
            cut_hand(shot.depth_m, shot.frame.capture.rig.depth, anchors.places_m), anchors.places_m
        )
        model = hand_model.configurations[name]
        fit = fit_sequentially(model, fields.surface.vertices, fields.values_m, fields.solver)
        there = shot.visible & found(fit)
        assert there.sum() > 0.5 * shot.visible.sum(), (name, shape)
        off.append(np.linalg.norm(fit.points_m - shot.truth_m, axis=1)[there])
    assert np.median(np.concatenate(off)) < 0.010
    assert np.percentile(np.concatenate(off), 75) < 0.016
