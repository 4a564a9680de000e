from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.anchors import apply_calibration, calibrate_skeleton
from core.errors import WorkError

SLIDING = ["left_elbow", "right_elbow", "left_hand", "right_hand", "left_knee", "right_foot"]


def test_bone_lengths_come_from_the_psi_capture(psi_points, make_skeleton) -> None:
    lengths = calibrate_skeleton(make_skeleton(psi_points)).bone_lengths_m
    assert lengths["left_shoulder", "left_elbow"] == pytest.approx(0.29)
    assert len(lengths) == 14


def test_a_limb_seen_on_one_side_lends_its_length_to_the_other(psi_points, make_skeleton) -> None:
    lengths = calibrate_skeleton(make_skeleton(psi_points, hidden=("left_hand",))).bone_lengths_m
    assert lengths["left_elbow", "left_hand"] == lengths["right_elbow", "right_hand"]


def test_sides_that_differ_too_much_are_both_distrusted(psi_points, make_skeleton) -> None:
    points = {**psi_points, "left_hand": psi_points["left_elbow"] + (0.0, -0.6, 0.0)}
    lengths = calibrate_skeleton(make_skeleton(points)).bone_lengths_m
    assert ("left_elbow", "left_hand") not in lengths
    assert ("right_elbow", "right_hand") not in lengths


def test_no_bone_at_all_is_an_error_with_advice(psi_points, make_skeleton) -> None:
    with pytest.raises(WorkError) as caught:
        calibrate_skeleton(make_skeleton({"head": psi_points["head"]}))
    assert "psi" in caught.value.advice


def test_a_fitting_skeleton_stays_as_it_is(psi_points, make_skeleton, kinect_rig) -> None:
    skeleton = make_skeleton(psi_points)
    same = apply_calibration(skeleton, calibrate_skeleton(skeleton), kinect_rig)
    assert same.warnings == ()
    for name in skeleton.joints:
        np.testing.assert_array_equal(same.point(name), skeleton.point(name))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(name=st.sampled_from(["left_hand", "right_hand", "right_foot"]), jump=st.floats(0.35, 1.0))
def test_a_joint_on_the_wall_behind_comes_back(name, jump, psi_points, make_skeleton, kinect_rig) -> None:
    good = make_skeleton(psi_points)
    wrong = psi_points[name] * (1 + jump / psi_points[name][2])
    skeleton = make_skeleton({**psi_points, name: wrong})
    mended = apply_calibration(skeleton, calibrate_skeleton(good), kinect_rig)
    np.testing.assert_allclose(mended.joints[name].pixel, skeleton.joints[name].pixel, atol=1e-6)
    assert np.linalg.norm(mended.point(name) - psi_points[name]) < 0.06
    assert mended.joints[name].visibility < skeleton.joints[name].visibility
    (said,) = mended.warnings
    assert name.replace("_", " ") in said
    assert "nearer to the camera" in said


def test_a_mended_joint_knows_that_its_depth_was_wrong(psi_points, make_skeleton, kinect_rig) -> None:
    good = make_skeleton(psi_points)
    skeleton = make_skeleton({**psi_points, "left_hand": psi_points["left_hand"] * 1.2})
    hand = replace(skeleton.joints["left_hand"], covariance_m2=np.eye(3) * 1e-4)
    mended = apply_calibration(skeleton.with_joint(hand), calibrate_skeleton(good), kinect_rig)
    shift = np.linalg.norm(mended.point("left_hand") - hand.point_m)
    variance = np.linalg.eigvalsh(mended.joints["left_hand"].covariance_m2)
    np.testing.assert_allclose(variance[:2], 1e-4)
    assert variance[2] == pytest.approx(1e-4 + shift**2 / 4)


def test_an_elbow_that_cannot_fit_is_only_said(psi_points, make_skeleton, kinect_rig) -> None:
    far_aside = psi_points["left_elbow"] + (0.5, 0.0, 0.0)
    shifted = psi_points["left_hand"] + (0.5, 0.0, 0.0)
    skeleton = make_skeleton({**psi_points, "left_elbow": far_aside, "left_hand": shifted})
    checked = apply_calibration(skeleton, calibrate_skeleton(make_skeleton(psi_points)), kinect_rig)
    np.testing.assert_array_equal(checked.point("left_elbow"), far_aside)
    assert "check both joints" in checked.warnings[0]


def test_hidden_joints_are_left_alone(psi_points, make_skeleton, kinect_rig) -> None:
    skeleton = make_skeleton(
        {**psi_points, "left_hand": psi_points["left_hand"] * 1.5}, hidden=("left_hand",)
    )
    checked = apply_calibration(skeleton, calibrate_skeleton(make_skeleton(psi_points)), kinect_rig)
    assert checked.warnings == ()
