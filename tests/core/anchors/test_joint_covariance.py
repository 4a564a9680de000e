"""What a joint says about its own error, and what two opinions and a doctor's hand make of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.anchors import (
    JOINT_NAMES,
    JointPlacer,
    PoseLandmarks,
    by_hand,
    find_skeleton,
    fuse_skeletons,
    project_to_skin,
)
from core.anchors.covariance import along_ray, hand_covariance, lifted_covariance
from core.anchors.detection import consensus
from core.capture.rgbd import CameraRig
from core.errors import InputError
from core.surface import BodyScan
from devices.simulator import SimulatedCapture

KNOWN = {"visibility": 1.0, "spread_m": 0.0, "patch_m": 0.003, "ambiguity_m": 0.0, "relief": False}
RAY = np.array([0.3, -0.2, 2.4])


@settings(deadline=None)
@given(
    st.sampled_from(JOINT_NAMES),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.2),
    st.floats(0.0, 0.1),
    st.floats(0.0, 0.5),
)
def test_a_covariance_is_symmetric_and_positive(name, visibility, spread, patch, ambiguity) -> None:
    c = lifted_covariance(
        name, RAY, visibility=visibility, spread_m=spread, patch_m=patch, ambiguity_m=ambiguity, relief=True
    )
    np.testing.assert_allclose(c, c.T)
    assert np.linalg.eigvalsh(c).min() > 0


@pytest.mark.parametrize(
    ("worse", "value"),
    [("visibility", 0.5), ("spread_m", 0.03), ("patch_m", 0.04), ("ambiguity_m", 0.1), ("relief", True)],
)
def test_every_reason_for_doubt_makes_it_larger(worse, value) -> None:
    usual = lifted_covariance("left_hand", RAY, **KNOWN)
    doubtful = lifted_covariance("left_hand", RAY, **{**KNOWN, worse: value})
    assert np.trace(doubtful) > 1.05 * np.trace(usual)


def test_depth_and_picture_err_in_their_own_directions() -> None:
    c = along_ray(np.array([0.0, 0.0, 2.0]), 0.01, 0.05)
    np.testing.assert_allclose(c, np.diag([1e-4, 1e-4, 25e-4]))
    unit = RAY / np.linalg.norm(RAY)
    deep = lifted_covariance("left_hand", RAY, **{**KNOWN, "ambiguity_m": 0.2})
    flat = lifted_covariance("left_hand", RAY, **KNOWN)
    across = np.cross(unit, [0.0, 1.0, 0.0])
    assert unit @ deep @ unit > 2 * (unit @ flat @ unit)
    assert across @ deep @ across == pytest.approx(across @ flat @ across)


def test_looks_that_differ_have_a_spread_and_one_look_has_none() -> None:
    pixels = np.tile(np.linspace(100, 500, 33)[:, None], (1, 2))
    one = PoseLandmarks(pixels, np.full(33, 0.9))
    moved = PoseLandmarks(pixels + np.array([4.0, 0.0]), np.full(33, 0.9))
    both = consensus([one, moved], None)
    np.testing.assert_allclose(both.spread_px, 2.0, atol=1e-6)  # 4 px apart: sigma 2.8 in x, 0 in y
    assert one.spread_px is None


# --- on a rendered person -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def taken(psi: SimulatedCapture) -> SimulatedCapture:
    return psi


@pytest.fixture(scope="module")
def scan(psi_scan: BodyScan) -> BodyScan:
    return psi_scan


@pytest.fixture(scope="module")
def skeleton(scan, tracker):
    return find_skeleton(scan, tracker)


def test_stated_covariances_cover_the_true_errors(skeleton, taken) -> None:
    inside = 0
    for name in skeleton.visible():
        joint = skeleton.joints[name]
        error = joint.point_m - taken.truth.joints_m[name]
        inside += (
            error @ np.linalg.solve(joint.covariance_m2, error) < 11.34
        )  # 99 % of chi squared, 3 degrees
        assert 0.008 < joint.sigma_m < 0.09, name
    assert inside >= len(skeleton.visible()) - 1


def test_hidden_joints_are_filled_from_the_second_opinion(skeleton) -> None:
    blind = skeleton.with_joint(replace(skeleton.joints["left_hand"], visibility=0.1))
    filled = fuse_skeletons(blind, skeleton)
    assert filled.sees("left_hand")
    assert filled.joints["left_hand"].visibility < skeleton.joints["left_hand"].visibility
    assert fuse_skeletons(blind, blind).joints["left_hand"].visibility == pytest.approx(0.1)
    assert fuse_skeletons(skeleton, None) is skeleton


def test_opinions_that_differ_raise_doubt_and_do_not_move_the_joint(skeleton) -> None:
    knee = skeleton.joints["left_knee"]
    far = skeleton.with_joint(replace(knee, point_m=knee.point_m + np.array([0.25, 0.0, 0.0])))
    fused = fuse_skeletons(skeleton, far).joints["left_knee"]
    np.testing.assert_array_equal(fused.point_m, knee.point_m)
    assert fused.sigma_m > 2 * knee.sigma_m


def test_blending_lies_between_the_opinions_and_is_not_surer_than_either_by_much(skeleton) -> None:
    knee = skeleton.joints["left_knee"]
    near = skeleton.with_joint(replace(knee, point_m=knee.point_m + np.array([0.02, 0.0, 0.0])))
    blended = fuse_skeletons(skeleton, near, blend=True).joints["left_knee"]
    assert 0 < blended.point_m[0] - knee.point_m[0] < 0.02
    assert 0.7 * knee.sigma_m < blended.sigma_m <= knee.sigma_m


# --- by hand ------------------------------------------------------------------------------------------------


def test_a_joint_placed_by_hand_projects_to_its_pixel_with_a_small_covariance(skeleton, scan) -> None:
    placer = JointPlacer(scan.capture.rig, scan.surface)
    knee = skeleton.joints["left_knee"]
    placed = placer.place(skeleton, "left_knee", knee.pixel + np.array([5.0, -8.0]))
    joint = placed.joints["left_knee"]
    np.testing.assert_allclose(joint.pixel, knee.pixel + np.array([5.0, -8.0]), atol=1e-6)
    assert joint.source == "hand"
    assert joint.visibility == 1.0
    assert joint.sigma_m < knee.sigma_m
    assert set(by_hand(placed)) == {"left_knee"}
    assert skeleton.joints["left_knee"] is knee


def test_every_true_joint_is_found_again_by_a_hand_that_clicks_it(skeleton, scan, taken) -> None:
    placer = JointPlacer(scan.capture.rig, scan.surface)
    errors = {}
    for name in skeleton.visible():
        truth = taken.truth.joints_m[name]
        pixel = scan.capture.rig.project_to_picture(truth)[0]
        errors[name] = np.linalg.norm(placer.place(skeleton, name, pixel).point(name) - truth)
    assert max(errors.values()) < 0.08, errors
    assert np.mean(list(errors.values())) < 0.03


def test_a_pixel_beside_the_body_is_refused(skeleton, scan) -> None:
    placer = JointPlacer(scan.capture.rig, scan.surface)
    with pytest.raises(InputError, match="left knee must lie on the body"):
        placer.place(skeleton, "left_knee", np.array([3.0, 3.0]))
    with pytest.raises(ValueError, match="no joint"):
        placer.place(skeleton, "left_ear", np.array([3.0, 3.0]))


def test_without_colour_a_joint_is_placed_on_the_depth_image(skeleton, scan) -> None:
    rig = CameraRig(scan.capture.rig.depth)
    pixel = rig.project_to_picture(skeleton.point("left_knee"))[0]
    placed = JointPlacer(rig, scan.surface).place(skeleton, "left_knee", pixel)
    assert np.linalg.norm(placed.point("left_knee") - skeleton.point("left_knee")) < 0.03


def test_the_anchor_of_a_hand_placed_joint_is_surer(skeleton, scan) -> None:
    placer = JointPlacer(scan.capture.rig, scan.surface)
    placed = placer.place(skeleton, "left_hand", skeleton.joints["left_hand"].pixel)
    before, after = (project_to_skin(s, scan.surface)["left_hand"] for s in (skeleton, placed))
    assert after.sigma_m < before.sigma_m
    assert after.sigma_m == pytest.approx(placed.joints["left_hand"].sigma_m)


def test_a_hand_is_surest_across_the_picture() -> None:
    unit = RAY / np.linalg.norm(RAY)
    c = hand_covariance("left_hand", RAY)
    assert np.sqrt(unit @ c @ unit) > np.sqrt(np.linalg.eigvalsh(c).min())
