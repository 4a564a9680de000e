"""The filter of live joints: calm at rest, quick in movement, never beyond what was measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.anchors.one_euro import HOLD_S, OneEuro

STEP_S = 1 / 15
POINT = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


def run(points: list[tuple[float, float]], step_s: float = STEP_S) -> np.ndarray:
    smooth = OneEuro()
    return np.array([smooth.update(np.array([p]), k * step_s)[0] for k, p in enumerate(points)])


@settings(deadline=None)
@given(st.lists(POINT, min_size=1, max_size=40), st.floats(0.005, 0.3))
def test_it_never_leaves_the_range_of_what_was_measured(points, step_s) -> None:
    out = run(points, step_s)
    for k in range(len(points)):
        seen = np.array(points[: k + 1])
        assert (out[k] >= seen.min(0) - 1e-12).all()
        assert (out[k] <= seen.max(0) + 1e-12).all()


@settings(deadline=None)
@given(st.floats(0.02, 1.0))
def test_a_step_is_followed_without_overshoot_and_within_a_quarter_second(height) -> None:
    out = run([(0.0, 0.0)] * 10 + [(height, 0.0)] * 20)[:, 0]
    after = out[10:]
    assert (np.diff(after) >= -1e-12).all()
    assert after.max() <= height + 1e-12
    assert after[round(0.25 / STEP_S)] > 0.9 * height


@settings(deadline=None)
@given(st.floats(0.05, 1.5))
def test_in_steady_movement_the_lag_stays_under_eighty_milliseconds(speed) -> None:
    where = [(speed * k * STEP_S, 0.0) for k in range(60)]
    lag_m = where[-1][0] - run(where)[-1, 0]
    assert lag_m / speed < 0.08


def test_at_rest_it_takes_half_of_the_trembling_away() -> None:
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 0.002, (300, 2))
    out = run([tuple(p) for p in noise])[30:]
    assert np.diff(out, axis=0).std() < 0.5 * np.diff(noise[30:], axis=0).std()


@settings(deadline=None, max_examples=50)
@given(st.lists(st.one_of(st.none(), POINT), min_size=1, max_size=60))
def test_losses_leave_no_trace_that_is_not_finite_once_measured_again(points) -> None:
    smooth = OneEuro()
    for k, p in enumerate(points):
        given_point = np.full((1, 2), np.nan) if p is None else np.array([p])
        out = smooth.update(given_point, k * STEP_S)
        if p is not None:
            assert np.isfinite(out).all()


def test_a_lost_point_is_held_for_half_a_second_and_then_gone() -> None:
    smooth = OneEuro()
    smooth.update(np.array([[0.3, 0.4]]), 0.0)
    lost = np.full((1, 2), np.nan)
    np.testing.assert_allclose(smooth.update(lost, 0.9 * HOLD_S), [[0.3, 0.4]])
    assert np.isnan(smooth.update(lost, 1.1 * HOLD_S)).all()


def test_a_point_that_comes_back_after_a_while_jumps_to_its_place() -> None:
    smooth = OneEuro()
    smooth.update(np.array([[0.0, 0.0]]), 0.0)
    np.testing.assert_allclose(smooth.update(np.array([[0.8, 0.1]]), 2.0), [[0.8, 0.1]])


def test_points_do_not_disturb_each_other() -> None:
    alone, together = OneEuro(), OneEuro()
    rng = np.random.default_rng(2)
    for k in range(20):
        both = rng.uniform(0, 1, (2, 2))
        if k % 3 == 0:
            both[1] = np.nan
        one = alone.update(both[:1], k * STEP_S)
        np.testing.assert_array_equal(together.update(both, k * STEP_S)[0], one[0])


def test_the_number_of_points_may_change_only_after_a_reset() -> None:
    smooth = OneEuro()
    smooth.update(np.zeros((2, 2)), 0.0)
    with pytest.raises(ValueError, match="number of points"):
        smooth.update(np.zeros((3, 2)), 0.1)
    smooth.reset()
    smooth.update(np.zeros((3, 2)), 0.1)
