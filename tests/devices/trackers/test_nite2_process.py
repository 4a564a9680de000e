"""NiTE2's process, loading and calls, against a stand-in library and the real OpenNI2 runtime.

The stand-in has NiTE2's C interface and tracks nobody real: what is proven is everything around the tracking.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from core.anchors import tracked_skeleton
from core.anchors.tracked import TrackedPerson, TrackingState
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.errors import WorkError
from devices.openni.oni_file import write_oni_frames
from devices.openni.runtime import load_runtime
from devices.trackers.nite2 import Nite2Tracker

SOURCE = Path(__file__).parent / "nite_stand_in" / "nite_stand_in.c"
NOMINAL = PinholeCamera(320, 240, 285.6, 285.6, 159.5, 119.5)
CALIBRATED = PinholeCamera(320, 240, 290.0, 289.0, 162.0, 118.0)

needs_compiler = pytest.mark.skipif(
    shutil.which("cc") is None, reason="no C compiler for the stand-in library"
)


@pytest.fixture(scope="module")
def redist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    try:
        load_runtime()
    except WorkError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("NiTE2")
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(folder / "libNiTE2.so"), str(SOURCE)]
    subprocess.run(command, check=True)
    return folder


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "room.oni"
    write_oni_frames(path, np.full((3, 240, 320), 2500, np.uint16), NOMINAL)
    return path


@pytest.fixture
def tracker(redist: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("NITE2_REDIST64", str(redist))
    (redist / "mood").write_text("calm")
    tracker = Nite2Tracker()
    yield tracker
    tracker.close()


def gone(pid: int) -> bool:
    """Whether a process ended and was waited for."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def until_tracked(tracker: Nite2Tracker) -> tuple[list[str], TrackedPerson]:
    said = []
    for _ in range(10):
        person = tracker.read()
        if person.state is TrackingState.TRACKING:
            return said, person
        said.append(person.say)
    raise AssertionError(said)


@needs_compiler
def test_a_person_is_calibrated_in_psi_and_then_tracked(tracker, recording) -> None:
    tracker.start(str(recording))
    said, person = until_tracked(tracker)
    assert said[0] == "Stand in front of the camera." or "psi" in said[0]
    assert any(words.startswith("Take the psi stance") for words in said)
    assert any(words.startswith("Hold the psi stance") for words in said)
    assert len(person.points_m) == 15
    np.testing.assert_allclose(person.points_m["left_hand"][1], -0.68, atol=1e-3)
    assert tracker.read().time_s - person.time_s == pytest.approx(0.033)
    skeleton = tracked_skeleton(person, CameraRig(NOMINAL), view="front", source="nite2")
    assert len(skeleton.visible()) >= 10


@needs_compiler
def test_joints_lie_on_the_rays_of_the_calibrated_camera(redist, tracker, recording) -> None:
    plain, calibrated = tracker, Nite2Tracker(CALIBRATED)
    try:
        people = []
        for one in (plain, calibrated):
            one.start(str(recording))
            people.append(until_tracked(one)[1])
        where = NOMINAL.project(people[0].points_m["left_elbow"])
        np.testing.assert_allclose(CALIBRATED.project(people[1].points_m["left_elbow"]), where, atol=0.6)
        assert people[1].points_m["left_elbow"][2] == pytest.approx(people[0].points_m["left_elbow"][2])
    finally:
        calibrated.close()


@needs_compiler
def test_a_crash_costs_a_message_and_it_can_be_started_again(redist, tracker, recording) -> None:
    (redist / "mood").write_text("crash")
    tracker.start(str(recording))
    pid = tracker.pid
    with pytest.raises(WorkError, match="crashed"):
        until_tracked(tracker)
    assert gone(pid)
    (redist / "mood").write_text("calm")
    tracker.start(str(recording))
    assert until_tracked(tracker)[1].state is TrackingState.TRACKING


@needs_compiler
def test_a_hang_ends_with_a_message_in_time(redist, tracker, recording) -> None:
    (redist / "mood").write_text("hang")
    tracker.start(str(recording))
    pid = tracker.pid
    for _ in range(3):
        tracker.read()
    begun = time.monotonic()
    with pytest.raises(WorkError, match="did not answer"):
        tracker.read(timeout_s=0.5)
    assert time.monotonic() - begun < 10
    assert gone(pid)


@needs_compiler
def test_a_missing_recording_is_a_message(tracker, tmp_path) -> None:
    with pytest.raises(WorkError):
        tracker.start(str(tmp_path / "nothing.oni"))
    assert tracker.pid is None
