"""NiTE2 without its runtime: what is missing is said, its structures are read, its process survives.

The tracking itself is not tested: the runtime is proprietary and not here.
"""

from __future__ import annotations

import ctypes
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from core.anchors import JOINT_NAMES, tracked_skeleton
from core.anchors.tracked import TrackedPerson, TrackingState
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.errors import InputError, WorkError
from devices.trackers import DEPTH_TRACKERS, default_tracker, depth_tracker
from devices.trackers.nite2_joints import NITE_JOINTS, SAY, nite_points_m, person_of, wants_start
from devices.trackers.nite2_worker import nite_binding, nite_folders, nominal_camera

CAMERA = PinholeCamera(640, 480, 575.8, 575.8, 319.5, 239.5)
RIG = CameraRig(CAMERA)

PSI_MM = {
    # x right in the picture, y up, z away: somebody who faces the camera has the left hand on the right
    "head": (0, 600, 2500),
    "neck": (0, 400, 2500),
    "torso": (0, 150, 2500),
    "shoulder": (180, 380, 2500),
    "elbow": (450, 380, 2490),
    "hand": (460, 680, 2450),
    "hip": (100, -100, 2500),
    "knee": (110, -500, 2500),
    "foot": (120, -880, 2510),
}


def position_mm(name: str) -> tuple[float, float, float]:
    side, _, part = name.rpartition("_")
    x, y, z = PSI_MM[part]
    return (-x if side == "right" else x), y, z


@pytest.fixture(scope="module")
def c_api():
    return nite_binding("_nite2")


@pytest.fixture
def user(c_api):
    """A NiteUserData as the runtime would fill it, tracked in the psi stance."""
    data = c_api.NiteUserData()
    data.id, data.state = 1, c_api.NiteUserState.NITE_USER_STATE_VISIBLE.value
    data.centerOfMass = c_api.NitePoint3f(0.0, 100.0, 2500.0)
    data.skeleton.state = c_api.NiteSkeletonState.NITE_SKELETON_TRACKED
    for name, number in c_api.NiteJointType._names_.items():
        joint = data.skeleton.joints[number]
        joint.jointType = c_api.NiteJointType(number)
        ours = name.removeprefix("NITE_JOINT_").lower()
        joint.position = c_api.NitePoint3f(*map(float, position_mm(ours)))
        joint.positionConfidence = 0.9
    return data


