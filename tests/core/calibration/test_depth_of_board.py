"""Depth of the board is averaged to well under the sensor's steps; the guidance knows what is missing."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibration.bundle import plane_at
from core.calibration.coverage import camera_coverage, tilt_name
from core.calibration.depth_plane import plane_depth
from core.calibration.profile import DepthCorrection
from core.calibration.views import board_pose, is_like, is_moving, tilt_deg
from core.capture.transform import RigidTransform
from devices.simulator.boards import BoardRenderer, good_poses, random_board_rig
from tests.core.calibration.boards_before import SPEC, depth_of, seen_corners, views_of

RIG = random_board_rig(6)
POSES = good_poses(RIG, SPEC, 25, 6)


@pytest.mark.parametrize("number", [0, 6, 11])
def test_averaging_over_the_board_removes_noise_and_steps(number: int) -> None:
    pose, camera = POSES[number], RIG.rig.depth
    plane = plane_depth(depth_of(RIG, pose, np.random.default_rng(number)), 0.001, camera, pose, SPEC)
    assert plane is not None
    true = plane_at(camera, pose, plane.pixel)
    corrected = RIG.depth_error.offset_m + RIG.depth_error.scale * plane.depth_m
    assert corrected == pytest.approx(true, abs=4e-4)


def test_the_wall_behind_and_the_blurred_rim_do_not_count() -> None:
    error = DepthCorrection()
    seen = BoardRenderer(RIG, SPEC, 0)._depth(POSES[0])
    plane = plane_depth(seen, 0.001, RIG.rig.depth, POSES[0], SPEC)
    assert plane is not None
    assert plane.scatter_m < 0.01
    corrected = RIG.depth_error.offset_m + RIG.depth_error.scale * plane.depth_m
    assert corrected == pytest.approx(plane_at(RIG.rig.depth, POSES[0], plane.pixel), abs=0.003)
    assert error.scale == 1.0


@pytest.mark.parametrize("depth", [np.zeros((480, 640), np.uint16), np.full((480, 640), 3000, np.uint16)])
def test_depth_that_is_not_of_the_board_tells_nothing(depth) -> None:
    assert plane_depth(depth, 0.001, RIG.rig.depth, POSES[0], SPEC) is None


def test_the_pose_of_the_board_is_found() -> None:
    view = seen_corners(RIG.rig.depth, POSES[4], np.random.default_rng(0), 0.05)
    pose = board_pose(view, SPEC, RIG.rig.depth)
    assert pose is not None
    assert pose.translation == pytest.approx(POSES[4].translation, abs=0.002)


def test_good_views_cover_both_cameras_and_few_do_not() -> None:
    views = views_of(RIG, POSES, depth=False)
    full = camera_coverage([v.infrared for v in views], SPEC)
    few = camera_coverage([v.infrared for v in views[:3]], SPEC)
    assert full.share > 0.8
    assert few.share < 0.6
    assert few.missing()
    assert camera_coverage([], SPEC).share == 0.0
    assert len(camera_coverage([], SPEC).missing()) >= 10


def test_an_empty_corner_of_the_picture_is_asked_for() -> None:
    views = views_of(RIG, POSES, depth=False)
    seen = [v.infrared.pick((v.infrared.pixels[:, 0] > 170) | (v.infrared.pixels[:, 1] < 310)) for v in views]
    missing = camera_coverage(seen, SPEC).missing()
    assert missing[0] == "Hold the board in the lower left of the picture"


def test_the_side_that_is_nearer_names_the_tilt() -> None:
    import cv2

    for vector, name in (
        ((0, 0.6, 0), "right"),
        ((0, -0.6, 0), "left"),
        ((0.6, 0, 0), "up"),
        ((-0.6, 0, 0), "down"),
        ((0, 0.1, 0), "square"),
    ):
        rotation = cv2.Rodrigues(np.array(vector, float))[0]
        pose = RigidTransform(rotation, np.array([0, 0, 1.0]) - rotation @ SPEC.centre_m)
        z = pose.apply(SPEC.outline_m)[:, 2]
        nearest = {"right": z[[1, 2]], "left": z[[0, 3]], "up": z[[0, 1]], "down": z[[2, 3]]}.get(name)
        assert tilt_name(*tilt_deg(pose)) == name
        assert nearest is None or nearest.mean() < z.mean() - 0.02


def test_the_same_place_twice_is_noticed_and_a_moving_board_too() -> None:
    rng = np.random.default_rng(1)
    a = seen_corners(RIG.rig.depth, POSES[0], rng, 0.05)
    b = seen_corners(RIG.rig.depth, POSES[0], rng, 0.05)
    c = seen_corners(RIG.rig.depth, POSES[1], rng, 0.05)
    assert is_like(a, b, SPEC)
    assert not is_like(a, c, SPEC)
    assert not is_moving(b, a)
    assert is_moving(c, a)
    assert is_moving(a, None)
