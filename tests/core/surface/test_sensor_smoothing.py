"""How much a depth image is smoothed follows the sensor that the capture names."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.capture import RgbdCapture
from core.capture.sensors import sensor_model
from core.surface import scan_body
from devices.simulator.sensor import FrameMaker, SensorView


@pytest.fixture(scope="module")
def capture(make_scene: Any, make_person: Any) -> RgbdCapture:
    return make_scene(make_person()).capture(frames=4)


def test_a_capture_that_names_no_sensor_is_treated_as_a_kinects(capture: RgbdCapture) -> None:
    plain, named = scan_body(capture), scan_body(replace(capture, sensor="kinect-v1"))
    np.testing.assert_array_equal(plain.surface.vertices, named.surface.vertices)
    assert plain.warnings == named.warnings == ()


def test_a_sensor_that_nobody_knows_is_said(capture: RgbdCapture) -> None:
    strange = scan_body(replace(capture, sensor="azure-kinect"))
    assert any("'azure-kinect' is not known" in w and "Kinect v1" in w for w in strange.warnings)
    np.testing.assert_array_equal(strange.surface.vertices, scan_body(capture).surface.vertices)


def test_the_bumps_of_stereo_are_smoothed_away(make_scene: Any, make_person: Any, room: Any) -> None:
    plain = make_scene(make_person(), room).capture(frames=1)
    truth, _ = make_scene(make_person(), room).true_depth()
    camera = plain.rig.depth
    sensor = sensor_model("realsense-d4xx").scaled(camera.fx / 424.0)
    sensor = replace(sensor, depth_camera=camera)
    depth = np.where(truth > 0, truth, np.inf).astype(np.float32)
    view = SensorView(depth, np.ones(depth.shape, np.float32), np.zeros(depth.shape, bool))
    maker = FrameMaker(sensor, view, 0, np.random.default_rng(1))
    frames = np.stack([maker.frame(depth) for _ in range(8)])
    error, tilt = {}, {}
    for name in ("realsense-d4xx", "kinect-v1"):
        surface = scan_body(replace(plain, depth_frames=frames, sensor=name)).surface
        u, v = surface.pixels.T
        inner = ~surface.boundary
        error[name] = np.median(np.abs(surface.vertices[:, 2] - truth[v, u])[inner])
        tilt[name] = np.median(-surface.normals[inner, 2])
    assert error["realsense-d4xx"] < 0.95 * error["kinect-v1"]
    assert tilt["realsense-d4xx"] > tilt["kinect-v1"] + 0.02
