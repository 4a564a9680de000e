"""What each principle of depth sensing gets wrong in a way of its own; one short class for each."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.sensors import MatchingError, PhaseError, Ripple, SensorModel
from devices.simulator.sensor_view import FAR_M, SensorView

Image = NDArray[np.float32]

JUMP_M = 0.05
"""Neighbouring depths that differ by more lie on different things."""
_BOUNCE_M, _HOLLOW_M = 0.06, 0.03
_KERNEL = np.ones((3, 3), np.uint8)


def correlated_noise(rng: np.random.Generator, shape: tuple[int, int], sigma_px: float) -> Image:
    """Unit-variance noise with the grain of a window."""
    white = rng.standard_normal(shape, dtype=np.float32)
    # variance of white noise after a Gaussian of this width: 1 / (4 pi sigma^2)
    return np.asarray(
        cv2.GaussianBlur(white, (0, 0), sigma_px) * (2.0 * np.sqrt(np.pi) * sigma_px), np.float32
    )


def jumps(z: Image) -> NDArray[np.bool_]:
    """Pixels (h, w) beside a depth jump."""
    return np.asarray(cv2.morphologyEx(z, cv2.MORPH_GRADIENT, _KERNEL) > JUMP_M)


@lru_cache(maxsize=16)
def long_waves(sensor: SensorModel, device_seed: int) -> Image:
    """Unit-variance field (h, w) of long waves that belongs to a device."""
    rng = np.random.default_rng((0x51C, device_seed))
    h, w = sensor.depth_camera.height, sensor.depth_camera.width
    field = cv2.GaussianBlur(rng.standard_normal((h, w)).astype(np.float32), (0, 0), 90.0 * w / 640)
    return np.asarray((field - field.mean()) / field.std(), np.float32)


@lru_cache(maxsize=8)
def device_ripple(sensor: SensorModel, device_seed: int) -> Image:
    """Fixed disparity error (h, w) in pixels of one device: long waves, short waves and column bands."""
    wrong = sensor.systematic
    assert isinstance(wrong, Ripple)
    rng = np.random.default_rng((0x51B, device_seed))
    h, w = sensor.depth_camera.height, sensor.depth_camera.width
    fields = []
    for sigma in (90.0, 14.0):
        field = cv2.GaussianBlur(rng.standard_normal((h, w)).astype(np.float32), (0, 0), sigma * w / 640)
        fields.append((field - field.mean()) / field.std())
    bands = np.cumsum(rng.choice((-1.0, 1.0), w // 32 + 1) * rng.uniform(0.2, 0.5, w // 32 + 1))
    bands = np.repeat(bands - bands.mean(), 32)[:w].astype(np.float32)
    return np.asarray(
        wrong.long_px * fields[0] + wrong.short_px * (fields[1] + 0.5 * bands[None, :]), np.float32
    )


def stepped_disparity(noisy: Image, error_px: Image, sensor: SensorModel) -> Image:
    """Depth (h, w) from a disparity with an error, in the sensor's steps."""
    assert sensor.disparity_step_px is not None
    focal_baseline = sensor.depth_camera.fx * sensor.baseline_m
    step = sensor.disparity_step_px
    disparity = np.rint((focal_baseline / noisy + error_px) / step) * step
    return np.asarray(focal_baseline / np.maximum(disparity, step))


class PrincipleMaker(Protocol):
    """What happens to depth before and after the noise that all sensors have."""

    noise: Image | None
    """Factor (h, w) of the noise; None: one everywhere."""

    def seen(self, z: Image) -> Image:
        """Depth (h, w) as the sensor's window or pixel sees it, from true depth."""

    def measured(self, noisy: Image) -> Image:
        """Depth (h, w) with the error that stays, in the sensor's steps."""


class StructuredLight:
    """A projected pattern and one camera: fixed ripple, steps of disparity."""

    noise: Image | None = None

    def __init__(
        self, sensor: SensorModel, view: SensorView, device_seed: int, rng: np.random.Generator
    ) -> None:
        self._sensor, self._ripple = sensor, device_ripple(sensor, device_seed)

    def seen(self, z: Image) -> Image:
        """True depth."""
        return z

    def measured(self, noisy: Image) -> Image:
        """Through the disparity."""
        return stepped_disparity(noisy, self._ripple, self._sensor)


