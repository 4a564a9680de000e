"""Errors, shares and intervals of an evaluation."""

from __future__ import annotations

import math

import pytest

from core.evaluation import BASELINES, LADDER, LesionScore, register_baselines, summarise
from core.relocation import RELOCATION_METHODS, relocation_method


def score(error_mm, body="a", visible=True, radius_mm=20.0):
    error = None if error_mm is None else error_mm / 1000
    status = "not_visible" if error is None else "predicted"
    return LesionScore(body, status, visible, error, None if error is None else radius_mm / 1000)


def test_errors_are_those_of_answered_visible_lesions():
    summary = summarise([score(4), score(8), score(30), score(None), score(500, visible=False)])
    assert (summary.lesions, summary.answered) == (4, 3)
    assert summary.mean_mm == pytest.approx(14.0)
    assert summary.median_mm == pytest.approx(8.0)
    assert summary.within_10mm == pytest.approx(2 / 3)
    assert summary.within_radius == pytest.approx(2 / 3)
    assert summary.beyond_100mm == 0
    assert (summary.hidden, summary.hidden_said) == (1, 0)


def test_a_hidden_lesion_that_gets_no_place_was_recognised():
    summary = summarise([score(5), score(None, visible=False), score(120)])
    assert (summary.hidden, summary.hidden_said) == (1, 1)
    assert summary.beyond_100mm == 1


def test_bodies_are_drawn_not_lesions():
    many = [score(10, "a")] * 500 + [score(20, "b")] * 500
    summary = summarise(many)
    assert (summary.mean_low_mm, summary.mean_high_mm) == (10.0, 20.0)
    alone = summarise([score(10, "a"), score(20, "a")])
    assert (alone.mean_low_mm, alone.mean_high_mm) == (15.0, 15.0)


def test_the_interval_is_repeatable():
    scores = [score(k, body=str(k % 4)) for k in range(1, 40)]
    assert summarise(scores, seed=5) == summarise(scores, seed=5)


def test_without_answers_there_are_no_errors():
    summary = summarise([score(None)])
    assert summary.answered == 0
    assert math.isnan(summary.mean_mm)
    assert math.isnan(summary.mean_low_mm)


def test_the_ladder_begins_with_the_baselines():
    register_baselines()
    try:
        assert LADDER[:2] == tuple(BASELINES)
        assert [relocation_method(name).name for name in LADDER] == list(LADDER)
    finally:
        for name in BASELINES:
            RELOCATION_METHODS.pop(name, None)
