"""The simulated calibration board is a live camera like any other, with a rig that nobody has calibrated."""

from __future__ import annotations

import time

import numpy as np
import pytest

from core.calibration.board import detect_board
from core.calibration.profile import CalibrationProfile
from core.capture.rgbd import CameraRig
from core.errors import InputError, WorkError
from devices.live import LiveCamera, LiveState
from devices.registry import list_devices, open_device
from devices.simulator.board_device import BOARD_CAMERAS, BoardScene, SimulatedBoardCamera


def test_it_is_in_the_list_and_opens_by_its_name() -> None:
    (info,) = list_devices("simulator-board")
    assert info.live
    assert info.name == "Simulated calibration board"
    with open_device(info.id) as camera:
        assert isinstance(camera, LiveCamera)
        assert camera.state is LiveState.STREAMING
        assert camera.info.id == info.id
    assert camera.state is LiveState.CLOSED


def test_both_cameras_and_depth_see_the_board_where_it_is() -> None:
    with SimulatedBoardCamera(BoardScene(free=True, seed=2)) as camera:
        camera.start(("depth", "color", "infrared"))
        frame = camera.latest()
    assert frame is not None
    assert frame.rgb is not None
    assert frame.depth is not None
    infrared, color = detect_board(frame.infrared, camera.spec), detect_board(frame.rgb, camera.spec)
    assert infrared is not None
    assert color is not None
    u, v = np.rint(infrared.pixels.mean(axis=0)).astype(int)
    patch = frame.depth[v - 5 : v + 6, u - 5 : u + 6]
    assert 500 < np.median(patch[patch > 0]) < 1500


def test_streams_that_were_not_asked_for_do_not_come() -> None:
    with SimulatedBoardCamera(BoardScene(free=True)) as camera:
        camera.start(("infrared",))
        frame = camera.latest()
        assert frame is not None
        assert frame.rgb is None
        assert frame.depth is None
        with pytest.raises(WorkError, match="no depth"):
            camera.capture(1)


def test_a_kinect_streams_infrared_or_colour() -> None:
    with (
        SimulatedBoardCamera(BoardScene(exclusive=True)) as camera,
        pytest.raises(WorkError, match="same time"),
    ):
        camera.start(("color", "infrared"))


def test_frames_come_in_real_time_and_are_numbered() -> None:
    with SimulatedBoardCamera() as camera:
        camera.start(("infrared",))
        first = camera.latest(0, 1.0)
        assert first is not None
        second = camera.latest(first.number, 2.0)
        assert second is not None
        assert second.number > first.number
        assert second.time_s > first.time_s
        assert abs(second.time_s - time.monotonic()) < 2.0
        assert camera.latest(second.number + 10_000, 0.02) is None


def test_the_frames_belong_to_whoever_asked() -> None:
    with SimulatedBoardCamera() as camera:
        camera.start(("infrared",))
        frame = camera.latest(0, 1.0)
        assert frame is not None
        frame.infrared[:] = 0
        again = camera.latest(0, 1.0)
        assert again is not None
        assert again.infrared.max() > 0


def test_the_true_rig_is_hidden_until_it_is_calibrated() -> None:
    camera = SimulatedBoardCamera(BoardScene(seed=4))
    true = camera.truth.rig
    assert camera.rig.depth.fx != true.depth.fx
    who = camera.identity
    camera.use_profile(CalibrationProfile(true, who.depth_serial, who.color_serial))
    assert camera.rig is true
    with pytest.raises(InputError, match="other cameras"):
        camera.use_profile(CalibrationProfile(true, "other", who.color_serial))
    small = SimulatedBoardCamera(BoardScene(seed=4, color_size=(1280, 960))).truth.rig
    other = CameraRig(true.depth, small.color, small.color_from_depth)
    with pytest.raises(InputError, match="size"):
        camera.use_profile(CalibrationProfile(other, who.depth_serial, who.color_serial))


def test_a_capture_of_the_board_says_that_the_geometry_is_nominal() -> None:
    with SimulatedBoardCamera(BoardScene(free=True)) as camera:
        capture = camera.capture(2)
    assert capture.depth_frames.shape == (2, 480, 640)
    assert any("nominal" in warning for warning in capture.warnings)


@pytest.mark.parametrize(
    "address",
    [
        "other",
        "kinect?seed=x",
        "kinect?colour=1",
        "kinect?color=9x9",
        "kinect?paper=A5",
        "kinect?moved_deg=inf",
        "kinect?moved_mm=nan",
    ],
)
def test_wrong_addresses_are_refused(address: str) -> None:
    with pytest.raises(InputError):
        BOARD_CAMERAS.create(address)


def test_the_address_tells_the_whole_scene() -> None:
    address = "kinect?seed=3&paper=A4&exclusive=1&moved_deg=0.5&color=800x600"
    camera = BOARD_CAMERAS.create(address)
    again = BOARD_CAMERAS.create(camera.info.id.partition(":")[2])
    assert again.info == camera.info
    a, b = again.truth.rig, camera.truth.rig
    assert (a.depth, a.color) == (b.depth, b.color)
    assert np.array_equal(a.picture_from_depth.matrix, b.picture_from_depth.matrix)
