"""Frames in shared memory, and the camera's clock on this computer's."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from devices.openni.clock import DeviceClock
from devices.openni.ring import SLOTS, FrameRing, RingLayout

LAYOUT = RingLayout({"depth": ((40, 50), "uint16"), "color": ((30, 20, 3), "uint8")}, 0.001, before=7)


@pytest.fixture
def ends() -> Iterator[tuple[FrameRing, FrameRing]]:
    writer = FrameRing.create(LAYOUT)
    reader = FrameRing.attach(LAYOUT, writer.name)
    yield writer, reader
    reader.close()
    writer.close()


def put(ring: FrameRing, value: int) -> None:
    ring.put("depth", np.full((40, 50), value, np.uint16), value / 30)
    ring.publish()


def test_the_newest_frame_is_there_with_the_picture_beside_it(ends: tuple[FrameRing, FrameRing]) -> None:
    writer, reader = ends
    assert reader.read(0) is None
    writer.put("color", np.full((30, 20, 3), 9, np.uint8), 0.5)
    for value in (100, 101):
        put(writer, value)
    frame = reader.read(0)
    assert frame is not None
    assert frame.number == 9  # numbers go on after those before the ring
    assert frame.depth is not None
    assert frame.rgb is not None
    assert (frame.depth == 101).all()
    assert (frame.rgb == 9).all()
    assert (frame.time_s, frame.color_time_s) == (101 / 30, 0.5)
    assert reader.read(frame.number) is None


def test_a_frame_belongs_to_the_receiver(ends: tuple[FrameRing, FrameRing]) -> None:
    writer, reader = ends
    put(writer, 100)
    frame = reader.read(0)
    for value in range(101, 101 + 2 * SLOTS):
        put(writer, value)
    assert frame is not None
    assert frame.depth is not None
    assert (frame.depth == 100).all()


def test_a_reader_never_sees_half_a_frame(ends: tuple[FrameRing, FrameRing]) -> None:
    writer, reader = ends
    stop = threading.Event()

    def write() -> None:
        value = 0
        while not stop.is_set():
            value = value % 60000 + 1
            put(writer, value)
            stop.wait(0.0005)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        number, seen = 0, 0
        while seen < 200:
            frame = reader.read(number)
            if frame is None:
                continue
            assert frame.depth is not None
            assert (frame.depth == frame.depth[0, 0]).all()
            assert frame.time_s == pytest.approx(int(frame.depth[0, 0]) / 30)
            assert frame.number > number
            number, seen = frame.number, seen + 1
    finally:
        stop.set()
        thread.join()


def test_a_depth_frame_whose_picture_is_long_overwritten_comes_without_it(
    ends: tuple[FrameRing, FrameRing],
) -> None:
    writer, reader = ends
    writer.put("color", np.zeros((30, 20, 3), np.uint8), 0.1)
    put(writer, 100)
    for _ in range(SLOTS):
        writer.put("color", np.ones((30, 20, 3), np.uint8), 0.2)
    frame = reader.read(0)
    assert frame is not None
    assert frame.depth is not None
    assert frame.rgb is None


def test_the_cameras_clock_is_found_in_spite_of_late_frames() -> None:
    rng = np.random.default_rng(4)
    clock = DeviceClock()
    errors = []
    for i in range(300):
        made = 1000.0 + i / 30
        arrived = made + 0.004 + rng.exponential(0.02)
        errors.append(clock.at(made - 950.0, arrived) - made)
    assert 0.004 <= np.median(errors[30:]) < 0.006
    assert np.ptp(errors[100:]) < 0.003


def test_the_clock_follows_a_drift_and_a_new_start() -> None:
    clock = DeviceClock(window=100)
    for i in range(3000):
        made = 10.0 + i / 30
        last = clock.at((made - 10.0) * (1 + 50e-6), made + 0.003) - made
    assert abs(last - 0.003) < 0.001
    assert clock.at(0.01, 500.003) == pytest.approx(500.003)
