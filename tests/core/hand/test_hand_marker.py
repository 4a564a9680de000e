"""A marker in a picture: corners to a fraction of a pixel, numbers also on bent skin, other dictionaries."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from core.errors import InputError
from core.hand.marker import find_markers, one_marker, other_dictionary
from core.hand.marker_edges import refine_corners, trace_outline

FloatArray = NDArray[np.float64]

_FINE = 4


def _sheet(xy: FloatArray, dictionary: str, number: int) -> FloatArray:
    """Brightness of places (n, 2) on a sheet whose black square spans 0 to 1, with a white rim around."""
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = known.markerSize + 2
    picture = cv2.aruco.generateImageMarker(known, number, cells)
    cell = np.floor(xy * cells).astype(int)
    on_sheet = ((xy > -0.17) & (xy < 1.17)).all(axis=1)
    black = ((cell >= 0) & (cell < cells)).all(axis=1)
    out = np.where(on_sheet, 235.0, 150.0)
    out[black] = picture[cell[black, 1], cell[black, 0]] * 0.8 + 25.0
    return out


def _picture(
    corners: FloatArray,
    *,
    bend: float = 0.0,
    dictionary: str = "DICT_4X4_50",
    number: int = 7,
    noise: float = 2.0,
) -> tuple[NDArray[np.uint8], FloatArray]:
    """A marker (its sides bent by so many pixels), 200 x 160, and its true corners."""
    height, width = 160, 200
    u, v = np.meshgrid(
        (np.arange(width * _FINE) + 0.5) / _FINE - 0.5, (np.arange(height * _FINE) + 0.5) / _FINE - 0.5
    )
    unit = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    to_sheet = cv2.getPerspectiveTransform(corners.astype(np.float32), unit)
    grid = np.stack([u.ravel(), v.ravel()], axis=1)
    flat = cv2.perspectiveTransform(grid[None], to_sheet)[0]
    if bend:
        # the sheet's rows sag in the picture like a sheet on a round hand
        sag = bend * 4.0 * flat[:, 0] * (1.0 - flat[:, 0])
        flat = cv2.perspectiveTransform((grid - np.stack([0 * sag, sag], axis=1))[None], to_sheet)[0]
    fine = _sheet(flat, dictionary, number).reshape(height * _FINE, width * _FINE)
    gray = cv2.GaussianBlur(cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    gray = gray + np.random.default_rng(3).normal(0.0, noise, gray.shape)
    return np.repeat(np.clip(gray, 0, 255).astype(np.uint8)[..., None], 3, axis=2), corners


def _square(side: float, turn_deg: float, middle: tuple[float, float] = (98.3, 81.6)) -> FloatArray:
    a = np.deg2rad(turn_deg)
    turned = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return 0.5 * side * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1.0)]) @ turned.T + middle


@given(side=st.floats(26.0, 60.0), turn=st.floats(-180.0, 180.0), squeeze=st.floats(0.85, 1.0))
@settings(max_examples=25, deadline=None)
def test_corners_are_found_to_a_third_of_a_pixel_at_every_turn(
    side: float, turn: float, squeeze: float
) -> None:
    corners = (_square(side, turn) - (98.3, 81.6)) * (1.0, squeeze) + (98.3, 81.6)
    rgb, truth = _picture(corners)
    marker = one_marker(find_markers(rgb))
    assert marker is not None
    assert marker.number == 7
    assert np.linalg.norm(marker.corners_px - truth, axis=1).max() < 0.33


@pytest.mark.parametrize("bend", [2.0, -2.5])
def test_a_marker_on_round_skin_is_read_and_its_corners_kept(bend: float) -> None:
    rgb, truth = _picture(_square(27.0, 12.0), bend=bend)
    marker = one_marker(find_markers(rgb))
    assert marker is not None
    assert marker.number == 7
    assert np.linalg.norm(marker.corners_px - truth, axis=1).max() < 0.5


def test_between_bent_sides_the_patch_follows_them() -> None:
    rgb, truth = _picture(_square(40.0, 0.0), bend=3.0, noise=0.5)
    outline = trace_outline(rgb[..., 0], truth)
    assert outline is not None
    top = outline.places(np.array([0.5]), np.array([0.0]))[0]
    assert top == pytest.approx((truth[0] + truth[1]) / 2 + (0.0, 3.0), abs=0.3)


def test_the_box_of_the_frame_before_is_enough_and_nothing_is_seen_beside_it() -> None:
    rgb, truth = _picture(_square(30.0, 40.0))
    around = np.concatenate([truth.min(axis=0) - 30, truth.max(axis=0) + 30])
    near = one_marker(find_markers(rgb, near_px=around))
    everywhere = one_marker(find_markers(rgb))
    assert near is not None
    assert everywhere is not None
    assert near.corners_px == pytest.approx(everywhere.corners_px, abs=0.05)
    assert find_markers(rgb, near_px=np.array([0.0, 0.0, 60.0, 60.0])) == []
    assert find_markers(rgb, near_px=np.array([-50.0, -50.0, -20.0, -20.0])) == []


def test_two_markers_are_two() -> None:
    one, _ = _picture(_square(28.0, 10.0, (50.0, 80.0)))
    other, _ = _picture(_square(34.0, -20.0, (150.0, 80.0)), number=11)
    both = np.where((np.arange(200) < 100)[None, :, None], one, other)
    assert [marker.number for marker in find_markers(both)] == [11, 7]
    assert one_marker(find_markers(both)) is None


@pytest.mark.parametrize(
    ("dictionary", "number", "named"),
    [
        ("DICT_5X5_50", 3, "DICT_5X5_50"),
        ("DICT_6X6_250", 120, "DICT_6X6_250"),
        ("DICT_4X4_100", 88, "DICT_4X4_100"),
    ],
)
def test_a_marker_of_another_dictionary_is_named(dictionary: str, number: int, named: str) -> None:
    rgb, _ = _picture(_square(50.0, 15.0), dictionary=dictionary, number=number)
    assert find_markers(rgb, "DICT_4X4_50") == []
    assert other_dictionary(rgb, "DICT_4X4_50") == named


def test_no_dictionary_is_named_where_no_marker_is() -> None:
    rgb, truth = _picture(_square(40.0, 5.0))
    assert other_dictionary(rgb, "DICT_4X4_50") is None
    blank = np.full_like(rgb, 140)
    assert other_dictionary(blank, "DICT_4X4_50") is None
    assert refine_corners(blank[..., 0], truth) == pytest.approx(truth)


def test_an_unknown_dictionary_is_refused() -> None:
    with pytest.raises(InputError, match="DICT_9X9"):
        find_markers(np.zeros((40, 40, 3), np.uint8), "DICT_9X9")
