"""The daily check tells a rig that was moved from one that was not, and says so when it cannot."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.calibration.daily_check import check_rig
from core.calibration.profile import CalibrationProfile, DepthCorrection
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from devices.simulator.boards import BoardRig, good_poses, random_board_rig
from tests.core.calibration.boards_before import SPEC, views_of

RIG = random_board_rig(5)
PROFILE = CalibrationProfile(RIG.rig, "D", "C", RIG.depth_error)
POSES = good_poses(RIG, SPEC, 5, 5, (0.6, 1.0))


def knocked(turn_deg=(0.0, 0.0, 0.0), shift_mm=(0.0, 0.0, 0.0)) -> BoardRig:
    turn = cv2.Rodrigues(np.deg2rad(np.array(turn_deg, float)))[0]
    motion = RigidTransform(turn, np.array(shift_mm) / 1000)
    return replace(RIG, rig=CameraRig(RIG.rig.depth, RIG.rig.color, motion @ RIG.rig.picture_from_depth))


def check(board_rig: BoardRig = RIG, seed: int = 0, profile: CalibrationProfile = PROFILE):
    return check_rig(profile, SPEC, views_of(board_rig, POSES, seed, noise_px=0.1))


@pytest.mark.parametrize("seed", range(4))
def test_a_rig_that_was_not_touched_is_ok(seed: int) -> None:
    result = check(seed=seed)
    assert result.verdict == "ok", result.message
    assert result.shift_px < 0.5
    assert abs(result.depth_error_mm) < 3


@pytest.mark.parametrize("turn", [(0.35, 0, 0), (0, 0.35, 0), (0, 0, 0.6), (-0.3, 0.3, 0)])
def test_a_camera_that_was_turned_is_noticed(turn) -> None:
    result = check(knocked(turn_deg=turn))
    assert result.verdict == "moved"
    assert "calibrate" in result.message
    assert result.rotation_deg == pytest.approx(np.linalg.norm(turn), rel=0.35)


@pytest.mark.parametrize("shift", [(5, 0, 0), (0, -5, 0), (4, 4, 0)])
def test_a_camera_that_was_shifted_is_noticed(shift) -> None:
    result = check(knocked(shift_mm=shift))
    assert result.verdict == "moved"
    assert result.translation_mm == pytest.approx(np.linalg.norm(shift), rel=0.35)


def test_depth_that_has_drifted_is_noticed() -> None:
    drifted = replace(
        PROFILE, depth_correction=DepthCorrection(RIG.depth_error.scale + 0.03, RIG.depth_error.offset_m)
    )
    result = check(profile=drifted)
    assert result.verdict == "moved"
    assert "warm up" in result.message
    assert result.depth_error_mm > result.depth_limit_mm


def test_two_pictures_are_not_enough_to_tell() -> None:
    assert check_rig(PROFILE, SPEC, views_of(RIG, POSES[:2])).verdict == "cannot tell"
    assert check_rig(PROFILE, SPEC, []).verdict == "cannot tell"


def test_pictures_of_another_size_are_not_compared() -> None:
    other = replace(
        PROFILE,
        rig=CameraRig(replace(RIG.rig.depth, width=320, height=240), RIG.rig.color, RIG.rig.color_from_depth),
    )
    assert check(profile=other).verdict == "cannot tell"


def test_without_depth_the_rest_is_checked_and_that_is_said() -> None:
    views = [replace(v, depth=None) for v in views_of(RIG, POSES)]
    result = check_rig(PROFILE, SPEC, views)
    assert result.verdict == "ok"
    assert "not checked" in result.message


def test_a_wrong_board_size_is_not_taken_for_a_moved_colour_camera() -> None:
    result = check_rig(PROFILE, SPEC.with_square(0.042 * 1.04), views_of(RIG, POSES, noise_px=0.05))
    assert result.verdict == "moved"
    assert "Depth" in result.message or "size" in result.message or "camera" in result.message
