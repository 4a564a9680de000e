"""Live cameras on the real OpenNI2 runtime, fed by a driver of our own."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from core.calibration.profile import CalibrationProfile, DepthCorrection
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from devices.live import LiveCamera, LiveState, StreamMode
from devices.openni.calibration import NOMINAL_WARNING
from devices.openni.cameras import CONNECTED_CAMERAS, OpenNICamera
from devices.registry import list_devices
from tests.devices.openni_driver.feed import FeedFolder, wait_until

Feeds = Callable[..., FeedFolder]
VGA = PinholeCamera(640, 480, 580.0, 581.0, 318.0, 242.0)
VGA_COLOR = PinholeCamera(640, 480, 525.0, 525.0, 320.0, 240.0)
RIG = CameraRig(VGA, VGA_COLOR, RigidTransform(np.eye(3), np.array([-0.025, 0.0, 0.0])))


def gone_process(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def failure_of(camera: OpenNICamera, seconds: float = 12.0) -> WorkError:
    """The message with which the camera ends."""
    deadline, number = time.monotonic() + seconds, 0
    while time.monotonic() < deadline:
        try:
            frame = camera.latest(number, 0.2)
        except WorkError as error:
            return error
        number = number if frame is None else frame.number
    raise AssertionError("the camera goes on")


def shared_blocks() -> set[str]:
    folder = Path("/dev/shm")
    return {p.name for p in folder.glob("geoderm-*")} if folder.is_dir() else set()


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    before = shared_blocks()
    yield
    assert shared_blocks() <= before


def test_depth_and_colour_stream_as_the_camera_sees_them_not_mirrored(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        assert isinstance(camera, LiveCamera)
        first = camera.latest(0, 5.0)
        assert first is not None
        second = camera.latest(first.number, 5.0)
    assert second is not None
    assert second.number > first.number
    assert first.depth is not None
    assert first.rgb is not None
    assert any(np.array_equal(first.depth, made) for made in feed.depth)
    np.testing.assert_array_equal(first.rgb, feed.color[0])
    assert abs(first.color_time_s - first.time_s) < 0.5 / 30


def test_thirty_frames_a_second_come_through_with_times_on_this_computers_clock(feeds: Feeds) -> None:
    feed = feeds(stamp=1)  # the driver writes the clock into the picture when it makes it
    numbers, delays, errors = [], [], []
    with OpenNICamera(feed.uri) as camera:
        assert camera.latest(0, 5.0) is not None
        after, end = 0, time.monotonic() + 2.0
        while time.monotonic() < end:
            frame = camera.latest(after, 0.5)
            if frame is None or frame.depth is None:
                continue
            after = frame.number
            made = int(frame.depth.ravel()[:4].copy().view(np.uint64)[0]) * 1e-9
            numbers.append(frame.number)
            delays.append(time.monotonic() - made)
            errors.append(frame.time_s - made)
    assert numbers[-1] - numbers[0] > 40  # 60 on a free machine
    assert np.median(delays) < 0.060
    assert abs(float(np.median(errors))) < 0.030


def test_the_identity_is_the_serial_number_and_the_sensor(feeds: Feeds) -> None:
    with OpenNICamera(feeds("kinect").uri) as camera:
        identity = camera.identity
    assert (identity.depth_serial, identity.color_serial) == ("A00363A01", "A00363A01")
    assert identity.lasting
    assert identity.sensor == "kinect-v1"
    assert "Kinect" in identity.model


def test_without_a_serial_number_the_address_is_the_identity_and_does_not_last(feeds: Feeds) -> None:
    feed = feeds(serial="", vid="0x1d27", pid="0x0601", color=False)
    with OpenNICamera(feed.uri) as camera:
        identity = camera.identity
    assert identity.depth_serial == feed.uri
    assert identity.color_serial == ""
    assert not identity.lasting


def test_connected_cameras_are_listed_and_two_run_at_once(feeds: Feeds) -> None:
    feeds("one", serial="1")
    feeds("two", serial="2")
    found = [info for info in list_devices("openni") if "feed://" in info.id]
    assert len(found) == 2
    cameras = [CONNECTED_CAMERAS.create(info.id.removeprefix("openni:")) for info in found]
    try:
        for camera in cameras:
            camera.open()
        frames = [camera.latest(0, 5.0) for camera in cameras]
        assert all(frame is not None for frame in frames)
        assert {camera.identity.depth_serial for camera in cameras} == {"1", "2"}
        assert cameras[0].runtime_pid != cameras[1].runtime_pid
    finally:
        for camera in cameras:
            camera.close()


def test_a_burst_becomes_a_capture_and_the_viewfinder_goes_on(feeds: Feeds) -> None:
    with OpenNICamera(feeds().uri) as camera:
        capture = camera.capture(frames=5)
        preview = camera.preview()
    assert capture.depth_frames.shape == (5, 480, 640)
    assert capture.sensor == "kinect-v1"
    assert NOMINAL_WARNING in capture.warnings
    assert not capture.mirrored
    assert preview is not None
    assert preview.rgb is not None


def test_a_profile_gives_the_geometry_and_its_depth_correction_and_stays_with_the_capture(
    feeds: Feeds,
) -> None:
    feed = feeds()
    profile = CalibrationProfile(RIG, "A00363A01", "A00363A01", DepthCorrection(1.01, 0.004), version=3)
    with OpenNICamera(feed.uri) as camera:
        camera.use_profile(profile)
        capture = camera.capture(frames=2)
    assert capture.rig.depth == VGA
    assert capture.warnings == ()
    assert capture.calibration is not None
    assert capture.calibration["version"] == 3
    corrected = profile.depth_correction.apply(feed.depth, 0.001)
    assert any(np.array_equal(capture.depth_frames[0], made) for made in corrected)


def test_a_profile_of_another_camera_or_another_size_is_refused(feeds: Feeds) -> None:
    small = CameraRig(PinholeCamera(320, 240, 290.0, 290.0, 160.0, 120.0))
    with OpenNICamera(feeds().uri) as camera:
        with pytest.raises(InputError, match="B2"):
            camera.use_profile(CalibrationProfile(RIG, "B2", "B2"))
        with pytest.raises(InputError, match="320 x 240"):
            camera.use_profile(CalibrationProfile(small, "A00363A01", "A00363A01"))
        assert camera.profile is None


def test_a_mode_can_be_chosen_and_a_profile_that_no_longer_fits_is_dropped(feeds: Feeds) -> None:
    with OpenNICamera(feeds().uri) as camera:
        camera.use_profile(CalibrationProfile(RIG, "A00363A01", "A00363A01"))
        last = camera.latest(0, 5.0)
        assert last is not None
        camera.choose_mode(StreamMode("depth", 640, 480, 30, "DEPTH_100_UM"))
        fine = camera.latest(last.number, 5.0)
        assert fine is not None
        assert fine.depth is not None
        assert fine.depth_unit_m == pytest.approx(0.0001)
        assert fine.number > last.number
        assert camera.profile is not None
        camera.choose_mode(StreamMode("color", 1280, 960, 15, "RGB888"))
        large = camera.capture(frames=2)
        assert large.color is not None
        assert large.color.shape == (960, 1280, 3)
        assert camera.profile is None
        with pytest.raises(InputError, match="no mode"):
            camera.choose_mode(StreamMode("depth", 123, 45, 30, "DEPTH_1_MM"))


def test_infrared_is_for_calibration_and_not_together_with_colour_on_a_kinect(feeds: Feeds) -> None:
    feed = feeds(ir_excludes_color=1)
    with OpenNICamera(feed.uri) as camera:
        with pytest.raises(WorkError, match="infrared and colour at the same time"):
            camera.start(("infrared", "color"))
        running = camera.latest(0, 5.0)  # what ran before runs on
        assert running is not None
        assert running.rgb is not None
        camera.start(("infrared",))
        frame = camera.latest(running.number, 5.0)
        assert frame is not None
        assert frame.infrared is not None
        np.testing.assert_array_equal(frame.infrared, feed.infrared[0])
        assert frame.depth is None
        assert camera.rig.depth.width == 640
        camera.start(("depth", "infrared"))
        both = camera.latest(frame.number, 5.0)
    assert both is not None
    assert both.depth is not None
    assert both.infrared is not None


def test_a_camera_without_infrared_says_so(feeds: Feeds) -> None:
    with (
        OpenNICamera(feeds(infrared=False).uri) as camera,
        pytest.raises(WorkError, match="no infrared stream"),
    ):
        camera.start(("infrared",))


def test_controls_reach_the_camera_and_wrong_ones_are_named(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        names = {c.name for c in camera.controls()}
        assert names == {"auto_white_balance", "auto_exposure", "exposure", "gain", "device_registration"}
        camera.set_control("auto_exposure", 0)
        camera.set_control("gain", 50)
        number = getattr(camera.latest(0, 5.0), "number", 0)
        dark = camera.latest(number + 2, 5.0)
        assert dark is not None
        assert dark.rgb is not None
        np.testing.assert_array_equal(dark.rgb[0, 0], feed.color[0, 0, 0] // 2)
        assert {c.name: c.value for c in camera.controls()}["gain"] == 50
        with pytest.raises(InputError, match="no control 'zoom'"):
            camera.set_control("zoom", 1)
        with pytest.raises(InputError, match="gain"):
            camera.set_control("gain", -5)
        assert camera.state is LiveState.STREAMING


def test_the_cameras_own_registration_is_an_option_that_is_told(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        camera.use_profile(CalibrationProfile(RIG, "A00363A01", "A00363A01"))
        camera.set_control("device_registration", 1)
        number = getattr(camera.latest(0, 5.0), "number", 0)
        frame = camera.latest(number + 2, 5.0)
        capture = camera.capture(frames=1)
    assert frame is not None
    assert frame.depth is not None
    assert any(np.array_equal(frame.depth[:, 8:], made[:, :-8]) for made in feed.depth)
    assert capture.rig.depth == VGA_COLOR  # registered depth lies in the colour camera's frame
    assert any("registration" in w for w in capture.warnings)


def test_an_unplugged_camera_is_gone_and_comes_back_when_it_is_opened_again(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        before = camera.latest(0, 5.0)
        assert before is not None
        camera.set_control("auto_exposure", 0)
        pid = camera.runtime_pid
        assert pid is not None
        feed.command("unplug")
        assert "unplugged" in str(failure_of(camera))
        assert camera.state is LiveState.GONE
        assert gone_process(pid)
        with pytest.raises(WorkError, match="could not open the device"):
            camera.open()
        feed.undo("unplug")
        camera.open()
        again = camera.latest(before.number, 5.0)
        assert again is not None
        assert camera.state is LiveState.STREAMING
        assert {c.name: c.value for c in camera.controls()}["auto_exposure"] == 0


def test_a_stalled_stream_is_told_and_goes_on_by_itself(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        assert camera.latest(0, 5.0) is not None
        feed.command("stall")
        assert wait_until(lambda: camera.state is LiveState.STALLED)
        last = camera.latest()
        assert last is not None
        assert camera.latest(last.number, 0.1) is None
        feed.undo("stall")
        assert camera.latest(last.number, 5.0) is not None
        assert camera.state is LiveState.STREAMING


def test_a_burst_on_a_stalled_camera_ends_with_a_message(
    feeds: Feeds, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        assert camera.latest(0, 5.0) is not None
        feed.command("stall")
        with pytest.raises(WorkError, match="stopped delivering frames"):
            camera.capture(frames=30)


def test_a_crash_of_the_driver_is_a_message_and_leaves_no_process(feeds: Feeds) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        assert camera.latest(0, 5.0) is not None
        pid = camera.runtime_pid
        assert pid is not None
        feed.command("crash")
        assert "crashed" in str(failure_of(camera))
        assert camera.state is LiveState.GONE
        assert gone_process(pid)
        assert camera.capture(frames=2).depth_frames.shape[0] == 2  # reconnects


def test_a_killed_runtime_is_a_message(feeds: Feeds) -> None:
    with OpenNICamera(feeds().uri) as camera:
        assert camera.latest(0, 5.0) is not None
        pid = camera.runtime_pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        assert "crashed" in str(failure_of(camera))
        assert gone_process(pid)


def test_a_frozen_runtime_is_given_up_after_a_while(feeds: Feeds, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.openni.live.HUNG_AFTER_S", 1.0)
    with OpenNICamera(feeds().uri) as camera:
        assert camera.latest(0, 5.0) is not None
        pid = camera.runtime_pid
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)
        assert "did not answer" in str(failure_of(camera))
        assert gone_process(pid)


def test_a_driver_that_hangs_in_a_call_costs_a_message_and_its_process(
    feeds: Feeds, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed = feeds()
    with OpenNICamera(feed.uri) as camera:
        assert camera.latest(0, 5.0) is not None
        pid = camera.runtime_pid
        assert pid is not None
        monkeypatch.setattr("devices.openni.process.ANSWER_TIMEOUT_S", 0.5)
        feed.command("hang")
        with pytest.raises(WorkError, match="did not answer"):
            camera.controls()
        assert camera.state is LiveState.GONE
        assert gone_process(pid)


def test_an_application_that_is_killed_leaves_neither_process_nor_memory(
    feeds: Feeds, tmp_path: Path
) -> None:
    import subprocess
    import sys

    feed = feeds()
    script = tmp_path / "application.py"
    script.write_text(
        "import sys, time\n"
        "from devices.openni.cameras import OpenNICamera\n"
        "if __name__ == '__main__':\n"
        "    camera = OpenNICamera(sys.argv[1])\n"
        "    camera.open()\n"
        "    camera.latest(0, 5.0)\n"
        "    print(camera.runtime_pid, flush=True)\n"
        "    time.sleep(60)\n"
    )
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen(
        [sys.executable, str(script), feed.uri],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(root)},
    ) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        feed.command("hang")
        process.kill()
    assert wait_until(lambda: gone_process(pid))
