"""What is learned from labelled frames: means, modes of deformation, and the spread they leave."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.errors import InputError
from core.hand.flat import FlatHand, changes_between_frames, changes_between_people
from core.hand.model import LEAST_FRAMES, ConfigurationModel, LabelledFrame, coefficients, learn_configuration
from core.hand.names import PAIRS
from tests.core.hand.made_up_hands import Glove

FloatArray = NDArray[np.float64]

I, J = np.array(PAIRS).T  # noqa: E741
FIELDS = 6
NOISE_M = 0.001
SIZES = (0.93, 1.0, 1.07)


def frame(
    size: float = 1.0, shift_m: tuple[float, float] = (0.0, 0.0), *, seed: int = 0, noise_m: float = NOISE_M
) -> LabelledFrame:
    """Distances of a flat hand whose marker does not grow, with noise."""
    points, anchors = Glove(size).plane()
    flat = FlatHand(points, anchors + np.array(shift_m)).distances()
    rim = np.full((15, 1), 0.008)
    end = size * np.array([(0.008, 0.035, 0.07)] * 5).reshape(15, 1)
    exact = np.hstack([flat[:60].reshape(15, 4), rim, end])
    rng = np.random.default_rng((7, seed))
    return LabelledFrame(
        "flat",
        exact + rng.normal(0.0, noise_m, exact.shape),
        flat[60:] + rng.normal(0.0, noise_m, 105),
    )


@lru_cache(maxsize=1)
def learned() -> ConfigurationModel:
    """From three frames."""
    return learn_configuration("flat", [frame(size, seed=k) for k, size in enumerate(SIZES)])


def without(labelled: LabelledFrame, *points: int) -> LabelledFrame:
    """The frame without some of its points."""
    anchor_m, pair_m = labelled.anchor_m.copy(), labelled.pair_m.copy()
    anchor_m[list(points)] = np.nan
    pair_m[np.isin(I, points) | np.isin(J, points)] = np.nan
    return LabelledFrame(labelled.configuration, anchor_m, pair_m)


def explained(model: ConfigurationModel, seen: LabelledFrame) -> tuple[FloatArray, FloatArray]:
    """Coefficients by what was seen, and all distances that the model expects with them."""
    b = coefficients(seen.vector - model.mean_m, model.modes_m, 1.0 / model.sigma_m**2)
    return b, model.mean_m + b @ model.modes_m


def test_three_frames_are_enough_and_fewer_are_refused() -> None:
    assert learned().frames == LEAST_FRAMES == 3
    with pytest.raises(InputError, match="'flat' has 2 labelled frames"):
        learn_configuration("flat", [frame(seed=1), frame(seed=2)])
    with pytest.raises(InputError, match=r"'flat' has 1 labelled frame\."):
        learn_configuration("flat", [frame()])


def test_a_point_must_be_labelled_in_two_frames() -> None:
    alone = [without(frame(seed=k), *(p for p in range(15) if p != k)) for k in range(3)]
    with pytest.raises(InputError, match="no point that is labelled in two frames"):
        learn_configuration("flat", alone)


def test_the_mean_of_complete_frames_is_their_mean() -> None:
    frames = [frame(size, seed=k) for k, size in enumerate(SIZES)]
    np.testing.assert_allclose(learned().mean_m, np.mean([f.vector for f in frames], axis=0), atol=1e-12)
    expected, pairs = learned().expected(np.zeros(len(learned().modes_m)))
    assert (expected.shape, pairs.shape) == ((15, FIELDS), (105,))
    np.testing.assert_array_equal(np.concatenate([expected.ravel(), pairs]), learned().mean_m)


@pytest.mark.parametrize(
    ("size", "shift_m"),
    [(1.10, (0.0, 0.0)), (0.90, (0.0, 0.0)), (1.0, (0.004, 0.0)), (1.05, (-0.003, 0.004))],
)
def test_modes_reach_hands_and_markers_that_no_frame_showed(
    size: float, shift_m: tuple[float, float]
) -> None:
    """From index and ring finger to the other three; the mean alone is several times as far off."""
    new = frame(size, shift_m, seed=50)
    _, expected = explained(learned(), without(new, *range(3), *range(6, 9), *range(12, 15)))
    exact = frame(size, shift_m, noise_m=0.0).vector
    off, plain = np.abs(expected - exact), np.abs(learned().mean_m - exact)
    assert off.mean() < 0.0012
    assert np.percentile(off, 95) < 0.0035
    from_anchors = np.arange(len(off)) % FIELDS < FIELDS - 2
    from_anchors[15 * FIELDS :] = False
    assert off[from_anchors].mean() < 0.5 * plain[from_anchors].mean()


def test_the_strongest_mode_is_the_size_of_the_hand() -> None:
    strongest = learned().modes_m[0]
    growth = frame(1.08, noise_m=0.0).vector - frame(1.0, noise_m=0.0).vector
    alike = strongest @ growth / np.linalg.norm(strongest) / np.linalg.norm(growth)
    assert abs(alike) > 0.95
    # hands differ by some 8 %: so much is one standard deviation, and not much more
    assert 0.7 < np.linalg.norm(strongest) / np.linalg.norm(growth) < 1.5
    strength = np.linalg.norm(learned().modes_m, axis=1)
    assert (np.diff(strength) <= 1e-12).all()


def test_three_frames_of_one_hand_still_allow_for_another() -> None:
    """What is known of hands beforehand counts: otherwise nothing but this hand would be expected."""
    model = learn_configuration("flat", [frame(1.0, seed=k) for k in range(3)])
    exact = frame(1.08, noise_m=0.0)
    _, expected = explained(model, exact)
    assert np.abs(expected - exact.vector).mean() < 0.0012


def test_many_frames_overrule_what_is_known_of_fingers_but_not_of_people() -> None:
    """Thirty frames of one hand show how it is held, and not how others are."""
    flat = FlatHand(*Glove().plane())
    people = changes_between_people(flat, rigid_anchors=True)
    larger, index_spread = people[0], changes_between_frames(flat, rigid_anchors=True)[2]
    # how the index finger is spread, without what could as well be another hand or marker
    index_spread = index_spread - np.linalg.lstsq(people.T, index_spread)[0] @ people
    few, many = (learn_configuration("flat", [frame(1.0, seed=k) for k in range(n)]) for n in (3, 30))
    assert deviation(many, index_spread) < 0.75 * deviation(few, index_spread)
    assert deviation(many, larger) > 0.9 * deviation(few, larger)


def deviation(model: ConfigurationModel, change: FloatArray) -> float:
    """Standard deviation of the model's distances in the direction of a change (15 a + 105,)."""
    anchor = np.hstack([change[:60].reshape(15, 4), np.zeros((15, 2))])
    direction = np.concatenate([anchor.ravel(), change[60:]])
    direction /= np.linalg.norm(direction)
    return float(np.sqrt(((model.modes_m @ direction) ** 2).sum() + ((model.sigma_m * direction) ** 2).sum()))


