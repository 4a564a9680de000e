"""The board is found where it is, to a few hundredths of a pixel, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.calibration.board import BoardSpec, detect_board, follow_board
from core.calibration.views import is_blurred
from core.capture.transform import RigidTransform
from core.errors import InputError
from devices.simulator.boards import BoardRenderer, PictureQuality, random_board_rig

SPEC = BoardSpec.for_paper("A3")


def pose(z: float = 0.8, tilt=(0.3, -0.4, 0.1), x: float = 0.0, y: float = 0.0) -> RigidTransform:
    rotation = cv2.Rodrigues(np.array(tilt, float))[0]
    return RigidTransform(rotation, np.array([x, y, z]) - rotation @ SPEC.centre_m)


@pytest.fixture(scope="module")
def renderer() -> BoardRenderer:
    return BoardRenderer(random_board_rig(3), SPEC)


@pytest.mark.parametrize(
    "tilt", [(0, 0, 0), (0.5, 0.3, 0.2), (-0.4, 0.5, 0.1), (0.1, 0.2, 1.57), (0.1, 0, 3.1)]
)
def test_every_corner_is_found_where_it_is(renderer: BoardRenderer, tilt) -> None:
    at = pose(tilt=tilt)
    seen = renderer.render(at, ("color", "infrared"))
    rig = renderer.board_rig.rig
    for image, camera, place in (
        (seen.infrared, rig.depth, at),
        (seen.rgb, rig.picture_camera, rig.picture_from_depth @ at),
    ):
        view = detect_board(image, SPEC)
        assert view is not None
        true = camera.project(place.apply(SPEC.corners_m))
        off = np.hypot(*(view.pixels - true[view.ids]).T)
        assert len(view) >= camera.contains(true, 14.0).sum()
        assert np.sqrt((off**2).mean()) < 0.03
        assert off.max() < 0.15


def test_a_far_board_is_found_when_looked_for_thoroughly(renderer: BoardRenderer) -> None:
    image = renderer.render(pose(1.5), ("infrared",)).infrared
    view = detect_board(image, SPEC, thorough=True)
    assert view is not None
    true = renderer.board_rig.rig.depth.project(pose(1.5).apply(SPEC.corners_m))
    assert np.hypot(*(view.pixels - true[view.ids]).T).max() < 0.25


def test_16_bit_infrared_is_as_good(renderer: BoardRenderer) -> None:
    image = renderer.render(pose(), ("infrared",)).infrared
    a, b = detect_board(image, SPEC), detect_board(image.astype(np.uint16) * 3 + 40, SPEC)
    assert a is not None
    assert b is not None
    assert a.shift_px(b) < 0.03


def test_hidden_corners_are_left_out_and_the_others_stay_right(renderer: BoardRenderer) -> None:
    image = renderer.render(pose(), ("infrared",)).infrared.copy()
    true = renderer.board_rig.rig.depth.project(pose().apply(SPEC.corners_m))
    middle = true[[11, 12, 19, 20]].mean(axis=0)
    cv2.circle(image, tuple(int(v) for v in middle), 42, 150, -1)
    view = detect_board(image, SPEC)
    assert view is not None
    assert not {11, 12, 19, 20} & set(view.ids.tolist())
    assert len(view) >= 20
    assert np.hypot(*(view.pixels - true[view.ids]).T).max() < 0.2


def test_no_board_is_seen_where_there_is_none(renderer: BoardRenderer) -> None:
    rng = np.random.default_rng(0)
    assert detect_board(rng.integers(0, 255, (480, 640), np.uint8), SPEC) is None
    assert detect_board(np.zeros((480, 640, 3), np.uint8), SPEC) is None
    plain = cv2.resize(np.kron(np.indices((6, 9)).sum(0) % 2, np.ones((40, 40))) * 200.0, (640, 480))
    assert detect_board(plain.astype(np.uint8), SPEC) is None, "a chessboard without markers"


def test_following_finds_what_searching_finds(renderer: BoardRenderer) -> None:
    first = detect_board(renderer.render(pose(), ("infrared",)).infrared, SPEC)
    image = renderer.render(pose(x=0.002), ("infrared",)).infrared
    searched, followed = detect_board(image, SPEC), follow_board(image, SPEC, first)
    assert searched is not None
    assert followed is not None
    assert followed.shift_px(searched) < 0.02
    gone = follow_board(renderer.render(pose(x=0.2), ("infrared",)).infrared, SPEC, first)
    assert gone is not None, "a board that jumped is searched for"


def test_a_blurred_picture_is_told_from_a_sharp_one(renderer: BoardRenderer) -> None:
    sharp = detect_board(renderer.render(pose(), ("infrared",)).infrared, SPEC)
    quality = PictureQuality(blur_px=2.2, noise=0.02, gamma=1.0)
    soft = BoardRenderer(replace(renderer.board_rig, infrared_quality=quality), SPEC)
    blurred = detect_board(soft.render(pose(), ("infrared",)).infrared, SPEC)
    assert sharp is not None
    assert not is_blurred(sharp)
    assert blurred is None or is_blurred(blurred)


def test_a_moving_board_is_smeared(renderer: BoardRenderer) -> None:
    motion = RigidTransform(np.eye(3), np.array([0.010, 0, 0]))
    view = detect_board(renderer.render(pose(), ("infrared",), motion).infrared, SPEC)
    assert view is None or view.rise_px > 2.9


def test_the_print_is_opencvs_own_board() -> None:
    picture = SPEC._board.generateImage((9 * 80, 6 * 80), marginSize=0)
    centres = picture[5::10, 5::10] < 128
    assert np.array_equal(centres, SPEC.modules())


def test_the_measured_size_scales_the_whole_board() -> None:
    larger = SPEC.with_square(0.0425)
    assert np.allclose(larger.corners_m, SPEC.corners_m * 0.0425 / 0.042)
    assert larger.marker_m / larger.square_m == pytest.approx(0.75)
    assert np.array_equal(larger.modules(), SPEC.modules())


@pytest.mark.parametrize(
    "wrong",
    [
        {"squares_x": 1},
        {"square_m": 0.0},
        {"marker_m": 0.05},
        {"dictionary": "DICT_NONE"},
        {"squares_x": 30, "squares_y": 30},
    ],
)
def test_impossible_boards_are_refused(wrong) -> None:
    with pytest.raises(InputError):
        replace(SPEC, **wrong)
