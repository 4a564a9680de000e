"""A depth camera and an auxiliary camera as one: pairing, movement between the two, latency, profile."""

from __future__ import annotations

import io
import math
import re
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from core.calibration.profile import CalibrationProfile, ProfileStore
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import InputError, WorkError
from devices.auxiliary.camera import TimedPicture
from devices.auxiliary.folder_watch import FolderWatchCamera
from devices.auxiliary.latency import Movement, find_latency
from devices.auxiliary.pairing import DepthTrail, nearest_picture, still_possible
from devices.auxiliary.rig import NOMINAL_WARNING, RigCamera
from devices.camera import DepthCamera
from devices.live import LiveCamera, LiveState, StreamMode
from devices.registry import camera_factory, list_devices, register_camera
from tests.devices.auxiliary.moving_body import (
    CAMERA,
    UNIT_M,
    BodyColorCamera,
    BodyDepthCamera,
    depth_of_body,
    hold_still,
)


def steps_aside(at_s: float, by_m: float) -> object:
    """Stands, and from a moment on stands elsewhere."""
    return lambda t: (by_m if t > at_s else 0.0, 0.0, 0.0)


def sways(t: float) -> tuple[float, float, float]:
    """An irregular sway of 30 cm, as a waving arm is irregular."""
    return 0.3 * math.sin(4.0 * t) * math.cos(1.3 * t + math.sin(0.7 * t)), 0.0, 0.0


def profile_of(rig: RigCamera, size: tuple[int, int] = (160, 120)) -> CalibrationProfile:
    color = replace(CAMERA, width=size[0], height=size[1], fx=150.0, fy=150.0, cx=80.0, cy=60.0)
    place = RigidTransform.from_matrix(np.eye(4))
    identity = rig.identity
    return CalibrationProfile(
        CameraRig(CAMERA, color, place), identity.depth_serial, identity.color_serial, version=2
    )


def test_a_rig_is_a_live_camera_of_two() -> None:
    depth, color = BodyDepthCamera(), BodyColorCamera()
    with RigCamera(depth, color) as rig:
        assert isinstance(rig, LiveCamera)
        assert (rig.info.id, rig.info.kind) == ("rig:body:1|uvc:9", "rig")
        identity = rig.identity
        assert (identity.depth_serial, identity.color_serial, identity.sensor) == ("D1", "C1", "kinect-v1")
        assert depth.started_with == ("depth",), "the built-in colour camera stays off"
        frame = rig.latest(0, 1.0)
        assert frame is not None
        assert frame.depth is not None
        assert frame.rgb is not None
        assert frame.rgb.shape == (120, 160, 3)
        assert abs(frame.color_time_s - frame.time_s) < 0.5
        assert rig.state is LiveState.STREAMING
        depth.gone = True
        assert rig.state is LiveState.GONE
        with pytest.raises(WorkError, match="gone"):
            rig.latest(frame.number, 1.0)
    assert color.state is LiveState.CLOSED


def test_the_picture_nearest_to_the_middle_of_the_depth_is_taken() -> None:
    with RigCamera(BodyDepthCamera(), BodyColorCamera(fps=7.0)) as rig:
        capture = rig.capture(12)
        pairing = rig.last_pairing
    assert pairing is not None
    assert abs(pairing.gap_s) <= 0.5 / 7.0 + 0.01, "within half a picture's interval"
    assert pairing.moved_m is not None
    assert pairing.moved_m < 0.002
    assert capture.rig.color is not None
    assert capture.sensor == "kinect-v1"
    assert NOMINAL_WARNING in capture.warnings


def test_without_calibration_the_guess_is_said_and_with_it_the_profile_is_kept(tmp_path: Path) -> None:
    with RigCamera(BodyDepthCamera(), BodyColorCamera()) as rig:
        store = ProfileStore(tmp_path)
        kept = store.add(profile_of(rig))
        found = store.newest(rig.identity.depth_serial, rig.identity.color_serial)
        assert found is not None
        rig.use_profile(found)
        capture = rig.capture(8)
        assert capture.warnings == ()
        assert capture.calibration is not None
        assert capture.calibration["id"] == kept.id
        assert capture.rig.color == found.rig.color
        with pytest.raises(InputError, match="other cameras"):
            rig.use_profile(replace(found, color_serial="D1"))
        with pytest.raises(InputError, match="other image sizes"):
            rig.use_profile(profile_of(rig, (320, 240)))
        rig.choose_mode(StreamMode("color", 320, 240, 30, "rgb8"))
        assert rig.profile is None, "another resolution needs another calibration"