def test_the_missing_runtime_is_named_with_the_places_that_were_searched(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("NITE2_REDIST64", str(tmp_path / "nowhere"))
    tracker = depth_tracker("nite2")
    try:
        with pytest.raises(WorkError, match="NiTE2 runtime") as failure:
            tracker.start()
        assert "nowhere" in failure.value.message
        assert "NITE2_REDIST64" in failure.value.advice
        assert "MediaPipe" in failure.value.advice
        with pytest.raises(WorkError, match="not started"):
            tracker.read()
    finally:
        tracker.close()
        tracker.close()


def test_the_environment_comes_before_the_usual_places(monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("NITE2_REDIST64", str(tmp_path / "a"))
    monkeypatch.setenv("NITE2_REDIST", str(tmp_path / "b"))
    assert nite_folders()[:2] == [tmp_path / "a", tmp_path / "b"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="makes a library of the name used on Linux")
def test_a_library_that_is_not_nite_is_a_message_and_no_crash(monkeypatch, tmp_path: Path) -> None:
    (tmp_path / "libNiTE2.so").write_bytes(b"\x7fELF" + bytes(200))
    monkeypatch.setenv("NITE2_REDIST64", str(tmp_path))
    tracker = depth_tracker("nite2")
    try:
        with pytest.raises(WorkError):
            tracker.start()
    finally:
        tracker.close()


def test_it_does_not_pretend_to_read_pictures() -> None:
    assert "nite2" in DEPTH_TRACKERS
    with pytest.raises(InputError, match="depth camera"):
        default_tracker("nite2")
    with pytest.raises(InputError, match="kinect"):
        depth_tracker("kinect")


def test_the_binding_loads_although_it_was_written_for_python_2() -> None:
    assert nite_binding("nite2").UserTracker
    assert "_openni2" not in sys.modules


def test_joint_numbers_are_those_of_the_binding(c_api) -> None:
    for name, number in c_api.NiteJointType._names_.items():
        assert NITE_JOINTS[number] == name.removeprefix("NITE_JOINT_").lower()
    assert sorted(NITE_JOINTS) == sorted(JOINT_NAMES)


def test_structures_have_the_layout_of_the_c_interface(c_api) -> None:
    # four-byte fields throughout; NiteUserId is a short, padded to four
    assert ctypes.sizeof(c_api.NiteSkeletonJoint) == 4 * (1 + 3 + 1 + 4 + 1)
    assert ctypes.sizeof(c_api.NiteSkeleton) == 15 * 40 + 2 * 4
    assert c_api.NiteUserData.boundingBox.offset == 4
    assert c_api.NiteUserData.skeleton.offset == 4 + 24 + 12 + 4
    assert ctypes.sizeof(c_api.NiteUserData) == 44 + 608 + 2 * 8


def test_a_tracked_person_has_all_joints_in_metres_with_y_down(user) -> None:
    person = person_of([user], 1_500_000, CAMERA)
    assert person.state is TrackingState.TRACKING
    assert person.say == ""
    assert person.time_s == pytest.approx(1.5)
    assert set(person.points_m) == set(JOINT_NAMES)
    np.testing.assert_allclose(person.points_m["left_hand"], (0.46, -0.68, 2.45), atol=1e-6)
    assert person.confidence["left_hand"] == pytest.approx(0.9)
    assert pickle.loads(pickle.dumps(person)).points_m.keys() == person.points_m.keys()


def test_joints_agree_with_the_calibrated_camera_where_it_differs_from_the_nominal_one() -> None:
    nominal = nominal_camera(320, 240, 1.0145, 0.7898)
    assert nominal is not None
    calibrated = PinholeCamera(640, 480, 590.0, 588.0, 325.0, 242.0)
    pixel = np.array([[250.0, 60.0]])  # of the 640 x 480 image
    seen = nominal.rays((pixel + 0.5) / 2 - 0.5)[0] * 2400.0
    placed = nite_points_m(seen * (1, -1, 1), calibrated, nominal)
    np.testing.assert_allclose(calibrated.project(placed), pixel, atol=1e-9)
    assert placed[0, 2] == pytest.approx(2.4)


def test_nonsense_instead_of_a_field_of_view_is_not_believed() -> None:
    assert nominal_camera(640, 480, 0.0, 1e30) is None


@pytest.mark.parametrize(
    ("state", "word"), [(1, "Hold the psi"), (3, "psi stance"), (4, "forearms"), (6, "back")]
)
def test_calibration_tells_the_patient_what_to_do(state, word, user, c_api) -> None:
    user.skeleton.state = c_api.NiteSkeletonState(state)
    person = person_of([user], 0, CAMERA)
    assert person.state is TrackingState.CALIBRATING
    assert word in person.say
    assert person.say == SAY[state]
    assert person.points_m == {}
    assert wants_start(user) == (state != 1)


def test_nobody_is_asked_to_come(user, c_api) -> None:
    assert person_of([], 0, CAMERA).say == "Stand in front of the camera."
    user.state = c_api.NiteUserState.NITE_USER_STATE_LOST.value
    assert person_of([user], 0, CAMERA).state is TrackingState.NOBODY
    assert not wants_start(user)


def test_a_tracked_person_counts_more_than_a_nearer_passer_by(user, c_api) -> None:
    other = c_api.NiteUserData()
    other.state = 1
    other.centerOfMass = c_api.NitePoint3f(0.0, 0.0, 900.0)
    assert person_of([other, user], 0, CAMERA).state is TrackingState.TRACKING


def test_sides_follow_the_view_and_not_the_mirror(user) -> None:
    person = person_of([user], 0, CAMERA)
    swapped = TrackedPerson(
        person.state,
        points_m={k.replace("left", "#").replace("right", "left").replace("#", "right"): v
                  for k, v in person.points_m.items()},
        confidence=person.confidence,
    )  # fmt: skip
    for seen in (person, swapped):
        front = tracked_skeleton(seen, RIG, view="front", source="nite2")
        back = tracked_skeleton(seen, RIG, view="back", source="nite2")
        assert front.point("left_hand")[0] > front.point("right_hand")[0]
        assert back.point("left_hand")[0] < back.point("right_hand")[0]
    assert tracked_skeleton(person, RIG, view="left", source="nite2").warnings


def test_the_skeleton_of_a_depth_tracker_states_no_error_it_does_not_know(user) -> None:
    skeleton = tracked_skeleton(person_of([user], 0, CAMERA), RIG, view="front", source="nite2")
    assert skeleton.source == "nite2"
    assert all(joint.covariance_m2 is None for joint in skeleton.joints.values())
    assert skeleton.joints["head"].visibility == pytest.approx(0.9)


def test_importing_the_trackers_loads_no_runtime() -> None:
    code = "import sys, devices.trackers; sys.exit('primesense' in sys.modules or 'mediapipe' in sys.modules)"
    root = Path(__file__).resolve().parents[3]
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0
