"""``record``, ``play`` and ``devices`` on cameras of the real OpenNI2 runtime, fed by a driver of our own."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from core.calibration.profile import CalibrationProfile, ProfileStore
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from devices.openni import cameras, runtime
from devices.openni.oni_file import OniWriter
from devices.openni.oni_layout import inspect_oni
from tests.app.cli.cases import assert_told, geoderm
from tests.devices.openni_driver.feed import FeedFolder, make_feed, shared_redist

ROOT = Path(__file__).resolve().parents[3]
SMALL = PinholeCamera(64, 48, 58.0, 58.0, 31.5, 23.5)


@pytest.fixture(scope="module")
def redist() -> Path:
    built = shared_redist()
    if isinstance(built, str):
        pytest.skip(built)
    return built


@pytest.fixture
def kinect(redist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FeedFolder:
    """A connected camera, and a clinic's folder of its own."""
    feed = make_feed(tmp_path / "kinect")
    monkeypatch.setenv("OPENNI2_REDIST64", str(redist))
    monkeypatch.setenv("OPENNI_FEED_FOLDERS", str(feed.folder))
    monkeypatch.setenv("GEODERM_DATA_DIR", str(tmp_path / "clinic"))
    return feed


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Eight small frames, a tenth of a second apart, a quarter of the last one without measurement."""
    path = tmp_path / "small.oni"
    with OniWriter(path, SMALL, color_camera=SMALL) as writer:
        for i in range(8):
            depth = np.full((48, 64), 1500 + i, np.uint16)
            depth[:12] = 0 if i == 7 else depth[:12]
            writer.write(depth, np.zeros((48, 64, 3), np.uint8), 0.1 * i)
    return path


def test_devices_tell_serial_sensor_modes_and_calibration(kinect: FeedFolder, tmp_path: Path) -> None:
    rig = CameraRig(SMALL, SMALL, RigidTransform())
    ProfileStore(tmp_path / "clinic/calibration").add(CalibrationProfile(rig, "A00363A01", "A00363A01"))
    outcome = geoderm("devices", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    told = next(d for d in json.loads(outcome.out) if d["kind"] == "openni")
    assert told["serial"] == "A00363A01"
    assert told["sensor"] == "kinect-v1"
    assert told["calibration"]["version"] == 1
    small = {"kind": "depth", "width": 320, "height": 240, "fps": 30, "pixel_format": "DEPTH_1_MM"}
    assert small in told["modes"]
    (tmp_path / "elsewhere").mkdir()
    table = geoderm("devices", "--modes", "--profiles", tmp_path / "elsewhere").out
    assert "serial number A00363A01, kinect-v1, not calibrated" in table
    assert "640 x 480 at 30/s" in table
    assert "auto_exposure = 1" in table


def test_without_a_runtime_devices_say_where_it_was_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runtime, "runtime_folders", lambda: [tmp_path])
    monkeypatch.setattr(cameras, "find_cameras", runtime.load_runtime)
    outcome = geoderm("devices")
    assert outcome.code == 0
    assert "The OpenNI2 runtime was not found" in outcome.out
    assert str(tmp_path) in outcome.out
    assert "simulator:" in outcome.out


def test_a_camera_is_recorded_and_played(kinect: FeedFolder, tmp_path: Path) -> None:
    out = tmp_path / "a.oni"
    outcome = geoderm("record", f"openni:{kinect.uri}", out, "--frames", 6)
    assert (outcome.code, outcome.err) == (0, "")
    assert "recorded by OpenNI2, ended: done" in outcome.out
    played = geoderm("play", out, "--json")
    assert played.code == 0
    told = json.loads(played.out)
    assert told["frames"] >= 4
    assert told["recording"]["sensor"] == "kinect-v1"
    assert told["each"][0]["depth"]["coverage"] == 1.0
    assert told["each"][0]["color"] == {"width": 640, "height": 480}


def test_ctrl_c_ends_a_recording_cleanly(kinect: FeedFolder, tmp_path: Path) -> None:
    out = tmp_path / "a.oni"
    script = "from app.cli.main import run; run()"
    with subprocess.Popen(
        [sys.executable, "-c", script, "record", f"openni:{kinect.uri}", str(out)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        partial = out.with_name("a.oni.part")
        deadline = time.monotonic() + 20
        while not (partial.exists() and partial.stat().st_size > 3_000_000) and time.monotonic() < deadline:
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does it: to every process
        told, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    assert "ended: stopped" in told
    depth = inspect_oni(out).stream("depth")
    assert depth is not None
    assert depth.frames >= 2


def test_an_unplugged_camera_ends_the_recording_with_a_message(kinect: FeedFolder, tmp_path: Path) -> None:
    import threading

    threading.Timer(3.0, kinect.command, ["unplug"]).start()
    outcome = geoderm("record", f"openni:{kinect.uri}", tmp_path / "folders", "--burst", 5)
    assert_told(outcome, 3, "unplugged", "frames until then are kept")
    assert geoderm("play", tmp_path / "folders").code == 0


def test_a_camera_of_any_kind_is_recorded_frame_by_frame(recording: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.oni"
    outcome = geoderm("record", f"recording:{recording}?live", out, "--frames", 4)
    assert outcome.code == 0, outcome
    assert "recorded by GeoDerm" in outcome.out
    assert json.loads(geoderm("play", out, "--json").out)["frames"] == 4


def test_every_frame_is_shown_with_time_and_coverage(recording: Path) -> None:
    outcome = geoderm("play", recording)
    assert (outcome.code, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert "8 frames" in lines[0]
    assert "depth 100.0 % of 64 x 48  1.500 m  colour 64 x 48" in lines[1]
    assert "depth  75.0 %" in lines[8]
    assert "10.0/s as recorded" in lines[9]


def test_playing_in_real_time_takes_as_long_as_it_was_recorded(recording: Path) -> None:
    told = json.loads(geoderm("play", recording, "--real-time", "--json").out)
    assert 0.7 <= told["played_in_s"] < 4.0
    assert told["seconds"] == pytest.approx(0.7, abs=0.01)


def test_frames_of_a_recording_become_captures(recording: Path, tmp_path: Path) -> None:
    outcome = geoderm("play", recording, "--frames", 3, "--out", tmp_path / "captures")
    assert outcome.code == 0
    assert json.loads(geoderm("play", tmp_path / "captures", "--json").out)["frames"] == 3


@pytest.fixture
def small_disk() -> Iterator[Callable[[int], None]]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_is_one_line_and_what_fitted_is_kept(
    recording: Path, tmp_path: Path, small_disk: Callable[[int], None]
) -> None:
    geoderm("play", recording, "--out", tmp_path / "captures")
    small_disk(50_000)
    outcome = geoderm("record", f"folder:{tmp_path / 'captures'}", tmp_path / "b.oni")
    small_disk(resource.RLIM_INFINITY)
    assert_told(outcome, 3, "the disk is full", "frames are kept")
    assert json.loads(geoderm("play", tmp_path / "b.oni", "--json").out)["frames"] >= 2


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("record", "openni:feed:///nowhere", "OUT/a.oni"), 3, "could not open the device"),
        (("record", "nothing", "OUT/a.oni"), 2, "not a camera"),
        (("record", "recording:OUT/none.oni", "OUT/a.oni"), 2, "no such recording"),
        (("record", "recording:OUT/small.oni", "OUT/small.oni"), 2, "exists already"),
        (("record", "recording:OUT/small.oni", "OUT/no/such/a.oni"), 2, "does not exist"),
        (("record", "recording:OUT/small.oni", "OUT/folder", "--jpeg"), 2, "--jpeg"),
        (("record", "recording:OUT/small.oni", "OUT/a.oni", "--frames", "0"), 2, "--frames"),
        (("play", "OUT/none.oni"), 2, "no such recording"),
        (("play", "OUT"), 2, "holds no capture"),
        (("play", "OUT/small.oni", "--out", "OUT/small.oni"), 2, "exists already"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_wrong_use_is_told_and_writes_nothing(
    recording: Path, tmp_path: Path, arguments: tuple[str, ...], code: int, word: str
) -> None:
    outcome = geoderm(*(a.replace("OUT", str(tmp_path)) for a in arguments))
    assert_told(outcome, code, word)
    assert [p.name for p in tmp_path.iterdir()] == ["small.oni"]
