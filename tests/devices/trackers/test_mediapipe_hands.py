"""The real hand model on rendered hands: its landmarks, its silence, its end."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError, WorkError
from core.hand.landmarks import LANDMARKS, HandDetector, landmark
from devices.simulator.hands.shots import Holder, shoot
from devices.trackers.mediapipe_hands import MODEL, HandFollower, MediaPipeHands
from resources import resource_path

ROOT = Path(__file__).resolve().parents[3]
LOOK = (
    "import numpy as np\n"
    "from devices.trackers.mediapipe_hands import HandFollower, MediaPipeHands\n"
    "for kind in (MediaPipeHands, HandFollower):\n"
    "    detector = kind()\n"
    "    print(detector.name, detector.detect(np.zeros((200, 200, 3), np.uint8)))\n"
    "    globals()[detector.name] = detector  # forgotten, not closed\n"
)
NOBODY = np.full((240, 320, 3), 110, np.uint8)


@pytest.fixture(scope="module")
def hands():
    detector = MediaPipeHands()
    yield detector
    detector.close()


@pytest.fixture(scope="module")
def frame():
    return shoot(Holder("m_33_short", seed=3), "open", 11)


def in_a_fresh_interpreter(*command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [*command, sys.executable, "-c", LOOK], capture_output=True, text=True, env=environment, timeout=120
    )


@pytest.mark.parametrize("side", ["R", "L"])
def test_landmarks_lie_on_the_fingers_of_the_right_and_the_left_hand(hands, side) -> None:
    frame = shoot(Holder("m_48_stout", side, seed=5), "open", 4)
    found = hands.detect(frame.capture.color)
    assert found.side == side
    assert 0.5 < found.score <= 1
    assert found.pixels.shape == (LANDMARKS, 2)
    assert found.shape_m.shape == (LANDMARKS, 3)
    for finger, name in enumerate(("thumb", "index", "middle", "ring", "little")):
        true = frame.capture.rig.project_to_picture(frame.points_m[f"{name}_tip"])[0]
        assert np.linalg.norm(found.pixels[landmark(finger, 3)] - true) < 20, name


def test_a_picture_without_a_hand_has_none(hands) -> None:
    assert hands.detect(NOBODY) is None


def test_a_follower_gives_the_same_landmarks_in_less_than_the_time(hands, frame) -> None:
    follower = HandFollower()
    try:
        spent = {}
        for detector in (hands, follower):
            for k in range(9):
                if k == 2:
                    begun = time.process_time()
                found = detector.detect(frame.capture.color)
            # computing time, not the clock: other work on the computer does not count
            spent[detector.name] = time.process_time() - begun
            if detector is hands:
                alone = found.pixels
        assert np.median(np.linalg.norm(found.pixels - alone, axis=1)) < 3
        assert spent[follower.name] < 0.75 * spent[hands.name]
    finally:
        follower.close()


def test_a_follower_finds_a_hand_that_has_jumped_in_the_same_picture(frame) -> None:
    follower = HandFollower()
    try:
        picture = frame.capture.color
        assert follower.detect(picture) is not None
        mirrored = np.ascontiguousarray(picture[::-1, ::-1])
        moved = follower.detect(mirrored)
        true = frame.capture.rig.project_to_picture(frame.points_m["middle_tip"])[0]
        expected = np.array([picture.shape[1] - 1, picture.shape[0] - 1]) - true
        assert np.linalg.norm(moved.pixels[landmark(2, 3)] - expected) < 25
        assert follower.detect(NOBODY) is None
        assert follower.detect(picture) is not None
    finally:
        follower.close()


def test_a_new_hand_is_looked_at_twice_and_a_followers_memory_can_be_cleared(frame) -> None:
    follower = HandFollower()
    try:
        picture = frame.capture.color
        first = follower.detect(picture)
        # the landmarks have settled with the first answer
        settled = follower.detect(picture)
        assert np.median(np.linalg.norm(first.pixels - settled.pixels, axis=1)) < 1.5
        follower.forget()
        np.testing.assert_allclose(follower.detect(picture).pixels, first.pixels, atol=1e-3)
    finally:
        follower.close()


def test_it_says_nothing_on_the_command_line_and_leaves_cleanly() -> None:
    done = in_a_fresh_interpreter()
    assert done.returncode == 0
    assert done.stdout == "MediaPipe Hands None\nMediaPipe Hands, following None\n"
    assert done.stderr == ""


@pytest.mark.skipif(
    shutil.which("strace") is None, reason="strace, which watches the network, is not installed"
)
def test_it_never_uses_the_network(tmp_path: Path) -> None:
    watched = tmp_path / "calls"
    done = in_a_fresh_interpreter(
        "strace", "-f", "-e", "trace=connect,sendto,sendmsg,sendmmsg", "-o", str(watched)
    )
    if done.returncode != 0 and "ptrace" in done.stderr:
        pytest.skip("this computer does not allow watching a process")
    assert done.returncode == 0
    calls = watched.read_text().splitlines()
    assert [c for c in calls if "AF_INET" in c or "htons" in c or "nscd" in c] == []


@pytest.mark.parametrize(
    "picture", [np.zeros((9, 9), np.uint8), np.zeros((9, 9, 3)), np.zeros((9, 9, 4), np.uint8)]
)
def test_only_rgb_pictures_are_looked_at(hands, picture: np.ndarray) -> None:
    with pytest.raises(ValueError, match="RGB"):
        hands.detect(picture)


def test_a_missing_or_damaged_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.task"):
        MediaPipeHands(tmp_path / "nothing.task")
    damaged = tmp_path / "damaged.task"
    damaged.write_bytes(resource_path("models", MODEL).read_bytes()[:20000])
    with pytest.raises(WorkError, match=r"damaged\.task"):
        MediaPipeHands(damaged)


@pytest.mark.parametrize("kind", [MediaPipeHands, HandFollower])
def test_a_closed_detector_says_so_and_may_be_closed_again(kind) -> None:
    detector: HandDetector = kind()
    detector.close()
    detector.close()
    with pytest.raises(WorkError, match="closed"):
        detector.detect(NOBODY)


def test_several_threads_may_look_at_once(hands, frame) -> None:
    answers: list[object] = []
    threads = [
        threading.Thread(target=lambda: answers.append(hands.detect(frame.capture.color))) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(answers) == 4
    assert None not in answers


def test_the_shipped_hand_model_is_the_one_described() -> None:
    digest = hashlib.sha256(resource_path("models", MODEL).read_bytes()).hexdigest()
    assert digest in resource_path("models", "README.md").read_text()
    assert MODEL in resource_path("models", "NOTICE").read_text()
