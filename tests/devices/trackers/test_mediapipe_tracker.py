from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from core.anchors import SkeletonTracker
from core.errors import InputError, WorkError
from devices.trackers import TRACKERS, default_tracker, register_tracker
from devices.trackers.mediapipe_pose import MODEL, MediaPipeTracker
from resources import resource_path

ROOT = Path(__file__).resolve().parents[3]
LOOK = (
    "import numpy as np\n"
    "from devices.trackers import default_tracker\n"
    "print(default_tracker().name, default_tracker().detect(np.zeros((200, 200, 3), np.uint8)))\n"
)


def in_a_fresh_interpreter(*command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [*command, sys.executable, "-c", LOOK], capture_output=True, text=True, env=environment, timeout=120
    )


def test_an_empty_picture_shows_nobody() -> None:
    assert default_tracker().detect(np.full((120, 90, 3), 90, np.uint8)) is None


def test_the_default_tracker_is_loaded_once() -> None:
    assert default_tracker() is default_tracker()
    assert default_tracker("mediapipe") is default_tracker()


def test_it_says_nothing_on_the_command_line_and_leaves_cleanly() -> None:
    done = in_a_fresh_interpreter()
    assert done.returncode == 0
    assert done.stdout == "MediaPipe Pose None\n"
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
def test_only_rgb_pictures_are_taken(picture: np.ndarray) -> None:
    with pytest.raises(ValueError, match="RGB"):
        default_tracker().detect(picture)


def test_a_missing_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.task"):
        MediaPipeTracker(tmp_path / "nothing.task")


def test_a_damaged_model_is_an_error_and_not_a_crash(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.task"
    damaged.write_bytes(resource_path("models", MODEL).read_bytes()[:20000])
    with pytest.raises(WorkError, match=r"damaged\.task"):
        MediaPipeTracker(damaged)


def test_a_closed_tracker_says_so_and_may_be_closed_again() -> None:
    tracker = MediaPipeTracker()
    tracker.close()
    tracker.close()
    with pytest.raises(WorkError, match="closed"):
        tracker.detect(np.zeros((64, 64, 3), np.uint8))


def test_several_threads_may_ask_at_once() -> None:
    answers: list[object] = []
    picture = np.random.default_rng(0).integers(0, 255, (160, 160, 3)).astype(np.uint8)
    threads = [
        threading.Thread(target=lambda: answers.append(default_tracker().detect(picture))) for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(answers) == 6


def test_an_unknown_tracker_is_wrong_use() -> None:
    with pytest.raises(InputError, match="nite"):
        default_tracker("nite")


def test_another_tracker_is_one_registration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TRACKERS, "second", TRACKERS["mediapipe"])  # undone after the test
    register_tracker("second", default_tracker)
    tracker: SkeletonTracker = default_tracker("second")
    assert tracker.name == "MediaPipe Pose"


def test_the_shipped_model_is_the_one_described() -> None:
    digest = hashlib.sha256(resource_path("models", MODEL).read_bytes()).hexdigest()
    assert digest in resource_path("models", "README.md").read_text()
    assert "Apache" in resource_path("models", "NOTICE").read_text()
