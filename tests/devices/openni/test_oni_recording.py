"""Recordings written here are opened and played by the real OpenNI2 runtime."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from devices.openni.calibration import NOMINAL_WARNING, calibration_path
from devices.openni.cameras import OniRecording, OpenNICamera, write_oni
from devices.openni.oni_file import write_oni_frames
from devices.openni.process import RuntimeProcess
from devices.openni.runtime import runtime_folders
from devices.registry import list_devices, open_device

pytestmark = pytest.mark.skipif(
    not any(list(f.glob("*OpenNI2.*")) for f in runtime_folders()),
    reason="the OpenNI2 runtime is not installed (apt-get install libopenni2-0)",
)

DEPTH = PinholeCamera(320, 240, 287.9, 287.9, 158.2, 121.0)
COLOR = PinholeCamera(320, 240, 262.5, 262.0, 160.0, 118.5, (0.02, -0.05, 0.0, 0.0, 0.0))
OFFSET = RigidTransform(np.eye(3), np.array([-0.025, 0.001, 0.0]))


def _capture(frames: int = 6, *, mirrored: bool = False, color: PinholeCamera = COLOR) -> RgbdCapture:
    rng = np.random.default_rng(7)
    return RgbdCapture(
        depth_frames=rng.integers(600, 3000, (frames, 240, 320)).astype(np.uint16),
        depth_unit_m=0.001,
        rig=CameraRig(DEPTH, color, OFFSET),
        color=rng.integers(0, 255, (color.height, color.width, 3)).astype(np.uint8),
        mirrored=mirrored,
    )


def test_a_saved_capture_is_played_back_bit_for_bit_with_its_calibration(tmp_path: Path) -> None:
    saved = _capture()
    write_oni(saved, tmp_path / "a.oni")
    with OniRecording(tmp_path / "a.oni") as recording:
        played = recording.capture(frames=6)
    np.testing.assert_array_equal(played.depth_frames, saved.depth_frames)
    np.testing.assert_array_equal(played.color, saved.color)
    assert played.rig.depth == DEPTH
    assert played.rig.color == COLOR
    assert played.rig.color_from_depth is not None
    np.testing.assert_allclose(played.rig.color_from_depth.matrix, OFFSET.matrix)
    assert played.depth_unit_m == pytest.approx(0.001)


def test_captures_go_on_through_the_file_and_start_again_at_its_end(tmp_path: Path) -> None:
    saved = _capture(frames=5)
    write_oni(saved, tmp_path / "a.oni")
    with OniRecording(tmp_path / "a.oni") as recording:
        first, second, third, again = (recording.capture(frames=2).depth_frames for _ in range(4))
    np.testing.assert_array_equal(first, saved.depth_frames[:2])
    np.testing.assert_array_equal(second, saved.depth_frames[2:4])
    np.testing.assert_array_equal(third, saved.depth_frames[4:])
    np.testing.assert_array_equal(again, saved.depth_frames[:2])


def test_a_large_auxiliary_picture_keeps_its_full_size(tmp_path: Path) -> None:
    large = PinholeCamera(2560, 1920, 2100.0, 2100.0, 1279.5, 959.5)
    saved = _capture(frames=2, color=large)
    write_oni(saved, tmp_path / "a.oni")
    with OniRecording(tmp_path / "a.oni") as recording:
        played = recording.capture(frames=2)
    assert played.rig.color == large
    np.testing.assert_array_equal(played.color, saved.color)


def test_a_mirrored_recording_is_seen_the_right_way_round(tmp_path: Path) -> None:
    saved = _capture(mirrored=True)
    write_oni(saved, tmp_path / "a.oni")
    with OniRecording(tmp_path / "a.oni") as recording:
        played = recording.capture(frames=6)
    assert not played.mirrored
    np.testing.assert_array_equal(played.depth_frames, saved.depth_frames[:, :, ::-1])


def test_without_calibration_the_field_of_view_is_used_and_said_to_be_nominal(tmp_path: Path) -> None:
    write_oni(_capture(), tmp_path / "a.oni")
    calibration_path(tmp_path / "a.oni").unlink()
    with OniRecording(tmp_path / "a.oni") as recording:
        played = recording.capture(frames=2)
    assert played.rig.depth.fx == pytest.approx(DEPTH.fx, rel=1e-4)
    assert NOMINAL_WARNING in played.warnings


def test_depth_in_tenths_of_a_millimetre_keeps_its_unit(tmp_path: Path) -> None:
    frames = np.full((2, 240, 320), 12345, np.uint16)
    write_oni_frames(tmp_path / "a.oni", frames, DEPTH, depth_unit_m=0.0001)
    with OniRecording(tmp_path / "a.oni") as recording:
        played = recording.capture(frames=2)
    assert played.depth_unit_m == pytest.approx(0.0001)
    assert played.color is None


def test_a_unit_that_the_format_does_not_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"0\.125 mm"):
        write_oni_frames(tmp_path / "a.oni", np.ones((1, 240, 320), np.uint16), DEPTH, depth_unit_m=0.000125)
    assert list(tmp_path.iterdir()) == []


def test_the_registry_opens_a_recording_by_its_path(tmp_path: Path) -> None:
    write_oni(_capture(frames=1), tmp_path / "a.oni")
    camera = open_device(f"recording:{tmp_path / 'a.oni'}")
    try:
        assert camera.info.kind == "recording"
        preview = camera.preview()
        assert preview is not None
        assert preview.depth_m is not None
        assert preview.depth_m.shape == (120, 160)
    finally:
        camera.close()


def test_without_hardware_no_camera_is_listed_and_nothing_hangs() -> None:
    assert all(info.live for info in list_devices("openni"))


@pytest.mark.parametrize("keep", [0.05, 0.5, 0.98])
def test_a_cut_off_recording_is_refused(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "a.oni"
    write_oni(_capture(), path)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * keep)])
    with pytest.raises(InputError, match="cut off"):
        OniRecording(path)


@pytest.mark.parametrize("content", [b"", b"NI", b"\x89PNG\r\n\x1a\n" + bytes(100)])
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.oni"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not an OpenNI2 recording"):
        OniRecording(path)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        "{}",
        '{"format": "other/1", "depth": {}}',
        '{"format": "geoderm-rig/1", "depth": {"width": 1}}',
    ],
)
def test_a_bad_calibration_beside_the_recording_is_named(tmp_path: Path, content: str) -> None:
    path = tmp_path / "a.oni"
    write_oni(_capture(frames=1), path)
    calibration_path(path).write_text(content)
    with pytest.raises(InputError, match=r"calibration\.json"):
        OniRecording(path)


def test_a_crash_of_the_runtime_is_a_message_and_the_next_request_works() -> None:
    runtime = RuntimeProcess()
    try:
        runtime.request("list_devices")
        assert runtime.pid is not None
        os.kill(runtime.pid, signal.SIGKILL)
        with pytest.raises(WorkError, match="crashed"):
            runtime.request("close")
        assert not runtime.alive
        runtime.request("list_devices")
    finally:
        runtime.stop()


def test_a_runtime_that_hangs_is_given_up_and_leaves_no_process() -> None:
    runtime = RuntimeProcess()
    try:
        runtime.request("list_devices")
        assert runtime.pid is not None
        pid = runtime.pid
        os.kill(pid, signal.SIGSTOP)
        with pytest.raises(WorkError, match="did not answer"):
            runtime.request("list_devices", timeout_s=0.5)
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    finally:
        runtime.stop()


def test_a_camera_that_is_not_there_is_a_clear_message() -> None:
    with pytest.raises(WorkError, match="could not open the device"):
        OpenNICamera("usb://no-such-camera").open()


def test_a_live_camera_delivers_frames_through_the_runtime() -> None:
    """OpenNI2's own dummy driver is a live device of 320 x 240 depth and colour."""
    with OpenNICamera("Dummy", "Dummy") as camera:
        capture = camera.capture(frames=3)
        assert capture.depth_frames.shape == (3, 240, 320)
        assert capture.color is not None
        assert NOMINAL_WARNING in capture.warnings
        assert not capture.mirrored
        preview = camera.preview()
    assert preview is not None


def test_a_live_camera_whose_runtime_dies_can_be_used_again() -> None:
    with OpenNICamera("Dummy", "Dummy") as camera:
        camera.capture(frames=1)
        pid = camera.runtime_pid
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(WorkError, match="crashed"):
            camera.capture(frames=1)
        assert camera.capture(frames=1).depth_frames.shape == (1, 240, 320)
