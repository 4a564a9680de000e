import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.anchors import Joint, PoseLandmarks, Skeleton, project_to_skin
from core.anchors.lifting import interior_m, lift, picture_joints, recorded_skeleton
from core.anchors.names import JOINT_NAMES, LANDMARK_NAMES
from core.anchors.skin_anchors import anchor_sigma_m
from core.surface import BodySurface


@pytest.fixture(scope="module")
def board(kinect_rig) -> BodySurface:
    """A board 1.2 m x 0.9 m at 2 m, and a fist-sized plate 0.5 m in front of its right half."""
    camera = kinect_rig.depth
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    depth = np.where((abs(u - 319.5) < 170) & (abs(v - 239.5) < 130), 2.0, 0.0)
    depth = np.where((abs(u - 430) < 22) & (abs(v - 200) < 22), 1.5, depth)
    return BodySurface.from_depth(depth, camera)


def landmarks_at(places: dict[str, tuple[float, float]], elsewhere=(300.0, 240.0)) -> PoseLandmarks:
    pixels = np.tile(np.array(elsewhere), (33, 1))
    for name, place in places.items():
        pixels[LANDMARK_NAMES.index(name)] = place
    return PoseLandmarks(pixels, np.full(33, 0.9))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=25)
@given(u=st.floats(170, 380), v=st.floats(130, 340))
def test_a_joint_centre_lies_on_its_ray_a_little_under_the_skin(u, v, board, kinect_rig) -> None:
    joint = lift(landmarks_at({"left_shoulder": (u, v)}), "relief", kinect_rig, board).joints["left_shoulder"]
    assert joint.point_m[2] == pytest.approx(2.0 + interior_m("left_shoulder"), abs=1e-3)
    np.testing.assert_allclose(joint.pixel, (u, v), atol=0.05)


def test_beside_the_outline_the_body_is_used_and_trusted_less(board, kinect_rig) -> None:
    found = lift(landmarks_at({"left_hip": (499.0, 240.0)}), "relief", kinect_rig, board).joints["left_hip"]
    assert found.point_m[2] == pytest.approx(2.0 + interior_m("left_hip"), abs=1e-3)
    assert found.visibility == pytest.approx(0.72)
    lost = lift(landmarks_at({"left_hip": (560.0, 240.0)}), "relief", kinect_rig, board).joints["left_hip"]
    assert lost.visibility == 0.0


@pytest.mark.parametrize("place", [(-5.0, 240.0), (300.0, 482.0)])
def test_limbs_outside_the_image_are_inventions(place, kinect_rig) -> None:
    landmarks = landmarks_at({"left_ankle": place, "left_knee": place})
    found = picture_joints(landmarks, kinect_rig.depth)
    assert found["left_foot"][1] == 0.0
    assert found["left_knee"][1] == 0.0
    assert found["right_foot"][1] == pytest.approx(0.9)


def test_an_elbow_behind_a_fist_takes_the_depth_that_makes_an_arm(board, kinect_rig) -> None:
    """At the rim of the plate the patch holds both depths; only the far one gives an upper arm of 0.3 m."""
    rim = (408.0, 200.0)
    arm = {"left_shoulder": (330.0, 200.0), "left_elbow": rim}
    arm |= dict.fromkeys(("left_wrist", "left_pinky", "left_index"), (408.0, 290.0))
    skeleton = lift(landmarks_at(arm), "relief", kinect_rig, board)
    assert skeleton.point("left_elbow")[2] > 1.95


def test_all_joints_and_extra_landmarks_come_out(board, kinect_rig) -> None:
    skeleton = lift(landmarks_at({}), "relief", kinect_rig, board)
    assert tuple(skeleton.joints) == JOINT_NAMES
    assert skeleton.landmarks["nose"].point_m[2] == pytest.approx(2.0, abs=1e-3)


def test_recorded_joints_are_visible_where_they_lie_on_the_body(board, kinect_rig) -> None:
    joints = {
        "head": np.array([0.0, -0.3, 2.08]),
        "left_hand": np.array([0.1, 0.0, 3.5]),
        "right_foot": np.array([0.0, 2.0, 2.0]),
        "tail": np.zeros(3),
    }
    skeleton = recorded_skeleton(joints, kinect_rig, board)
    assert skeleton.visible() == ("head",)
    assert set(skeleton.joints) == {"head", "left_hand", "right_foot"}
    assert skeleton.joints["head"].source == "recording"


def test_anchors_are_the_nearest_points_of_the_skin(board, kinect_rig) -> None:
    places = {"torso": (0.0, 0.1, 2.1), "left_hand": (-0.3, 0.2, 1.9), "right_foot": (0.0, 1.5, 2.0)}
    skeleton = Skeleton(
        {name: Joint(name, np.array(p), np.zeros(2), 0.9, "relief") for name, p in places.items()}
    )
    anchors = project_to_skin(skeleton, board)
    np.testing.assert_allclose(anchors["torso"].position_m, (0.0, 0.1, 2.0), atol=2e-3)
    np.testing.assert_allclose(anchors["left_hand"].position_m, (-0.3, 0.2, 2.0), atol=2e-3)
    assert set(anchors.reliable().as_mapping()) == {"torso", "left_hand"}
    assert set(anchors.as_mapping()) == set(places)


@given(st.sampled_from(JOINT_NAMES), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_an_anchor_seen_less_spreads_more(name: str, one: float, other: float) -> None:
    low, high = sorted((one, other))
    assert anchor_sigma_m(name, low) >= anchor_sigma_m(name, high) >= 0.005


def test_a_recorded_joint_without_a_finite_place_is_left_out(kinect_rig, board):
    joints = {"head": np.array([0.0, 0.0, 2.0]), "neck": np.array([0.0, np.nan, 2.0])}
    assert set(recorded_skeleton(joints, kinect_rig, board).joints) == {"head"}