def test_modes_and_settings_are_those_of_the_cameras_that_are_used() -> None:
    with RigCamera(BodyDepthCamera(), BodyColorCamera()) as rig:
        assert [(m.kind, m.width) for m in rig.modes()] == [("depth", 320), ("color", 160), ("color", 320)]
        assert {c.name for c in rig.controls()} == {"exposure_lock", "latency_s", "emitter"}
        rig.set_control("latency_s", 0.03)
        rig.set_control("emitter", 0.0)
        assert next(c.value for c in rig.controls() if c.name == "latency_s") == 0.03
        with pytest.raises(InputError, match="auto_exposure"):
            rig.set_control("auto_exposure", 1.0)


def trail_of(times: np.ndarray, move: object) -> DepthTrail:
    trail = DepthTrail(CAMERA)
    for t in times:
        shift = tuple(round(v, 4) for v in move(t))  # type: ignore[operator]
        trail.add(float(t), depth_of_body(shift), UNIT_M)
    return trail


def picture_at(time_s: float, sigma_s: float = 0.01) -> TimedPicture:
    return TimedPicture(1, time_s, np.zeros((4, 4, 3), np.uint8), sigma_s)


def test_a_body_that_moved_before_the_picture_is_refused_with_the_figure() -> None:
    """Depth from 10.0 to 10.4 s; at 10.8 s it steps aside by 2 cm; the picture is taken at 11.2 s."""
    times = np.arange(10.0, 11.6, 0.05)
    trail = trail_of(times, steps_aside(10.8, 0.02))
    pairing = trail.check(times[:9], picture_at(11.2))
    assert pairing.gap_s == pytest.approx(1.0)
    assert pairing.moved_m == pytest.approx(0.02, abs=0.002)
    with pytest.raises(WorkError, match=r"moved by (19|20|21) mm between depth and picture \(1\.00 s\)"):
        pairing.judge()
    assert trail.check(times[:9], picture_at(10.6)).judge() == (), "before that it was still"


def test_a_small_movement_is_a_warning_with_the_figure() -> None:
    times = np.arange(10.0, 11.6, 0.05)
    pairing = trail_of(times, steps_aside(10.8, 0.008)).check(times[:9], picture_at(11.2))
    (warning,) = pairing.judge()
    assert re.search(r"moved by [89] mm between depth and picture", warning)


def test_a_picture_whose_moment_is_not_well_known_is_judged_by_the_worst() -> None:
    times = np.arange(10.0, 13.0, 0.05)
    trail = trail_of(times, steps_aside(11.8, 0.02))
    assert trail.check(times[:9], picture_at(11.2, 0.02)).judge() == ()
    with pytest.raises(WorkError, match="moved by"):
        trail.check(times[:9], picture_at(11.2, 0.5)).judge()


def test_a_moving_body_is_judged_by_its_speed_in_a_short_gap() -> None:
    """5 cm/s: 50 ms are 2.5 mm (and 10 ms of doubt 0.5 mm); the depth itself is smeared by a centimetre."""
    times = np.arange(10.0, 10.5, 0.033)
    pairing = trail_of(times, lambda t: (0.0, 0.0, 0.05 * (t - 10.0))).check(
        times, picture_at(float(times.mean()) + 0.05)
    )
    assert pairing.moved_m == pytest.approx(0.003, abs=0.0006)
    assert any("while depth was taken" in w for w in pairing.judge())


def test_where_no_depth_was_seen_the_movement_is_not_claimed_to_be_known() -> None:
    times = np.arange(10.0, 10.5, 0.05)
    pairing = trail_of(times, hold_still).check(times, picture_at(14.0))
    assert pairing.moved_m is None
    (warning,) = pairing.judge()
    assert "could not be checked" in warning


def test_pictures_that_can_no_longer_be_the_nearest_are_let_go() -> None:
    pictures = [picture_at(t) for t in (1.0, 1.1, 1.2, 1.3)]
    assert [p.time_s for p in still_possible(pictures, 1.15)] == [1.1, 1.2, 1.3]
    assert nearest_picture(pictures, 1.22).time_s == 1.2


def bar(t: float) -> np.ndarray:
    """A bar 40 pixels wide where the sway has brought it, with soft edges."""
    x = 80 + 60 * sways(t)[0]
    edge = np.clip(np.arange(160) - x + 20, 0, 1) * np.clip(x + 20 - np.arange(160), 0, 1)
    return np.tile(edge.astype(np.float32), (4, 1))


