"""The live skeleton: smooth, patient with losses, sides kept; on landmarks that a test writes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from core.anchors import JOINT_NAMES, LANDMARK_NAMES, LivePose, LiveSkeleton, PoseLandmarks
from core.anchors.live import JUMP, SWAP_PATIENCE_S
from core.anchors.names import OPPOSITE_LANDMARKS
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig

STEP_S = 1 / 15
PICTURE = np.zeros((480, 640, 3), np.uint8)
RIG = CameraRig(PinholeCamera(640, 480, 575.8, 575.8, 319.5, 239.5))


def standing() -> np.ndarray:
    """Landmarks of somebody who faces the camera: the left side is on the right of the picture."""
    height = {"ear": 60, "shoulder": 120, "elbow": 190, "wrist": 250, "hip": 260, "knee": 350, "ankle": 440}
    out = np.zeros((33, 2))
    for k, name in enumerate(LANDMARK_NAMES):
        part = name.replace("left", "").replace("right", "").strip("_")
        like = {"pinky": "wrist", "index": "wrist", "thumb": "wrist", "heel": "ankle", "foot_index": "ankle"}
        side = 1 if "left" in name else -1 if "right" in name else 0
        y = height.get(like.get(part, part), 60)
        out[k] = 320 + side * (45 if part in ("hip", "knee", "ankle") else 70), y
    return out


STAND = standing()


class Script:
    """A follower that says what the test wrote; None is nobody."""

    name = "script"

    def __init__(self, looks: Sequence[np.ndarray | None], visibility: np.ndarray | None = None) -> None:
        self._looks = iter(looks)
        self._visibility = np.full(33, 0.95) if visibility is None else visibility
        self.closed = False
        self.shapes: list[tuple[int, ...]] = []

    def follow(self, rgb: np.ndarray, time_s: float) -> PoseLandmarks | None:
        self.shapes.append(rgb.shape)
        look = next(self._looks)
        return None if look is None else PoseLandmarks(look.copy(), self._visibility.copy())

    def close(self) -> None:
        self.closed = True


def play(looks: Sequence[np.ndarray | None], **more: np.ndarray) -> list[LivePose | None]:
    live = LiveSkeleton(Script(looks, **more))
    return [live.update(PICTURE, 10 + k * STEP_S) for k in range(len(looks))]


def exchanged(look: np.ndarray) -> np.ndarray:
    return look[list(OPPOSITE_LANDMARKS)]


def test_all_joints_have_a_pixel_and_no_place_in_space_without_depth() -> None:
    pose = play([STAND])[0]
    assert set(JOINT_NAMES) <= set(pose.joints)
    assert pose.sees(*JOINT_NAMES)
    np.testing.assert_allclose(pose.joints["left_knee"].pixel, (365, 350))
    assert not pose.has_points
    assert pose.age_s == 0.0
    assert ("left_hip", "left_knee") in pose.bones()


def test_nobody_is_none() -> None:
    assert play([None, None]) == [None, None]
    assert LiveSkeleton(Script([])).update(None, 0.0) is None


def test_one_picture_with_exchanged_sides_is_put_right() -> None:
    poses = play([STAND] * 5 + [exchanged(STAND)] + [STAND] * 3)
    for pose in poses:
        assert pose.joints["left_knee"].pixel[0] > pose.joints["right_knee"].pixel[0]


def test_sides_that_stay_exchanged_are_believed_in_the_end() -> None:
    frames = round((SWAP_PATIENCE_S + 0.4) / STEP_S)
    poses = play([STAND] * 5 + [exchanged(STAND)] * frames)
    assert poses[6].joints["left_knee"].pixel[0] > 320
    assert poses[-1].joints["left_knee"].pixel[0] == pytest.approx(275, abs=2)


def test_a_person_who_turns_round_is_followed_and_not_taken_for_an_exchange() -> None:
    looks = []
    for angle in np.linspace(0, np.pi, 40):
        look = STAND.copy()
        look[:, 0] = 320 + (look[:, 0] - 320) * np.cos(angle)
        looks.append(look)
    pose = play(looks)[-1]
    assert pose.joints["left_shoulder"].pixel[0] < 300


def test_a_joint_that_leaps_for_one_picture_stays() -> None:
    wrong = STAND.copy()
    hand = [LANDMARK_NAMES.index(n) for n in ("left_wrist", "left_pinky", "left_index")]
    wrong[hand] -= (640 * JUMP + 30, 0)
    poses = play([STAND] * 4 + [wrong] + [STAND])
    still = poses[3].joints["left_hand"].pixel
    np.testing.assert_allclose(poses[4].joints["left_hand"].pixel, still, atol=1e-6)
    settled = play([STAND] * 4 + [wrong] * 12)[-1]
    assert settled.joints["left_hand"].pixel[0] == pytest.approx(wrong[hand, 0].mean(), abs=5)


def test_a_short_loss_is_bridged_with_falling_trust_and_a_long_one_is_not() -> None:
    poses = play([STAND] * 3 + [None] * 20)
    bridged = poses[4]
    assert bridged.joints["left_knee"].pixel[1] == pytest.approx(350)
    assert bridged.joints["left_knee"].age_s == pytest.approx(2 * STEP_S)
    assert bridged.age_s > 0
    trust = [p.joints["left_knee"].visibility for p in poses[3:10] if p and "left_knee" in p.joints]
    assert trust == sorted(trust, reverse=True)
    assert poses[12].visible() == ()
    assert poses[-1] is None


def test_a_person_who_comes_back_elsewhere_is_there_at_once() -> None:
    shifted = STAND + np.array([120.0, 0.0])
    poses = play([STAND] * 3 + [None] * 20 + [shifted])
    np.testing.assert_allclose(poses[-1].joints["left_knee"].pixel, (485, 350))


def test_a_hidden_joint_is_never_seen() -> None:
    visibility = np.full(33, 0.95)
    visibility[LANDMARK_NAMES.index("left_knee")] = 0.2
    pose = play([STAND] * 3, visibility=visibility)[-1]
    assert not pose.sees("left_knee")
    assert pose.sees("right_knee")


def test_large_pictures_are_reduced_for_the_tracker_and_answered_in_their_own_pixels() -> None:
    follower = Script([STAND])
    pose = LiveSkeleton(follower).update(np.zeros((1920, 2560, 3), np.uint8), 0.0)
    assert follower.shapes == [(480, 640, 3)]
    np.testing.assert_allclose(pose.joints["left_knee"].pixel, (365.5 * 4 - 0.5, 350.5 * 4 - 0.5))
    assert pose.size == (2560, 1920)


def test_with_depth_joints_have_a_place_behind_the_skin() -> None:
    live = LiveSkeleton(Script([STAND] * 10))
    depth = np.full((480, 640), 3.5)
    depth[40:470, 230:410] = 2.3
    depth[0:10] = 0.0
    for k in range(10):
        pose = live.update(PICTURE, k * STEP_S, depth, RIG)
    knee = pose.joints["left_knee"]
    assert knee.point_m[2] == pytest.approx(2.35, abs=0.01)
    np.testing.assert_allclose(RIG.project_to_picture(knee.point_m)[0], knee.pixel, atol=1e-6)


def test_at_the_edge_of_a_limb_the_limb_wins_against_the_wall() -> None:
    live = LiveSkeleton(Script([STAND] * 3))
    depth = np.full((480, 640), 3.5)
    depth[:, 360:410] = 2.3  # the left knee at 365 is next to the edge
    for k in range(3):
        pose = live.update(PICTURE, k * STEP_S, depth, RIG)
    assert pose.joints["left_knee"].point_m[2] < 2.5


def test_where_no_depth_is_there_is_no_place() -> None:
    live = LiveSkeleton(Script([STAND]))
    pose = live.update(PICTURE, 0.0, np.zeros((480, 640)), RIG)
    assert not pose.has_points
    assert pose.sees("left_knee")


def test_closing_releases_the_follower() -> None:
    follower = Script([])
    live = LiveSkeleton(follower)
    assert not live.closed
    live.close()
    assert live.closed
    assert follower.closed