def test_what_was_never_seen_is_not_known() -> None:
    model = learn_configuration("flat", [without(frame(seed=k), 4, 5) for k in range(3)])
    unseen = np.isin(np.arange(15), (4, 5))
    mean, pair = model.expected(np.zeros(len(model.modes_m)))
    assert np.isnan(mean[unseen]).all()
    assert np.isfinite(mean[~unseen]).all()
    np.testing.assert_array_equal(np.isnan(pair), np.isin(I, (4, 5)) | np.isin(J, (4, 5)))
    np.testing.assert_array_equal(np.isnan(model.sigma_m), np.isnan(model.mean_m))
    assert not model.modes_m[:, np.isnan(model.mean_m)].any()
    np.testing.assert_array_equal(model.seen, np.where(unseen, 0.0, 1.0))


def test_a_point_labelled_on_large_hands_only_does_not_make_the_mean_hand_large() -> None:
    """Missing distances are filled in from what the frame's other points say of the hand's size."""
    sizes = (0.92, 0.96, 1.0, 1.04, 1.08)
    frames = [frame(size, seed=k) for k, size in enumerate(sizes)]
    gapped = [without(f, 6) if size < 1.03 else f for f, size in zip(frames, sizes, strict=True)]
    model = learn_configuration("flat", gapped)
    exact = frame(1.0, noise_m=0.0).anchor_m[6, :4]
    plain = np.nanmean([f.anchor_m[6, :4] for f in gapped], axis=0)
    assert (plain - exact).mean() > 0.004
    filled = model.expected(np.zeros(len(model.modes_m)))[0][6, :4]
    assert np.abs(filled - exact).mean() < 0.6 * (plain - exact).mean()
    assert model.seen[6] == pytest.approx(0.4)


