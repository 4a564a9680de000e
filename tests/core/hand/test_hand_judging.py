"""Which configuration a hand is in: by how badly the surface agrees, and by the tree; or none of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.hand.fields import measure_fields
from core.hand.fitting import HandFit, fit_configuration
from core.hand.hand_model import HandModel
from core.hand.judging import LEAST_LIKELIHOOD, MISFIT_SCALE, MOST_MISFIT, judge, misfit
from core.hand.marker_anchors import MarkerAnchors
from core.hand.model import ConfigurationModel, learn_configuration
from core.hand.surface import cut_hand
from core.hand.tree import ConfigurationTree, learn_tree
from tests.core.hand.conftest import Shot
from tests.core.hand.made_up_hands import Glove

SIZES = (0.94, 1.0, 1.06)
BENT = {"all": (), "index": ("index",), "fist": ("index", "middle", "ring", "little")}
"""Fingers that cannot be seen, by configuration."""


@lru_cache(maxsize=1)
def learned() -> dict[str, ConfigurationModel]:
    return {
        name: learn_configuration(name, [Glove(size, missing=missing).labelled(name) for size in SIZES])
        for name, missing in BENT.items()
    }


@lru_cache(maxsize=8)
def fits(shown: str, size: float = 1.02) -> dict[str, HandFit]:
    """Every configuration, fitted to a glove that shows one of them."""
    fields = Glove(size, missing=BENT[shown]).fields
    return {
        name: fit_configuration(model, fields.surface.vertices, fields.values_m, fields.solver)
        for name, model in learned().items()
    }


@lru_cache(maxsize=1)
def tree() -> ConfigurationTree:
    frames = [Glove(size, missing=missing).labelled(name) for name, missing in BENT.items() for size in SIZES]
    return learn_tree(np.array([f.pair_m for f in frames]), [f.configuration for f in frames])


@pytest.mark.parametrize("shown", list(BENT))
@pytest.mark.parametrize("asked", [False, True])
def test_a_glove_is_in_the_configuration_that_it_shows(shown: str, asked: bool) -> None:
    verdict = judge(learned(), tree() if asked else None, fits(shown))
    assert verdict.configuration == verdict.best == shown
    assert verdict.likelihood[shown] > 0.9
    assert verdict.misfit[shown] < 5.0
    assert all(verdict.misfit[name] > verdict.misfit[shown] + 3.0 for name in BENT if name != shown)


def test_a_hand_in_none_of_the_configurations_is_in_none() -> None:
    models = {name: learned()[name] for name in ("all", "index")}
    verdict = judge(models, None, {name: fits("fist")[name] for name in models})
    assert verdict.configuration is None
    assert verdict.best in models
    assert verdict.misfit[verdict.best] > MOST_MISFIT


def test_a_known_configuration_that_is_alone_can_still_be_wrong() -> None:
    fist = {"fist": learned()["fist"]}
    right = judge(fist, None, {"fist": fits("fist")["fist"]})
    wrong = judge(fist, None, {"fist": fits("all")["fist"]})
    assert (right.configuration, right.likelihood) == ("fist", {"fist": 1.0})
    assert (wrong.configuration, wrong.best, wrong.likelihood) == (None, "fist", {"fist": 1.0})


def test_misfit_grows_with_everything_that_disagrees() -> None:
    model, fit = learned()["all"], fits("all")["all"]
    least = misfit(model, fit)
    absent = np.array(fit.cost)
    absent[6] = np.nan
    assert misfit(model, replace(fit, cost=absent)) > least + 1.0
    assert misfit(model, replace(fit, cost=fit.cost + 3.0)) == pytest.approx(least + 3.0)
    assert misfit(model, replace(fit, end_error_m=fit.end_error_m + 0.03)) > least + 5.0
    assert misfit(model, replace(fit, b=fit.b + 3.0)) > least + 3.0
    assert misfit(model, replace(fit, unexplained_m=0.08)) > least + 8.0
    # a few centimetres beyond a point may be the rest of its finger
    assert misfit(model, replace(fit, unexplained_m=0.025)) == misfit(model, replace(fit, unexplained_m=0.0))


def test_a_point_that_is_seldom_seen_may_be_absent() -> None:
    model, fit = learned()["all"], fits("all")["all"]
    absent = np.array(fit.cost)
    absent[6] = np.nan
    without = replace(fit, cost=absent)
    shares = [
        misfit(replace(model, seen=np.where(np.arange(15) == 6, s, 1.0)), without) for s in (0.2, 0.5, 1.0)
    ]
    assert shares[0] < shares[1] < shares[2]
    assert shares[0] == pytest.approx(misfit(model, fit), abs=1.0)


def test_a_fit_without_any_point_to_expect_is_as_bad_as_can_be() -> None:
    model, fit = learned()["fist"], fits("fist")["fist"]
    nothing = replace(fit, cost=np.full(15, np.nan))
    unseen = replace(model, seen=np.zeros(15))
    assert misfit(unseen, nothing) == np.inf
    verdict = judge({"fist": unseen}, None, {"fist": nothing})
    assert verdict.configuration is None
    assert verdict.likelihood == {"fist": 1.0}


def even() -> tuple[dict[str, ConfigurationModel], dict[str, HandFit]]:
    """Two configurations that the surface agrees with alike."""
    model, fit = learned()["all"], fits("all")["all"]
    return {"all": model, "fist": model}, {"all": fit, "fist": fit}


def test_of_two_that_agree_alike_none_is_told_but_by_the_tree() -> None:
    models, both = even()
    alone = judge(models, None, both)
    assert alone.configuration is None
    assert alone.likelihood == {"all": 0.5, "fist": 0.5}
    assert judge(models, tree(), both).configuration == "all"


def test_the_tree_alone_does_not_overrule_a_clear_disagreement() -> None:
    models, both = even()
    both["all"] = replace(both["all"], cost=both["all"].cost + 10 * MISFIT_SCALE)
    verdict = judge(models, tree(), both)
    assert verdict.best == "fist"
    both["all"] = replace(both["all"], cost=both["fist"].cost + 0.5 * MISFIT_SCALE)
    assert judge(models, tree(), both).best == "all"


@given(extra=st.lists(st.floats(0.0, 60.0), min_size=3, max_size=3), order=st.permutations(list(BENT)))
@settings(max_examples=30, deadline=None)
def test_likelihoods_are_shares_and_follow_the_misfits(extra: list[float], order: list[str]) -> None:
    fit = fits("all")["all"]
    model = learned()["all"]
    some = dict(zip(BENT, extra, strict=True))
    asked = {name: replace(fit, cost=fit.cost + some[name] / 3.0) for name in order}
    verdict = judge(dict.fromkeys(BENT, model), None, asked)
    assert sum(verdict.likelihood.values()) == pytest.approx(1.0)
    assert verdict.misfit[verdict.best] == min(verdict.misfit.values())
    in_order = sorted(BENT, key=verdict.misfit.__getitem__)
    shares = [verdict.likelihood[name] for name in in_order]
    assert shares == sorted(shares, reverse=True)
    told = shares[0] >= LEAST_LIKELIHOOD and verdict.misfit[verdict.best] <= MOST_MISFIT
    assert (verdict.configuration is not None) == told
    # a step of misfit makes a configuration e times less likely
    a, b = in_order[0], in_order[1]
    ratio = np.log(verdict.likelihood[a] / verdict.likelihood[b])
    assert ratio == pytest.approx((verdict.misfit[b] - verdict.misfit[a]) / MISFIT_SCALE, abs=1e-6)


def test_hands_never_trained_on_are_in_the_configuration_that_they_show(
    hand_model: HandModel, shots: Mapping[tuple[str, str], Shot]
) -> None:
    finder = MarkerAnchors(hand_model.marker_m)
    for (name, shape), shot in shots.items():
        anchors = finder.find(shot.rgb, shot.depth_m, shot.frame.capture.rig)
        fields = measure_fields(
            cut_hand(shot.depth_m, shot.frame.capture.rig.depth, anchors.places_m), anchors.places_m
        )
        every = {
            other: fit_configuration(model, fields.surface.vertices, fields.values_m, fields.solver)
            for other, model in hand_model.configurations.items()
        }
        verdict = judge(hand_model.configurations, hand_model.tree, every)
        assert verdict.configuration == name, shape
        others = [verdict.misfit[other] for other in every if other != name]
        assert verdict.misfit[name] + 4.0 < min(others), (name, shape)
