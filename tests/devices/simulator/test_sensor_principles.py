"""Frames of every sensor show the noise that its data states, and the shadow and errors of its principle."""

from __future__ import annotations

import numpy as np
import pytest

from core.capture.sensors import MatchingError, PhaseError, sensor_model
from devices.simulator import STILL, SimulatedPatient, make_rig
from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker, SensorView

SENSORS = ("kinect-v1", "kinect-v2", "realsense-d4xx")
SHARE = 0.5
PLACES = [(1.0, 0.0), (1.7, 30.0), (2.4, 0.0), (2.4, 55.0), (3.4, 40.0)]


def flat_frames(name: str, z_m: float, count: int, *, angle_deg: float = 0.0, seed: int = 0) -> np.ndarray:
    """Frames (n, h, w) in metres of a wall that is everywhere at one depth; NaN where nothing is measured."""
    sensor = sensor_model(name).scaled(SHARE)
    shape = (sensor.depth_camera.height, sensor.depth_camera.width)
    depth = np.full(shape, z_m, np.float32)
    cosine = np.full(shape, np.cos(np.deg2rad(angle_deg)), np.float32)
    view = SensorView(depth, cosine, np.zeros(shape, bool))
    maker = FrameMaker(sensor, view, 0, np.random.default_rng(seed))
    frames = np.stack([maker.frame(depth) for _ in range(count)]) * DEPTH_UNIT_M
    return np.where(frames > 0, frames, np.nan)[:, 8:-8, 8:-8]


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize(
    ("z_m", "angle_deg"), [(1.0, 0.0), (1.7, 30.0), (2.4, 0.0), (2.4, 55.0), (3.4, 40.0)]
)
def test_what_changes_from_frame_to_frame_is_the_axial_noise(name: str, z_m: float, angle_deg: float) -> None:
    frames = flat_frames(name, z_m, 8, angle_deg=angle_deg)
    measured = np.sqrt(np.nanmean(np.nanvar(frames, axis=0, ddof=1)))
    stated = float(sensor_model(name).axial_sigma(z_m, np.deg2rad(angle_deg)))
    assert measured == pytest.approx(stated, rel=0.2)


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("z_m", [1.2, 2.3])
def test_what_no_averaging_removes_is_the_systematic_error(name: str, z_m: float) -> None:
    found = []
    for seed in range(3):
        error = np.nanmean(flat_frames(name, z_m, 12, seed=seed), axis=0) - z_m
        noise = float(sensor_model(name).axial_sigma(z_m)) ** 2 / 12
        found.append(np.nanmean(error**2) - noise)
    stated = float(sensor_model(name).systematic_sigma(z_m))
    wrong = sensor_model(name).systematic
    if isinstance(wrong, PhaseError):
        stated = float(np.sqrt(stated**2 - wrong.offset_m**2))  # a wall is no skin
        assert float(np.sqrt(np.mean(found))) < 2.0 * stated  # the phase of the wiggle decides at one depth
    else:
        assert float(np.sqrt(np.mean(found))) == pytest.approx(stated, rel=0.3)


def test_stereo_errs_alike_in_all_frames_of_a_capture_and_anew_in_the_next() -> None:
    one, two = (np.nanmean(flat_frames("realsense-d4xx", 2.3, 6, seed=s), axis=0) - 2.3 for s in (0, 1))
    single = flat_frames("realsense-d4xx", 2.3, 1, seed=0)[0] - 2.3
    good = np.isfinite(one) & np.isfinite(two) & np.isfinite(single)
    assert np.corrcoef(one[good], single[good])[0, 1] > 0.7
    assert abs(np.corrcoef(one[good], two[good])[0, 1]) < 0.3


@pytest.mark.parametrize("name", SENSORS)
def test_nothing_is_measured_outside_the_range(name: str) -> None:
    sensor = sensor_model(name)
    assert np.isnan(flat_frames(name, 0.7 * sensor.near_m, 1)).mean() > 0.95
    assert np.isnan(flat_frames(name, 1.3 * sensor.far_m, 1)).mean() > 0.95
    assert np.isnan(flat_frames(name, 2.0, 1)).mean() < 0.01


