from __future__ import annotations

import io
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.exchange.body_map import BodyMapMark, layout_body_map, render_body_map
from core.exchange.label_layout import place_labels, segments_cross, spread
from core.exchange.pictures import ACCENT, body_region, lesion_crop

GAP = 12.0
MARKS = st.integers(1, 60).flatmap(
    lambda n: arrays(float, (n, 2), elements=st.floats(20, 380, allow_nan=False, width=32), unique=True)
)


@settings(deadline=None, max_examples=60)
@given(MARKS)
def test_labels_do_not_overlap_and_lines_of_a_column_do_not_cross(marks: np.ndarray) -> None:
    places = place_labels(marks, left_x=0, right_x=400, top=0, bottom=400, gap=GAP)
    assert sorted(place.index for place in places) == list(range(len(marks)))
    for on_left in (True, False):
        column = [place for place in places if place.on_left == on_left]
        ys = sorted(place.label[1] for place in column)
        assert all(0 <= y <= 400 for y in ys)
        if len(ys) > 1:
            assert np.diff(ys).min() >= min(GAP, 400 / (len(ys) - 1)) - 1e-9
        for a, b in combinations(column, 2):
            assert not segments_cross(a.mark, a.label, b.mark, b.label)


@settings(deadline=None)
@given(st.lists(st.floats(0, 100), min_size=1, max_size=15))
def test_spreading_moves_no_more_than_needed(wanted: list[float]) -> None:
    wanted = sorted(wanted)
    ys = spread(wanted, 5.0, 0.0, 100.0)
    assert ys.min() >= -1e-9
    assert ys.max() <= 100 + 1e-9
    if len(ys) > 1:
        assert np.diff(ys).min() >= 5.0 - 1e-9
        if np.diff(wanted).min() >= 5.0:
            assert np.allclose(ys, wanted)


def test_labels_take_the_nearer_side_while_there_is_room() -> None:
    marks = np.array([(50.0, 100.0), (350.0, 100.0), (60.0, 300.0)])
    places = {p.index: p for p in place_labels(marks, left_x=0, right_x=400, top=0, bottom=400, gap=GAP)}
    assert [places[i].on_left for i in range(3)] == [True, False, True]
    assert all(places[i].label[1] == marks[i, 1] for i in range(3))


def test_the_map_shows_the_body_and_every_number(
    body: Callable[..., RgbdCapture], moles: list[tuple[int, int]]
) -> None:
    capture = body()
    assert capture.color is not None
    marks = [BodyMapMark(i + 1, (2.0 * u, 2.0 * v), settled=i % 2 == 0) for i, (u, v) in enumerate(moles)]
    region = body_region(capture)
    assert region is not None
    assert region[0] > 150
    assert region[2] < 480, "the wall beside the body is cut away"
    data = render_body_map(capture.color, marks, size=(700, 900), region=region)
    image = Image.open(io.BytesIO(data))
    assert image.format == "PNG"
    assert image.width <= 700
    assert image.height <= 900
    pixels = np.asarray(image.convert("RGB")).astype(int)
    assert (np.abs(pixels - ACCENT).max(axis=2) < 12).sum() > 200
    layout = layout_body_map((640, 480), marks, box=(700, 900), label_radius=11, region=region)
    x0, _, x1, _ = layout.photo
    assert all(not x0 <= place.label[0] <= x1 for place in layout.labels), "numbers stand beside the photo"
    assert all(x0 <= place.mark[0] <= x1 for place in layout.labels)


def test_sixty_crowded_lesions_keep_legible_labels() -> None:
    rng = np.random.default_rng(1)
    marks = [BodyMapMark(i, (300 + 5 * x, 200 + 5 * y)) for i, (x, y) in enumerate(rng.normal(size=(60, 2)))]
    layout = layout_body_map((640, 480), marks, box=(505, 431), label_radius=6.7)
    assert layout.label_radius >= 5.0
    for a, b in combinations(layout.labels, 2):
        assert np.hypot(a.label[0] - b.label[0], a.label[1] - b.label[1]) >= 2 * layout.label_radius


def test_a_lesion_outside_the_picture_is_refused(body: Callable[..., RgbdCapture]) -> None:
    picture = body().color
    assert picture is not None
    with pytest.raises(InputError, match="Lesion 7 lies outside"):
        render_body_map(picture, [BodyMapMark(7, (640.0, 10.0))])
    assert render_body_map(picture, [])


def test_the_crop_has_the_lesion_in_its_middle(
    body: Callable[..., RgbdCapture], moles: list[tuple[int, int]]
) -> None:
    picture = body().color
    assert picture is not None
    u, v = 2.0 * moles[0][0], 2.0 * moles[0][1]
    crop = lesion_crop(picture, (u, v), mm_per_pixel=2200 / 576, side=240)
    assert crop.width_mm == pytest.approx(140, rel=0.01)
    pixels = np.asarray(Image.open(io.BytesIO(crop.jpeg))).astype(int)
    assert pixels.shape == (240, 240, 3)
    assert pixels[115:125, 115:125].mean() < 90, "the mole is in the middle, not hidden by the ring"
    corner = lesion_crop(picture, (0.0, 0.0), mm_per_pixel=None)
    assert corner.width_mm is None
