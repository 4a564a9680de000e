"""The simulated hand is a live camera like any other."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator

import numpy as np
import pytest

from core.errors import InputError, WorkError
from core.hand.names import POINT_NAMES
from devices.live import LiveCamera, LiveFrame, LiveState
from devices.registry import list_devices, open_device
from devices.simulator.hand_device import SIMULATED_HANDS, SimulatedHandCamera
from devices.simulator.hands.live_loop import LoopPlan, LoopShow, empty_room, loop_frame
from devices.simulator.hands.sequence import hand_motion, view_at
from devices.simulator.hands.shots import Holder


@pytest.fixture(scope="module")
def camera() -> Iterator[SimulatedHandCamera]:
    with SimulatedHandCamera(LoopPlan(Holder(seed=1), seconds=1.0)) as opened:
        yield opened


def drawing() -> set[int | None]:
    return {process.pid for process in multiprocessing.active_children() if process.name == "geoderm-hand"}


def next_frame(camera: SimulatedHandCamera, after: int = 0) -> LiveFrame:
    frame = camera.latest(after, 60.0)
    assert frame is not None
    return frame


def test_it_is_in_the_list_and_opens_by_its_name() -> None:
    (info,) = list_devices("simulator-hand")
    assert info.live
    assert info.name == "Simulated hand (young man)"
    with open_device(info.id) as camera:
        assert isinstance(camera, LiveCamera)
        assert camera.state is LiveState.STREAMING
        assert camera.profile is None
    assert camera.state is LiveState.CLOSED


def test_depth_and_picture_show_the_hand_where_the_truth_says(camera: SimulatedHandCamera) -> None:
    frame = next_frame(camera)
    truth = camera.truth(frame.number)
    assert truth is not None
    assert frame.depth is not None
    assert frame.rgb is not None
    assert frame.depth.shape == (480, 640)
    assert frame.rgb.shape == (480, 640, 3)
    seen = [name for name in POINT_NAMES if truth.visible[name]]
    points = np.array([truth.points_m[name] for name in seen])
    u, v = np.rint(camera.rig.depth.project(points)).astype(int).T
    measured = frame.depth[v, u] * frame.depth_unit_m
    known = measured > 0
    assert known.mean() > 0.5
    assert np.median(np.abs(measured[known] - points[known, 2])) < 0.006


def test_frames_come_at_the_cameras_rate_each_with_noise_of_its_own(camera: SimulatedHandCamera) -> None:
    first = next_frame(camera)
    begun, numbers, noise = time.monotonic(), [first.number], []
    last = first
    for _ in range(12):
        frame = next_frame(camera, last.number)
        numbers.append(frame.number)
        assert frame.depth is not None
        assert last.depth is not None
        noise.append(float((frame.depth != last.depth).mean()))
        last = frame
    per_second = 12 / (time.monotonic() - begun)
    assert numbers == sorted(set(numbers))
    assert per_second > 10  # 30 on a machine with nothing else to do
    assert max(noise) > 0.1


def test_the_same_frame_is_handed_out_again_as_a_copy(camera: SimulatedHandCamera) -> None:
    frame = next_frame(camera)
    assert camera.latest(frame.number + 1000, 0.0) is None
    assert frame.rgb is not None
    frame.rgb[:] = 0
    other = next_frame(camera)
    assert other.rgb is not None
    assert other.rgb.mean() > 50


def test_streams_that_were_not_asked_for_do_not_come(camera: SimulatedHandCamera) -> None:
    camera.start(("color",))
    try:
        frame = next_frame(camera)
        assert frame.depth is None
        assert frame.rgb is not None
        with pytest.raises(WorkError, match="no depth"):
            camera.capture(1)
        with pytest.raises(WorkError, match="infrared"):
            camera.start(("infrared",))
    finally:
        camera.start()


def test_a_burst_is_a_capture_of_this_sensor(camera: SimulatedHandCamera) -> None:
    capture = camera.capture(2)
    assert capture.depth_frames.shape == (2, 480, 640)
    assert capture.sensor == "kinect-v1"
    assert capture.color is not None


def test_a_closed_camera_says_so_and_its_process_is_gone() -> None:
    camera = SimulatedHandCamera(LoopPlan(Holder(), seconds=1.0))
    before = drawing()
    with pytest.raises(WorkError, match="closed"):
        camera.latest()
    camera.open()
    assert drawing() == before  # nobody has looked yet
    camera.latest(0, 0.05)
    assert len(drawing() - before) == 1
    camera.close()
    assert drawing() <= before
    camera.close()
    assert camera.state is LiveState.CLOSED
    with pytest.raises(WorkError, match="closed"):
        camera.latest()


def test_a_loop_goes_to_its_end_and_back_while_it_grows() -> None:
    plan = LoopPlan(Holder(), seconds=1.0)
    rig = plan.rig()
    motion = hand_motion(plan.kind, plan.holder, plan.seconds)
    show = LoopShow(empty_room(plan))
    drawn = []
    for k in range(3):
        view, moment = view_at(motion, k / 30, plan.holder, rig)
        drawn.append(loop_frame(view, rig, moment.configuration, np.random.default_rng(k)))
        show.add(drawn[-1])
    order = []
    for _ in range(6):
        order.append(next(k for k, frame in enumerate(drawn) if frame.labels is show.labels))
        show.advance(1)
    assert order == [0, 1, 2, 1, 0, 1]
    takes = [show.depth() for _ in range(6)]
    assert any(not np.array_equal(takes[0], take) for take in takes[1:])


def test_an_address_tells_what_is_shown() -> None:
    camera = SIMULATED_HANDS.create("child10?side=L&seed=4&kind=bottle&seconds=2&marker_m=0.03")
    assert camera.info.id == "simulator-hand:child10?side=L&seed=4&kind=bottle&seconds=2&marker_m=0.03"
    assert SIMULATED_HANDS.create("").info.id == "simulator-hand:m_young_avg"


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("nobody", "no simulated body"),
        ("m_young_avg?side=X", "R or L"),
        ("m_young_avg?kind=dance", "no simulated sequence"),
        ("m_young_avg?configurations=hug", "no configuration 'hug'"),
        ("m_young_avg?seconds=900", "1 to 20"),
        ("m_young_avg?seconds=nan", "1 to 20"),
        ("m_young_avg?seed=x", "not a number for 'seed'"),
        ("m_young_avg?colour=red", "no option 'colour'"),
        ("m_young_avg?dictionary=DICT_9", "no ArUco dictionary"),
    ],
)
def test_a_wrong_address_is_named(address: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        SIMULATED_HANDS.create(address)