def edge_frame(name: str, *, near_m: float = 1.5, far_m: float = 2.5) -> tuple[np.ndarray, int]:
    """Mean of some frames (h, w) in metres, 0 for none, of a slab before a wall, and its left column."""
    sensor = sensor_model(name).scaled(SHARE)
    h, w = sensor.depth_camera.height, sensor.depth_camera.width
    depth = np.full((h, w), far_m, np.float32)
    left = w // 3
    depth[:, left : 2 * w // 3] = near_m
    view = SensorView(depth, np.ones((h, w), np.float32), np.zeros((h, w), bool))
    return FrameMaker(sensor, view, 0, np.random.default_rng(2)).frame(depth) * DEPTH_UNIT_M, left


def test_time_of_flight_mixes_near_and_far_at_edges_and_the_others_do_not() -> None:
    between = {}
    for name in SENSORS:
        frame, left = edge_frame(name)
        strip = frame[:, left - 3 : left + 3]
        between[name] = float(((strip > 1.75) & (strip < 2.25)).mean())
    assert between["kinect-v2"] > 0.03
    assert max(between["kinect-v1"], between["realsense-d4xx"]) < 0.002


def test_stereo_makes_near_things_grow() -> None:
    grown = {}
    for name in SENSORS:
        frame, left = edge_frame(name)
        outside = frame[:, left - 1]
        grown[name] = float((outside[outside > 0] < 1.8).mean())
    wrong = sensor_model("realsense-d4xx").scaled(SHARE).systematic
    assert isinstance(wrong, MatchingError)
    assert grown["realsense-d4xx"] > 0.9
    assert grown["kinect-v1"] < 0.5


def test_hollows_look_deeper_to_time_of_flight() -> None:
    sensor = sensor_model("kinect-v2").scaled(SHARE)
    h, w = sensor.depth_camera.height, sensor.depth_camera.width
    depth = np.full((h, w), 2.0, np.float32)
    groove = np.abs(np.arange(w) - w // 2) < 6
    depth[:, groove] += 0.08
    view = SensorView(depth, np.ones((h, w), np.float32), np.zeros((h, w), bool))
    maker = FrameMaker(sensor, view, 0, np.random.default_rng(0))
    flat = FrameMaker(
        sensor, SensorView(np.full_like(depth, 2.08), view.cosine, view.shadow), 0, np.random.default_rng(0)
    )
    inner = np.abs(np.arange(w) - w // 2) < 3
    seen, plain = (
        np.mean([m.frame(d) for _ in range(6)], axis=0) for m, d in ((maker, depth), (flat, depth))
    )
    deeper = (seen - plain)[8:-8][:, inner].mean() * DEPTH_UNIT_M
    assert 0.003 < deeper < 0.008


@pytest.fixture(scope="module")
def captures() -> dict[str, np.ndarray]:
    out = {}
    for name in SENSORS:
        patient = SimulatedPatient(
            seed=3, moles=4, lesions=1, freckles=0, variation=STILL, rig=make_rig((160, 120), sensor=name)
        )
        made = patient.capture("A", frames=4, distance_m=2.6)
        assert made.capture.sensor == name
        assert made.capture.rig.depth == sensor_model(name).depth_camera
        out[name] = made.capture.depth_frames
    return out


def blind_beside(frames: np.ndarray, side: str) -> float:
    """Mean number of pixels of a row, beside one side of the body, that no frame measured."""
    z = frames.max(axis=0) * DEPTH_UNIT_M
    count = []
    for row in range(int(0.36 * z.shape[0]), int(0.40 * z.shape[0])):
        body = np.flatnonzero((z[row] > 1.5) & (z[row] < 3.0))
        line = z[row, body.min() - 12 : body.min()] if side == "left" else z[row, body.max() + 1 :][:12]
        count.append(int((line == 0).sum()))
    return float(np.mean(count))


def test_the_shadow_lies_on_the_side_away_from_the_second_lens(captures: dict[str, np.ndarray]) -> None:
    for name in ("kinect-v1", "realsense-d4xx"):
        sensor = sensor_model(name)
        width = sensor.depth_camera.fx * sensor.baseline_m * (1 / 2.55 - 1 / 3.6)
        left, right = (blind_beside(captures[name], side) for side in ("left", "right"))
        assert left - right == pytest.approx(width, abs=0.5 * width)
    left, right = (blind_beside(captures["kinect-v2"], side) for side in ("left", "right"))
    assert abs(left - right) < 1.0


def test_an_unknown_sensor_is_no_rig() -> None:
    from core.errors import InputError

    with pytest.raises(InputError, match="no sensor 'sonar'"):
        make_rig(sensor="sonar")


@pytest.mark.parametrize(("name", "size"), [("kinect-v2", (1920, 1080)), ("realsense-d4xx", (1920, 1080))])
def test_the_sensors_own_colour_camera_stands_as_made(name: str, size: tuple[int, int]) -> None:
    rig = make_rig(size, sensor=name)
    assert rig.color == sensor_model(name).color_camera
    np.testing.assert_array_equal(
        rig.color_from_depth.translation, sensor_model(name).color_from_depth.translation
    )
