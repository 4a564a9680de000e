"""The psi stance judged while the patient moves, with and without depth."""

from __future__ import annotations

import numpy as np
import pytest

from core.anchors import LivePose, PsiCoach, check_psi, check_psi_live
from core.anchors.live_pose import LiveJoint

STEP_S = 0.1


@pytest.fixture
def pose_of(make_skeleton):
    def make(points: dict[str, np.ndarray], *, depth: bool, time_s: float = 0.0, hidden=()) -> LivePose:
        skeleton = make_skeleton(points, hidden=hidden)
        joints = {
            name: LiveJoint(joint.pixel, joint.visibility, joint.point_m if depth else None)
            for name, joint in skeleton.joints.items()
        }
        return LivePose(joints, time_s, "color", (640, 480))

    return make


def low_elbow(points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    out = dict(points)
    out["left_elbow"] = out["left_shoulder"] + np.array([0.10, 0.27, 0.0])
    out["left_hand"] = out["left_elbow"] + np.array([0.0, -0.3, 0.0])
    return out


@pytest.mark.parametrize("depth", [True, False])
def test_the_psi_stance_needs_no_correction(depth, psi_points, pose_of) -> None:
    assert check_psi_live(pose_of(psi_points, depth=depth)).ok


@pytest.mark.parametrize("depth", [True, False])
def test_the_words_are_those_of_the_capture(depth, psi_points, pose_of, make_skeleton) -> None:
    points = low_elbow(psi_points)
    assert check_psi_live(pose_of(points, depth=depth)) == check_psi(make_skeleton(points))


def test_a_missing_foot_is_told_without_depth_too(psi_points, pose_of) -> None:
    pose = pose_of(psi_points, depth=False, hidden=("left_foot",))
    assert check_psi_live(pose).corrections == ("Step back: the left foot is not in the picture.",)
    assert check_psi_live(pose, whole_body=False).ok


def test_a_patient_who_looks_narrow_is_turned(psi_points, pose_of) -> None:
    a = np.radians(75)
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    axis = psi_points["torso"]
    turned = {name: axis + turn @ (p - axis) for name, p in psi_points.items()}
    assert check_psi_live(pose_of(turned, depth=False)).corrections[0] == "Turn to face the camera."


def test_an_upper_arm_towards_the_camera_looks_short(psi_points, pose_of) -> None:
    points = dict(psi_points)
    points["right_elbow"] = points["right_shoulder"] + np.array([-0.02, 0.0, -0.29])
    points["right_hand"] = points["right_elbow"] + np.array([0.0, -0.3, 0.0])
    said = check_psi_live(pose_of(points, depth=False)).corrections
    assert said == ("Move the right elbow out to the side.",)


def test_a_correction_is_said_after_it_lasted_and_not_for_a_moment(psi_points, pose_of) -> None:
    coach = PsiCoach(settle_s=0.35)
    low = low_elbow(psi_points)
    said = []
    for k in range(30):
        wrong = k in (3, 10, 11) or 15 <= k < 22
        said.append(
            bool(
                coach.update(pose_of(low if wrong else psi_points, depth=True, time_s=k * STEP_S)).corrections
            )
        )
    assert not any(said[:15])
    assert all(said[19:22])
    assert not said[29]


def test_a_correction_is_not_taken_back_for_a_moment(psi_points, pose_of) -> None:
    coach = PsiCoach(settle_s=0.35)
    low = low_elbow(psi_points)
    said = []
    for k in range(15):
        good = k in (8, 11)
        said.append(
            coach.update(pose_of(psi_points if good else low, depth=True, time_s=k * STEP_S)).corrections
        )
    assert all(s == ("Bring the left elbow up to shoulder height.",) for s in said[5:])


def test_it_is_good_only_after_it_was_good_for_a_while(psi_points, pose_of) -> None:
    coach = PsiCoach(settle_s=0.35)
    ok = [coach.update(pose_of(psi_points, depth=True, time_s=k * STEP_S)).ok for k in range(8)]
    assert not ok[0]
    assert ok[-1]