@pytest.mark.parametrize("late_s", [0.12, -0.05])
def test_the_delay_of_the_colour_stamps_is_measured_from_a_common_movement(late_s: float) -> None:
    depth, color = Movement(0.1), Movement(40.0)
    for t in np.arange(0.0, 6.0, 1 / 30):
        depth.add(t, 3.2 - 0.9 * bar(t))
    for t in np.arange(0.013, 6.0, 1 / 25):
        color.add(t + late_s, 250 * bar(t))
    found = find_latency(depth, color)
    assert found.delay_s == pytest.approx(late_s, abs=0.015)
    assert found.sigma_s < 0.03


def test_without_a_common_movement_no_delay_is_made_up() -> None:
    depth, color, dice = Movement(0.1), Movement(40.0), np.random.default_rng(0)
    for t in np.arange(0.0, 6.0, 1 / 30):
        depth.add(t, dice.normal(2.3, 0.005, (20, 30)).astype(np.float32))
        color.add(t, dice.normal(100, 3, (20, 30)).astype(np.float32))
    with pytest.raises(WorkError, match="no common movement"):
        find_latency(depth, color)
    with pytest.raises(WorkError, match="Too few pictures"):
        find_latency(Movement(0.1), color)


def test_a_measured_delay_is_used_from_then_on() -> None:
    """Live: stamps 150 ms late; after measuring, depth and picture of a moving body belong together."""
    color = BodyColorCamera(sways, late_s=0.15)
    with RigCamera(BodyDepthCamera(sways), color) as rig:
        found = rig.measure_latency(5.0)
    assert found.delay_s == pytest.approx(0.15, abs=0.03)
    assert color.latency_s == found.delay_s


def test_depth_is_taken_around_the_moment_of_the_shutter(tmp_path: Path) -> None:
    """The shutter is pressed 1.2 s after the capture was asked for; the file arrives 0.4 s later."""
    camera = FolderWatchCamera(tmp_path, latency_s=0.4)
    depth = BodyDepthCamera()
    stream = io.BytesIO()
    Image.fromarray(np.full((1200, 1800, 3), 90, np.uint8)).save(stream, "JPEG")
    pressed: list[float] = []

    def press() -> None:
        time.sleep(1.2)
        pressed.append(time.monotonic())
        time.sleep(0.4)
        (tmp_path / "IMG_0001.JPG").write_bytes(stream.getvalue())

    told: list[str] = []
    with RigCamera(depth, camera) as rig:
        assert rig.rig.color is None, "its size is known with the first picture"
        shutter = threading.Thread(target=press)
        shutter.start()
        capture = rig.capture(10, lambda fraction, message="": told.append(message))
        shutter.join()
        pairing = rig.last_pairing
    assert any("shutter" in message for message in told)
    assert capture.color is not None
    assert capture.color.shape == (1200, 1800, 3)
    assert len(capture.depth_frames) == 10
    assert pairing is not None
    assert abs(pairing.gap_s) < 0.1, "the ten frames around it"
    assert pairing.moved_m is not None
    assert pairing.moved_m < 0.003


def test_without_a_shutter_the_wait_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("devices.auxiliary.grab.SHUTTER_WAIT_S", 0.5)
    with (
        RigCamera(BodyDepthCamera(), FolderWatchCamera(tmp_path)) as rig,
        pytest.raises(WorkError, match="No picture came from the still camera"),
    ):
        rig.capture(5)


def test_rigs_are_made_by_their_id(tmp_path: Path) -> None:
    class Bodies:
        def devices(self) -> list[object]:
            return []

        def create(self, address: str) -> DepthCamera:
            return BodyDepthCamera(serial=address)

    register_camera("body", Bodies())  # type: ignore[arg-type]
    rig = camera_factory("rig").create(f"body:7|folder-watch:{tmp_path}?latency_s=0.5")
    assert isinstance(rig, RigCamera)
    assert rig.info.id == f"rig:body:1|folder-watch:{tmp_path}"
    for wrong in ("body:7", "|uvc:0", "body:7|", "body|uvc:0", "rig:body:7|uvc:0", "body:7|shutter:1"):
        with pytest.raises(InputError):
            camera_factory("rig").create(wrong)
    (tmp_path / "x").mkdir()
    with pytest.raises(InputError, match="no live depth camera"):
        camera_factory("rig").create(f"folder:{tmp_path / 'x'}|uvc:0")
    assert list_devices("rig") == []
