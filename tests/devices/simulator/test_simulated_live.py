"""The simulated patient as the viewfinder sees him: 30 frames a second, live sway, faults on demand."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from core.errors import Cancelled, InputError, WorkError
from devices.burst import collect_burst
from devices.live import LiveCamera, LiveFrame, LiveState
from devices.registry import open_device
from devices.simulator import SimulatedCamera, SimulatedCapture, SimulatedPatient, SimulatedScene
from devices.simulator.live_address import SIMULATED_CAMERAS
from devices.simulator.live_faults import Faults
from devices.simulator.live_light import LightControl
from devices.simulator.live_process import DRAWING
from devices.simulator.live_scene import LiveScene, prepare_scene, unquantised
from devices.simulator.live_stream import PatientStream
from devices.simulator.live_sway import FRAME_S, StandingPerson
from devices.simulator.live_view import SceneView

FIRST_FRAME_S = 120.0
"""Far more than it takes; for a machine that is busy with other things."""


def first_frame(camera: SimulatedCamera) -> LiveFrame:
    frame = camera.latest(0, FIRST_FRAME_S)
    assert frame is not None
    return frame


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + FIRST_FRAME_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture(scope="module")
def prepared(patient: SimulatedPatient) -> LiveScene:
    from devices.simulator.live_geometry import live_rig_of

    return prepare_scene(patient, SimulatedScene(), live_rig_of(patient.rig.rig))


# --- the camera ---------------------------------------------------------------------------------------------


def test_the_viewfinder_shows_the_patient_of_the_captures(
    patient: SimulatedPatient, first: SimulatedCapture
) -> None:
    with SimulatedCamera(patient) as camera:
        assert isinstance(camera, LiveCamera)
        frame = first_frame(camera)
        assert frame.number >= 1
        assert abs(time.monotonic() - frame.time_s) < 5.0
        assert frame.depth is not None
        assert frame.rgb is not None
        assert (frame.depth.shape, frame.depth.dtype) == ((480, 640), np.uint16)
        assert (frame.rgb.shape, frame.rgb.dtype) == ((480, 640, 3), np.uint8)
        assert frame.infrared is None
        modes = {m.kind: (m.width, m.height, m.fps) for m in camera.modes()}
        assert modes == {"depth": (640, 480, 30), "color": (640, 480, 30)}
        camera.choose_mode(camera.modes()[0])

        capture = camera.capture(frames=6)
        assert DRAWING.pid is not None  # drawn there, and yet the same
        assert np.array_equal(capture.depth_frames, first.capture.depth_frames)
        assert np.array_equal(capture.color, first.capture.color)
        seen, taken = frame.depth, capture.depth_frames[0]
        both = (seen > 0) & (taken > 0)
        assert both.mean() > 0.8
        assert float(np.median(np.abs(seen[both].astype(int) - taken[both]))) < 40
        assert camera.rig.depth == capture.rig.depth
        assert camera.last is not None
        assert camera.last.capture is capture

        before = camera.preview()
        assert before is not None
        assert before.rgb is not None
        assert before.rgb.shape == (240, 320, 3)
        camera.stand(view="back")
        assert camera.changing
        moving = camera.latest(0)
        assert moving is not None  # the earlier view goes on meanwhile
        wait_for(lambda: not camera.changing)
        after = camera.preview()
        assert after is not None
        assert after.rgb is not None
        assert np.abs(before.rgb.astype(int) - after.rgb).max() > 60


def test_serial_numbers_follow_from_shape_and_seed() -> None:
    one, same = SimulatedCamera("child10", seed=3).identity, SimulatedCamera("child10", seed=3).identity
    assert one == same
    assert one.depth_serial == "SIM-child10-3"
    assert one.color_serial != one.depth_serial
    assert SimulatedCamera("child10", seed=4).identity.depth_serial != one.depth_serial
    assert (one.sensor, one.lasting) == ("kinect-v1", True)


def test_before_the_first_look_nothing_is_drawn_and_nothing_runs(dummy: SimulatedPatient) -> None:
    threads = threading.active_count()
    camera = SimulatedCamera(dummy)
    assert camera.state is LiveState.CLOSED
    with camera:
        assert camera.state is LiveState.STREAMING
        assert threading.active_count() == threads
        with pytest.raises(WorkError, match="infrared"):
            camera.start(("infrared",))
    with pytest.raises(WorkError, match="closed"):
        camera.latest()


def test_a_camera_closed_while_the_patient_is_drawn_leaves_no_thread(dummy: SimulatedPatient) -> None:
    threads = set(threading.enumerate())
    camera = SimulatedCamera(dummy)
    camera.open()
    assert camera.latest(0, 0.0) is None
    began = time.monotonic()
    camera.close()
    assert time.monotonic() - began < 10.0
    assert set(threading.enumerate()) <= threads


def test_a_bad_stance_a_cancelled_capture_and_a_dead_process_are_survived(dummy: SimulatedPatient) -> None:
    def stop(fraction: float, message: str = "") -> None:
        if fraction > 0.2:
            raise Cancelled

    with SimulatedCamera(dummy, SimulatedScene(stance="handstand")) as camera:
        with pytest.raises(InputError, match="handstand"):
            camera.latest(0, FIRST_FRAME_S)
        camera.stand(stance="T")
        assert first_frame(camera).depth is not None
        with pytest.raises(Cancelled):
            camera.capture(frames=30, progress=stop)
        victim = DRAWING.pid
        assert victim is not None
        os.kill(victim, signal.SIGTERM)
        capture = camera.capture(frames=2)
        assert (len(capture.depth_frames), capture.stance) == (2, "T")
        assert DRAWING.pid != victim


def test_options_of_the_address_reach_the_patient() -> None:
    camera = open_device("simulator:child10?seed=2&sway=restless&light=0.3&fault=stall@20,unplug@40")
    assert isinstance(camera, SimulatedCamera)
    with camera:
        assert camera.identity.depth_serial == "SIM-child10-2"
        assert camera._faults == Faults(20.0, 40.0)
        assert camera._sway == "restless"


# --- the stream ---------------------------------------------------------------------------------------------


def stream_of(scene: LiveScene, faults: Faults | None = None, sway_m: float = 0.003) -> PatientStream:
    """A stream whose patient is there at once and takes other stances without help."""
    return PatientStream(
        lambda wanted, stop: scene,
        SimulatedScene(),
        lambda stature_m: StandingPerson(sway_m, 0.004, stature_m, 1),
        1,
        ("depth", "color"),
        faults or Faults(),
    )


def test_frames_come_at_30_a_second_and_are_counted(prepared: LiveScene) -> None:
    stream = stream_of(prepared)
    frames: list[LiveFrame] = []
    while len(frames) < 20:
        frame = stream.latest(frames[-1].number if frames else 0, 5.0)
        assert frame is not None
        frames.append(frame)
    numbers, times = np.array([f.number for f in frames]), np.array([f.time_s for f in frames])
    assert (np.diff(numbers) >= 1).all()
    assert np.allclose(np.diff(times), np.diff(numbers) * FRAME_S, atol=1e-9)
    assert stream.latest(frames[-1].number + 50, 0.05) is None
    stream.close()


def test_frames_belong_to_who_took_them(prepared: LiveScene) -> None:
    stream = stream_of(prepared, Faults(stall_s=0.3))  # soon the same frame for everybody
    assert stream.latest(0, 5.0) is not None
    time.sleep(0.4)
    mine = stream.latest(0)
    assert mine is not None
    assert mine.depth is not None
    kept = mine.depth.copy()
    mine.depth[:] = 0
    yours = stream.latest(0)
    assert yours is not None
    assert np.array_equal(yours.depth, kept)
    stream.close()


def test_a_stalled_stream_says_so_and_a_burst_ends_with_advice(prepared: LiveScene) -> None:
    stream = stream_of(prepared, Faults(stall_s=0.2))
    assert stream.latest(0, 5.0) is not None
    time.sleep(0.3)
    last = stream.latest()
    assert last is not None
    assert stream.latest(last.number, 0.1) is None
    assert stream.state is LiveState.STREAMING
    with pytest.raises(WorkError, match="stopped delivering"):
        collect_burst(stream.latest, 3, timeout_s=0.2)
    stream._first_s -= 3.0
    assert stream.state is LiveState.STALLED
    stream.restart(("depth",))
    again = stream.latest(0, 5.0)
    assert again is not None
    assert again.rgb is None
    stream.close()


def test_an_unplugged_camera_is_gone_with_advice(prepared: LiveScene) -> None:
    stream = stream_of(prepared, Faults(unplug_s=2.0))
    assert stream.latest(0, 5.0) is not None
    time.sleep(2.1)
    assert stream.state is LiveState.GONE
    with pytest.raises(WorkError, match="unplugged"):
        stream.latest(0, 1.0)
    stream.close()
    assert stream.state is LiveState.CLOSED


# --- what the frames show -----------------------------------------------------------------------------------


def test_depth_noise_and_gaps_are_those_of_the_captures(prepared: LiveScene, first: SimulatedCapture) -> None:
    view, person = SceneView(prepared, 0), StandingPerson(0.003, 0.004, 1.75, 0)
    live = np.stack([view.depth(person.at(k + 1)) for k in range(6)])
    taken = first.capture.depth_frames

    def spread(frames: np.ndarray) -> float:
        body = (frames > 0).all(axis=0) & (np.median(frames, axis=0) < 2700)
        return float(np.median(frames[:, body].std(axis=0)))

    assert spread(live) == pytest.approx(spread(taken), rel=0.35)
    assert (live > 0).mean() == pytest.approx((taken > 0).mean(), abs=0.03)
    # the sensor's quantisation: the readings of the captures are among those of the viewfinder
    assert np.isin(np.unique(live), np.append(np.unique(taken), 0)).mean() > 0.9


def test_sway_moves_picture_and_depth_by_what_the_renderer_says(
    prepared: LiveScene, patient: SimulatedPatient, first: SimulatedCapture
) -> None:
    """2 cm forward at the head is 2 cm more depth there and nothing at the feet."""
    view = SceneView(prepared, 0)
    lean = np.array([0.02 / patient.model.stature_m, 0.0, 0.0])
    rest = np.median([view.depth(np.zeros(3)) for _ in range(12)], axis=0)
    leaning = np.median([view.depth(lean) for _ in range(12)], axis=0)
    joints = first.truth.joints_m
    camera = patient.rig.rig.depth

    def change(joint: str) -> float:
        u, v = np.rint(camera.project(joints[joint])[0]).astype(int)
        patch = (slice(v - 6, v + 7), slice(u - 3, u + 4))
        return float(leaning[patch].mean() - rest[patch].mean())

    assert abs(change("head")) == pytest.approx(20.0, abs=6.0)
    assert abs(change("left_foot")) < 6.0
    side = view.rgb(np.array([0.0, 0.02 / patient.model.stature_m, 0.0])).astype(int)
    still = view.rgb(np.zeros(3)).astype(int)
    u, v = np.rint(patient.rig.rig.project_to_picture(joints["head"])[0]).astype(int)

    def matched(dx: int) -> float:
        a = still[v - 20 : v + 20, u - 25 : u + 25]
        return float(np.abs(a - side[v - 20 : v + 20, u - 25 + dx : u + 25 + dx]).mean())

    best = min(range(-9, 10), key=matched)
    expected = 0.02 * patient.rig.color.fx / float(joints["head"][2])
    assert abs(best) == pytest.approx(expected, abs=1.5)


def test_a_reading_is_put_back_on_its_own_level() -> None:
    raw = np.array([[[0, 1000, 1002, 1010, 3000, 9000]]], np.uint16)
    fine, table = unquantised(raw, np.random.default_rng(0))
    assert table[fine.view(np.uint16)].tolist() == [[[0, 1000, 1002, 1010, 3000, 0]]]
    assert table[(fine + 4000).astype(np.int16).view(np.uint16)][0, 0, 0] == 0  # lost stays lost


@pytest.mark.parametrize("usual", [0.0, 0.003, 0.015])
def test_sway_has_the_size_asked_for_and_is_smooth(usual: float) -> None:
    person = StandingPerson(usual, 0.0, 1.75, 3)
    angles = np.array([person.at(k)[:2] for k in range(1, 4001)])
    head_m = angles * 1.75
    assert float(head_m.std()) == pytest.approx(usual, rel=0.2)
    assert float(np.diff(head_m, axis=0).std()) <= 0.1 * usual + 1e-12


def test_a_patient_who_takes_another_stance_cannot_be_still_and_settles_within_a_second() -> None:
    person = StandingPerson(0.0, 0.0, 1.75, 3)
    moving = np.array([person.at(k, moving=True)[:2] for k in range(1, 61)]) * 1.75
    assert float(np.abs(np.diff(moving[30:], axis=0)).max()) > 0.0005
    settled = np.array([person.at(k)[:2] for k in range(61, 121)]) * 1.75
    assert float(np.abs(settled[40:]).max()) < 0.003


@pytest.mark.parametrize(("light", "brightness"), [(1.0, 1.0), (4.0, 1.0), (0.7, 1.0), (0.3, 0.5)])
def test_automatic_exposure_reaches_as_far_as_the_frame_rate_lets_it(light: float, brightness: float) -> None:
    control = LightControl(light)
    gain = light * control.exposure_in_force_s / 0.02
    assert gain == pytest.approx(brightness)
    assert control.exposure_in_force_s <= 1 / 30
    table = control.table
    assert (table is None) == (brightness == 1.0)
    if table is not None:
        assert int(table[100]) < 100


@pytest.mark.parametrize(
    "option", ["distance_m=nan", "distance_m=100", "seed=-1", "seed=99999999999", "visit=0", "light=inf"]
)
def test_an_option_out_of_range_is_wrong_use(option: str) -> None:
    with pytest.raises(InputError, match="out of range"):
        SIMULATED_CAMERAS.create(f"m_young_avg?{option}")
