"""Noise of the virtual Kinect against the published model."""

from __future__ import annotations

import numpy as np
import pytest

from core.capture.sensors import sensor_model
from devices.simulator.sensor import DEPTH_UNIT_M, FrameMaker, SensorView, device_ripple

SENSOR = sensor_model("kinect-v1")
SHAPE = (480, 640)


def _flat_frames(
    z_m: float, count: int, *, device: int = 0, seed: int = 0, angle_deg: float = 0.0
) -> np.ndarray:
    depth = np.full(SHAPE, z_m, np.float32)
    cosine = np.full(SHAPE, np.cos(np.deg2rad(angle_deg)), np.float32)
    maker = FrameMaker(
        SENSOR, SensorView(depth, cosine, np.zeros(SHAPE, bool)), device, np.random.default_rng(seed)
    )
    frames = np.stack([maker.frame(depth) for _ in range(count)]) * DEPTH_UNIT_M
    return np.where(frames > 0, frames, np.nan)[:, 8:-8, 8:-8]


@pytest.mark.parametrize("z_m", [1.0, 1.6, 2.3, 3.2])
def test_axial_noise_follows_the_model_over_distance(z_m: float) -> None:
    frames = _flat_frames(z_m, 12)
    spread = np.sqrt(np.nanmean(np.nanvar(frames, axis=0, ddof=1)))
    assert spread == pytest.approx(0.0012 + 0.0019 * (z_m - 0.4) ** 2, rel=0.2)


def test_noise_grows_with_the_angle() -> None:
    straight, slanted = (np.nanstd(_flat_frames(1.0, 4, angle_deg=a)) for a in (0.0, 65.0))
    assert slanted > 1.15 * straight


def test_grazing_surfaces_are_lost() -> None:
    assert np.isnan(_flat_frames(2.0, 1, angle_deg=80.0)).mean() > 0.5
    assert np.isnan(_flat_frames(2.0, 1, angle_deg=30.0)).mean() < 0.01


def test_depth_values_are_quantised_in_disparity() -> None:
    values = np.unique(_flat_frames(2.3, 2))
    step = 2.3**2 / (SENSOR.depth_camera.fx * SENSOR.baseline_m) * SENSOR.disparity_step_px
    assert np.median(np.diff(values[~np.isnan(values)])) == pytest.approx(step, rel=0.15)


def test_the_devices_ripple_does_not_average_out() -> None:
    z = 2.3
    error = np.nanmean(_flat_frames(z, 30), axis=0) - z
    expected = -device_ripple(SENSOR, 0)[8:-8, 8:-8] * z**2 / (SENSOR.depth_camera.fx * SENSOR.baseline_m)
    assert np.corrcoef(error.ravel(), expected.ravel())[0, 1] > 0.8
    assert 0.001 < expected.std() < 0.008


def test_every_device_has_its_own_ripple() -> None:
    one, other = device_ripple(SENSOR, 1), device_ripple(SENSOR, 2)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.6
    assert (one == device_ripple(SENSOR, 1)).all()


def test_the_projectors_shadow_and_nothing_at_all_are_no_measurement() -> None:
    depth = np.full(SHAPE, 2.0, np.float32)
    depth[:, 320:] = np.inf
    shadow = np.zeros(SHAPE, bool)
    shadow[100:200, 100:200] = True
    view = SensorView(depth, np.ones(SHAPE, np.float32), shadow)
    frame = FrameMaker(SENSOR, view, 0, np.random.default_rng(1)).frame(depth)
    assert (frame[100:200, 100:200] == 0).all()
    assert (frame[:, 330:] == 0).all()
    assert (frame[:90, :310] > 0).mean() > 0.99


def test_silhouettes_lose_pixels() -> None:
    depth = np.full(SHAPE, 3.0, np.float32)
    depth[:, 300:340] = 2.0
    view = SensorView(depth, np.ones(SHAPE, np.float32), np.zeros(SHAPE, bool))
    frame = FrameMaker(SENSOR, view, 0, np.random.default_rng(1)).frame(depth)
    assert (frame[:, 299:301] == 0).mean() > 0.25
    assert (frame[:, 318:322] == 0).mean() < 0.02
