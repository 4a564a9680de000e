"""A RealSense camera, played by the library's own software device: geometry, frames, controls, faults."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

rs = pytest.importorskip("pyrealsense2", reason="the optional library pyrealsense2 is not installed")

from core.calibration.profile import CalibrationProfile, DepthCorrection  # noqa: E402
from core.capture.rgbd import CameraRig  # noqa: E402
from core.errors import InputError, WorkError  # noqa: E402
from devices.live import LiveCamera, LiveState  # noqa: E402
from devices.realsense import library  # noqa: E402
from devices.realsense.camera import REALSENSE_CAMERAS, RealSenseCamera  # noqa: E402
from devices.realsense.frames import FrameClock  # noqa: E402
from devices.realsense.geometry import camera_facts, camera_of, transform_of  # noqa: E402
from devices.registry import list_devices, open_device  # noqa: E402
from tests.devices.realsense.software_camera import SoftwareSource  # noqa: E402
from tests.devices.realsense.software_device import (  # noqa: E402
    ANGLE,
    COLOR_SIZE,
    SERIAL,
    TRANSLATION,
    TRUE_UNIT_M,
    intrinsics,
)


@pytest.fixture(scope="module")
def camera() -> Iterator[RealSenseCamera]:
    with RealSenseCamera(source=SoftwareSource()) as opened:
        yield opened
    with pytest.raises(WorkError, match="closed"):
        opened.latest()


def faulty(fault: str) -> RealSenseCamera:
    camera = RealSenseCamera(source=SoftwareSource(fault=fault))
    camera.open()
    return camera


def test_it_is_a_live_camera_with_its_own_names(camera: RealSenseCamera) -> None:
    assert isinstance(camera, LiveCamera)
    identity = camera.identity
    assert (identity.model, identity.depth_serial, identity.color_serial, identity.sensor) == (
        "Software RealSense",
        SERIAL,
        SERIAL,
        "realsense-d4xx",
    )
    assert identity.lasting
    assert camera.state is LiveState.STREAMING


def test_the_factory_calibration_is_the_rig(camera: RealSenseCamera) -> None:
    rig = camera.rig
    assert rig.color is not None
    assert (rig.depth.fx, rig.depth.fy, rig.depth.cx, rig.depth.cy) == (150.0, 151.0, 78.5, 62.25)
    assert rig.color.distortion == pytest.approx((0.05, -0.08, 0.001, 0.002, 0.01))
    # As the library itself moves a point from depth to colour, and projects it there.
    pose = rs.extrinsics()
    c, s = float(np.cos(ANGLE)), float(np.sin(ANGLE))
    pose.rotation, pose.translation = [c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c], list(TRANSLATION)
    lens = intrinsics(COLOR_SIZE, 250.0, rs.distortion.brown_conrady, [0.05, -0.08, 0.001, 0.002, 0.01])
    for point in ([0.2, -0.3, 2.0], [-0.4, 0.25, 1.5]):
        theirs = rs.rs2_project_point_to_pixel(lens, rs.rs2_transform_point_to_point(pose, point))
        np.testing.assert_allclose(rig.project_to_picture([point])[0], theirs, atol=2e-3)


@pytest.mark.parametrize("model", ["inverse_brown_conrady", "modified_brown_conrady"])
def test_other_lens_models_are_followed_as_the_library_computes_them(model: str) -> None:
    """Coefficients of the size that D4xx colour cameras have."""
    lens = intrinsics(
        (1280, 720), 910.0, getattr(rs.distortion, model), [-0.055, 0.066, -0.0007, 0.0003, -0.02]
    )
    camera, warnings = camera_of(camera_facts(lens))
    assert warnings == ()
    for pixel in ([0.0, 0.0], [1279.0, 0.0], [640.0, 719.0], [300.0, 500.0]):
        if model == "inverse_brown_conrady":
            ray = rs.rs2_deproject_pixel_to_point(lens, pixel, 1.0)
            seen = pixel
        else:
            ray = [(pixel[0] - lens.ppx) / lens.fx, (pixel[1] - lens.ppy) / lens.fy, 1.0]
            seen = rs.rs2_project_point_to_pixel(lens, ray)
        assert np.linalg.norm(camera.project([ray])[0] - seen) < 0.3


def test_a_lens_that_cannot_be_followed_is_said() -> None:
    lens = intrinsics((640, 480), 250.0, rs.distortion.kannala_brandt4, [0.5, 0.3, 0.1, 0.1, 0.0])
    _, warnings = camera_of(camera_facts(lens))
    assert any("calibrate the rig" in w for w in warnings)


def test_rotations_come_by_columns() -> None:
    quarter = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # x goes to y
    np.testing.assert_allclose(transform_of(quarter, [0, 0, 0]).apply([[1.0, 0, 0]])[0], [0, 1, 0], atol=1e-9)


def test_frames_come_with_their_times_and_the_receiver_owns_them(camera: RealSenseCamera) -> None:
    first = camera.latest(0, 3.0)
    assert first is not None
    second = camera.latest(first.number, 3.0)
    assert second is not None
    assert second.number > first.number
    for frame in (first, second):
        assert frame.depth is not None
        assert frame.rgb is not None
        assert frame.depth_unit_m == TRUE_UNIT_M
        assert (frame.depth[:10] == 0).all()
        assert frame.rgb[5, 5].tolist() == [200, 0, 0], "red is red"
        assert int(frame.depth[50, 50] - 4000) % 256 == frame.rgb[0, 0, 1], "colour of the same moment"
        assert abs(frame.color_time_s - frame.time_s) < 0.02
        assert 0 <= time.monotonic() - frame.time_s < 1.0
        frame.depth[:] = 7
    later = camera.latest(second.number, 3.0)
    assert later is not None
    assert later.depth is not None
    assert later.depth[50, 50] > 4000


def test_infrared_comes_when_it_is_asked_for(camera: RealSenseCamera) -> None:
    frame = camera.latest(0, 3.0)
    assert frame is not None
    assert frame.infrared is None
    camera.start(["depth", "color", "infrared"])
    after, deadline = frame.number, time.monotonic() + 5.0
    while frame is None or frame.infrared is None:
        assert time.monotonic() < deadline
        frame = camera.latest(after, 1.0)
    assert frame.infrared.shape == (120, 160)
    camera.start()


def test_a_capture_is_a_burst_with_the_factory_warning(camera: RealSenseCamera) -> None:
    capture = camera.capture(8)
    assert capture.depth_frames.shape == (8, 120, 160)
    assert capture.sensor == "realsense-d4xx"
    assert capture.calibration is None
    assert any("factory calibration" in w for w in capture.warnings)
    numbers = capture.depth_frames[:, 50, 50].astype(int)
    assert (np.diff(numbers) > 0).all()
    assert capture.color is not None
    middle = 0.5 * (numbers[0] + numbers[-1]) - 4000
    assert abs(int(capture.color[0, 0, 1]) - middle % 256) <= 1.5, "the picture of the middle of the burst"


def test_a_profile_is_used_and_one_of_other_cameras_refused(camera: RealSenseCamera) -> None:
    rig = camera.rig
    profile = CalibrationProfile(rig, SERIAL, SERIAL, DepthCorrection(1.01, 0.0), version=3)
    camera.use_profile(profile)
    capture = camera.capture(2)
    assert capture.calibration is not None
    assert capture.calibration["version"] == 3
    assert capture.warnings == ()
    assert capture.depth_frames[0, 50, 50] > 4035, "the depth correction was applied"
    camera.use_profile(None)
    with pytest.raises(InputError, match="other cameras"):
        camera.use_profile(replace(profile, color_serial="another"))
    with pytest.raises(InputError, match="other image sizes"):
        camera.use_profile(replace(profile, rig=CameraRig(rig.depth)))
    assert camera.profile is None


def test_exposure_and_white_balance_are_set_in_seconds_and_kelvin(camera: RealSenseCamera) -> None:
    def values() -> dict[str, float]:
        return {c.name: c.value for c in camera.controls()}

    assert values()["exposure_s"] == pytest.approx(0.0156)
    assert values()["depth_exposure_s"] == pytest.approx(0.0085)
    camera.set_control("exposure_s", 0.01)
    assert (values()["exposure_s"], values()["auto_exposure"]) == (pytest.approx(0.01), 0.0)
    assert values()["depth_auto_exposure"] == 1.0, "the depth sensor's own automatic stays on"
    camera.set_control("emitter", 0.0)
    assert values()["emitter"] == 0.0
    for name, value in (("exposure_s", 99.0), ("shutter", 1.0)):
        with pytest.raises(InputError):
            camera.set_control(name, value)


def test_modes_are_listed_and_a_foreign_one_refused(camera: RealSenseCamera) -> None:
    modes = camera.modes()
    assert {m.kind for m in modes} == {"depth", "color", "infrared"}
    camera.choose_mode(next(m for m in modes if m.kind == "depth"))
    with pytest.raises(InputError, match="no such depth mode"):
        camera.choose_mode(replace(modes[0], width=4000))


def test_an_unplugged_camera_is_said_and_its_process_ends() -> None:
    camera = faulty("unplugged")
    with pytest.raises(WorkError, match="unplugged"):
        camera.capture(60)
    assert camera.state is LiveState.GONE
    camera.close()
    assert camera.pid is None


def test_a_stalled_stream_is_a_message_not_a_hang() -> None:
    camera = faulty("stalls")
    started = time.monotonic()
    with pytest.raises(WorkError, match="stopped delivering frames"):
        camera.capture(60)
    assert camera.state is LiveState.STALLED
    assert time.monotonic() - started < 10.0
    camera.close()


@pytest.mark.parametrize("fault", ["crashes", "hangs", "killed"])
def test_a_native_crash_or_hang_costs_a_message(fault: str) -> None:
    camera = faulty("" if fault == "killed" else fault)
    pid = camera.pid
    assert pid is not None
    if fault == "killed":
        os.kill(pid, signal.SIGKILL)
    if fault == "hangs":
        with pytest.raises(WorkError, match="stopped delivering"):
            camera.capture(60)
    else:
        with pytest.raises(WorkError, match="driver crashed"):
            camera.capture(60)
        assert camera.state is LiveState.GONE
    camera.close()
    assert not Path(f"/proc/{pid}").exists(), "no zombie stays behind"
    if fault == "crashes":
        return
    camera.open()
    assert camera.latest(0, 3.0) is not None, "opening it again is the way back"
    camera.close()


def test_a_camera_that_is_not_connected_is_said() -> None:
    with pytest.raises(WorkError, match="RealSense camera 99 is not connected"):
        open_device("realsense:99")
    assert list_devices("realsense") == []


def test_without_the_library_there_are_no_devices_and_a_clear_message(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    monkeypatch.setattr(library, "find_spec", lambda name: None)
    assert REALSENSE_CAMERAS.devices() == []
    with pytest.raises(WorkError, match=r"geoderm\[realsense\]"):
        library.load()


class _Frame:
    """Only the stamp of a frame."""

    def __init__(self, stamp_s: float, domain: object) -> None:
        self._stamp_ms, self._domain = stamp_s * 1000.0, domain

    def get_timestamp(self) -> float:
        return self._stamp_ms

    def get_frame_timestamp_domain(self) -> object:
        return self._domain


def test_stamps_of_the_host_and_of_the_camera_come_to_our_clock() -> None:
    clock, own = FrameClock(), rs.timestamp_domain.hardware_clock
    host = clock.time_s(_Frame(time.time() - 0.03, rs.timestamp_domain.system_time), "depth")
    assert time.monotonic() - host == pytest.approx(0.03, abs=0.01)
    start = time.monotonic()
    errors = []
    for delay_s in (0.03, 0.005, 0.02, 0.012):
        exposed = time.monotonic()
        time.sleep(delay_s)
        errors.append(clock.time_s(_Frame(exposed - start + 77.0, own), "color") - exposed)
    assert errors[0] >= 0.03
    assert all(0.004 < e < 0.011 for e in errors[1:]), "late ones are placed as the quickest one was"


def test_the_kernels_list_tells_when_there_is_no_intel_device(tmp_path: Path) -> None:
    for vendor in ("046d", "1d6b"):
        (tmp_path / vendor).mkdir()
        (tmp_path / vendor / "idVendor").write_text(f"{vendor}\n")
    assert not library.may_be_connected(tmp_path)
    (tmp_path / "046d" / "idVendor").write_text("8086\n")
    assert library.may_be_connected(tmp_path)
    assert library.may_be_connected(tmp_path / "elsewhere"), "where it cannot be told, the library is asked"