class TimeOfFlight:
    """Modulated light: wiggling, detours of the light, and mixtures of near and far at edges."""

    noise: Image | None = None

    def __init__(
        self, sensor: SensorModel, view: SensorView, device_seed: int, rng: np.random.Generator
    ) -> None:
        wrong = sensor.systematic
        assert isinstance(wrong, PhaseError)
        self._wrong, self._step = wrong, sensor.depth_step_m
        shape = view.depth_m.shape
        phase = np.random.default_rng((0x70F, device_seed)).uniform(0, 2 * np.pi)
        self._phase = np.float32(phase) + 0.5 * long_waves(sensor, device_seed)
        self._fixed = wrong.pattern_m * long_waves(sensor, device_seed + 1)
        if view.skin is not None:
            self._fixed = self._fixed + np.where(view.skin, wrong.offset_m, 0.0)
        self._fixed = (self._fixed + wrong.corner_m * hollow(view.depth_m, sensor)).astype(np.float32)
        rays = sensor.depth_camera.pixel_rays
        self._stretch = np.linalg.norm(rays, axis=2).astype(np.float32)
        # Which share of a pixel's light comes from the near side does not change while nobody moves.
        self._flying = rng.random(shape, dtype=np.float32) < wrong.flying
        self._near_share = rng.random(shape, dtype=np.float32)

    def seen(self, z: Image) -> Image:
        """True depth, with mixtures of near and far at some pixels of an edge."""
        near, far = cv2.erode(z, _KERNEL), cv2.dilate(z, _KERNEL)
        mixed = self._flying & (far - near > JUMP_M) & (far < FAR_M)
        return np.where(mixed, self._near_share * near + (1 - self._near_share) * far, z).astype(np.float32)

    def measured(self, noisy: Image) -> Image:
        """With wiggling, detours and skin; in steps of depth."""
        wave = 2 * np.pi / self._wrong.period_m * noisy * self._stretch + self._phase
        depth = noisy + self._wrong.wiggle_m * np.sin(wave) + self._fixed
        return np.asarray(np.rint(depth / self._step) * self._step)


class Stereo:
    """Two cameras: matching windows err in the same way as long as nothing moves, and fatten edges."""

    def __init__(
        self, sensor: SensorModel, view: SensorView, device_seed: int, rng: np.random.Generator
    ) -> None:
        wrong = sensor.systematic
        assert isinstance(wrong, MatchingError)
        self._sensor = sensor
        h, w = view.depth_m.shape
        texture = np.exp(wrong.texture * correlated_noise(rng, (h, w), 8.0))
        # The mean square of a log-normal factor is taken out, so that the stated noise is the mean noise.
        self.noise: Image | None = (texture * np.exp(-(wrong.texture**2))).astype(np.float32)
        frozen = wrong.frozen_px * correlated_noise(rng, (h, w), wrong.window_px) * self.noise
        self._error = (frozen + wrong.long_px * long_waves(sensor, device_seed)).astype(np.float32)
        size = 2 * round(wrong.fatten_px) + 1
        self._window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))

    def seen(self, z: Image) -> Image:
        """The nearest depth in the window, where near and far lie side by side."""
        nearest = cv2.erode(z, self._window)
        return np.where(z - nearest > JUMP_M, nearest, z).astype(np.float32)

    def measured(self, noisy: Image) -> Image:
        """Through the disparity."""
        return stepped_disparity(noisy, self._error, self._sensor)


def hollow(z: Image, sensor: SensorModel) -> Image:
    """How concave (h, w) the surroundings of a few centimetres are, 0 to 1.

    A pixel that lies deeper than its neighbourhood on the same thing is lit by it: light bounces there.
    """
    known = (z < FAR_M).astype(np.float32)
    middle = float(np.median(z[z < FAR_M])) if known.any() else 1.0
    sigma = max(1.0, sensor.depth_camera.fx * _BOUNCE_M / middle)
    mean = cv2.GaussianBlur(np.where(known > 0, z, 0).astype(np.float32), (0, 0), sigma)
    weight = np.maximum(cv2.GaussianBlur(known, (0, 0), sigma), 1e-3)
    deeper = z - mean / weight
    same = np.abs(deeper) < 0.15
    return np.where(same & (known > 0), np.clip(deeper / _HOLLOW_M, 0.0, 1.0), 0.0).astype(np.float32)


def principle_maker(
    sensor: SensorModel, view: SensorView, device_seed: int, rng: np.random.Generator
) -> PrincipleMaker:
    """The maker of a sensor's principle, for one capture."""
    match sensor.systematic:
        case Ripple():
            return StructuredLight(sensor, view, device_seed, rng)
        case PhaseError():
            return TimeOfFlight(sensor, view, device_seed, rng)
        case MatchingError():
            return Stereo(sensor, view, device_seed, rng)
