import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.anchors import PoseLandmarks
from core.anchors.detection import consensus, picture_fault
from core.anchors.names import OPPOSITE_LANDMARKS

PERSON = np.random.default_rng(3).uniform(100, 500, (33, 2))
PERSON[11], PERSON[12] = (400.0, 200.0), (200.0, 200.0)


def look(shift: float = 0.0, visibility: float = 0.9) -> PoseLandmarks:
    return PoseLandmarks(PERSON + shift, np.full(33, visibility))


def away(shift: float = 0.0) -> PoseLandmarks:
    return PoseLandmarks((PERSON + shift)[list(OPPOSITE_LANDMARKS)], np.full(33, 0.9))


def test_no_look_is_no_person() -> None:
    assert consensus([]) is None


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-4, 4), min_size=1, max_size=7))
def test_equal_looks_are_averaged_within_their_spread(shifts: list[float]) -> None:
    found = consensus([look(s) for s in shifts])
    assert found is not None
    assert np.all(found.pixels >= PERSON + min(shifts) - 1e-6)
    assert np.all(found.pixels <= PERSON + max(shifts) + 1e-6)
    np.testing.assert_allclose(found.visibility, 0.9)


def test_one_look_that_misses_a_limb_is_outvoted() -> None:
    wrong = PERSON.copy()
    wrong[15] += 200.0
    found = consensus([look(), look(1.0), PoseLandmarks(wrong, np.full(33, 0.9))])
    assert found is not None
    assert np.linalg.norm(found.pixels[15] - PERSON[15]) < 2.0
    assert found.visibility[15] < found.visibility[16]


def test_a_look_that_does_not_see_a_landmark_has_no_say_in_it() -> None:
    blind = PoseLandmarks(PERSON + 150.0, np.where(np.arange(33) == 15, 0.0, 0.9))
    found = consensus([look(), blind])
    assert found is not None
    np.testing.assert_allclose(found.pixels[15], PERSON[15], atol=1e-6)
    assert found.visibility[15] == pytest.approx(0.9)


def test_the_majority_settles_left_and_right_unless_told() -> None:
    majority = consensus([look(), look(1.0), away()])
    assert majority is not None
    assert majority.pixels[11, 0] > majority.pixels[12, 0]
    told = consensus([look(), look(1.0), away()], facing=False)
    assert told is not None
    assert told.pixels[11, 0] < told.pixels[12, 0]
    nobody_agrees = consensus([look(), look(1.0)], facing=False)
    assert nobody_agrees is not None
    assert nobody_agrees.pixels[11, 0] > nobody_agrees.pixels[12, 0]


def test_dark_and_flat_pictures_are_noticed() -> None:
    rng = np.random.default_rng(0)
    at = rng.uniform(0, 99, (500, 2))
    assert picture_fault(rng.integers(60, 220, (100, 100, 3)).astype(np.uint8), at) == ""
    assert picture_fault(rng.integers(0, 25, (100, 100, 3)).astype(np.uint8), at) == "too dark"
    assert picture_fault(np.full((100, 100, 3), 140, np.uint8), at) == "without contrast"
    assert picture_fault(np.full((100, 100, 3), 140, np.uint8), at + 500) == "not aimed at the body"