def test_spread_is_never_less_than_can_be_measured() -> None:
    same = [frame(1.0, noise_m=0.0)] * 20
    model = learn_configuration("flat", same)
    assert model.sigma_m.min() >= 0.001
    assert model.anchor_sigma_m.shape == (15, FIELDS)
    assert model.pair_sigma_m.shape == (105,)


def test_anchors_of_a_palm_may_each_stray() -> None:
    frames = [frame(1.0, seed=k) for k in range(3)]
    strayed = frame(1.0, noise_m=0.0)
    anchor_m = strayed.anchor_m.copy()
    anchor_m[:, 2] += 0.004 * (Glove().plane()[0] @ (0.0, 1.0) < -0.05)
    off = []
    for rigid in (False, True):
        model = learn_configuration("flat", frames, rigid_anchors=rigid)
        _, expected = explained(model, replace(strayed, anchor_m=anchor_m))
        off.append(np.abs(expected[: 15 * FIELDS] - anchor_m.ravel()).mean())
    assert off[0] < 0.85 * off[1]


@given(seed=st.integers(0, 2**32 - 1), gaps=st.floats(0.0, 0.6))
@settings(max_examples=25, deadline=None)
def test_coefficients_are_recovered_from_what_is_known(seed: int, gaps: float) -> None:
    rng = np.random.default_rng(seed)
    modes = rng.normal(0.0, 0.004, (4, 120))
    b = rng.normal(0.0, 1.0, 4)
    difference = b @ modes
    difference[rng.random(120) < gaps] = np.nan
    np.testing.assert_allclose(coefficients(difference, modes, np.full(120, 1e10)), b, atol=1e-3)


def test_coefficients_without_evidence_are_those_of_before_or_usual() -> None:
    modes = np.random.default_rng(1).normal(0.0, 0.004, (3, 50))
    nothing, weight = np.full(50, np.nan), np.full(50, 1e6)
    before = np.array([1.5, -0.5, 0.2])
    np.testing.assert_array_equal(coefficients(nothing, modes, weight), np.zeros(3))
    np.testing.assert_allclose(coefficients(nothing, modes, weight, before, 1e6), before, atol=1e-4)
    np.testing.assert_allclose(coefficients(nothing, modes, weight, before, 1.0), before / 2, atol=1e-9)


def test_what_weighs_nothing_or_is_not_known_does_not_count() -> None:
    rng = np.random.default_rng(2)
    modes, b = rng.normal(0.0, 0.004, (3, 60)), np.array([0.5, 1.0, -1.0])
    difference, weight = b @ modes, np.full(60, 1e10)
    difference[:10], weight[:10] = 5.0, 0.0
    difference[10:20], weight[10:20] = 5.0, np.nan
    np.testing.assert_allclose(coefficients(difference, modes, weight), b, atol=1e-3)
