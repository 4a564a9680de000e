"""Noise of a structured-light depth camera (Kinect v1): what turns true depth into raw frames.

Axial noise follows Nguyen, Izadi and Lovell (3DIMPVT 2012); the range is quantised in disparity (1/8
pixel), pixels drop out at grazing angles, at silhouettes and in the projector's shadow, and every device
carries a fixed calibration ripple that no averaging over frames removes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera

Image = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

DEPTH_UNIT_M = 0.001
_FAR = np.float32(20.0)
KINECT_DEPTH = PinholeCamera(640, 480, 575.816, 575.816, 319.5, 239.5)


@dataclass(frozen=True)
class DepthSensor:
    """Parameters of the virtual depth camera.

    Attributes
    ----------
    camera : PinholeCamera
    baseline_m : float
        Projector to infrared camera; the projector stands at +x.
    disparity_step_px : float
        Quantisation of the disparity.
    lateral_px : float
        Standard deviation of the sideways uncertainty of a pixel.
    ripple_px : tuple of float
        RMS of the device's fixed disparity error, long waves and short waves. At distance z one pixel of
        disparity is z^2 / (f b) metres: 0.12 m at 2.3 m.
    near_m, far_m : float
        Range outside of which nothing is measured.
    """

    camera: PinholeCamera = KINECT_DEPTH
    baseline_m: float = 0.075
    disparity_step_px: float = 0.125
    lateral_px: float = 0.8
    ripple_px: tuple[float, float] = (0.025, 0.015)
    near_m: float = 0.45
    far_m: float = 8.0

    def axial_sigma(self, z_m: NDArray[np.floating], incidence_rad: NDArray[np.floating] | float) -> Image:
        """Standard deviation of one depth reading in metres, quantisation included (Nguyen 2012, eq. 3)."""
        z = np.asarray(z_m, np.float32)
        angle = np.minimum(np.asarray(incidence_rad, np.float32), 1.5)
        tilted = 0.0001 / np.sqrt(np.maximum(z, 0.1)) * angle**2 / (np.pi / 2 - angle) ** 2
        return np.asarray(
            0.0012 + 0.0019 * (z - 0.4) ** 2 + np.where(angle > np.deg2rad(10), tilted, 0.0), np.float32
        )

    def quantisation_step(self, z_m: NDArray[np.floating]) -> Image:
        """Distance in metres between two neighbouring depth values."""
        z = np.asarray(z_m, np.float32)
        return np.asarray(z**2 * (self.disparity_step_px / (self.camera.fx * self.baseline_m)), np.float32)


@lru_cache(maxsize=8)
def device_ripple(sensor: DepthSensor, device_seed: int) -> Image:
    """Fixed disparity error (h, w) in pixels of one device: long waves, short waves and column bands."""
    rng = np.random.default_rng((0x51B, device_seed))
    h, w = sensor.camera.height, sensor.camera.width
    fields = []
    for sigma in (90.0, 14.0):
        field = cv2.GaussianBlur(rng.standard_normal((h, w)).astype(np.float32), (0, 0), sigma * w / 640)
        fields.append((field - field.mean()) / field.std())
    bands = np.cumsum(rng.choice((-1.0, 1.0), w // 32 + 1) * rng.uniform(0.2, 0.5, w // 32 + 1))
    bands = np.repeat(bands - bands.mean(), 32)[:w].astype(np.float32)
    long, short = sensor.ripple_px
    return np.asarray(long * fields[0] + short * (fields[1] + 0.5 * bands[None, :]), np.float32)


def _correlated_noise(rng: np.random.Generator, shape: tuple[int, int], sigma_px: float) -> Image:
    """Unit-variance noise with the grain of the speckle window."""
    white = rng.standard_normal(shape, dtype=np.float32)
    # variance of white noise after a Gaussian of this width: 1 / (4 pi sigma^2)
    return np.asarray(
        cv2.GaussianBlur(white, (0, 0), sigma_px) * (2.0 * np.sqrt(np.pi) * sigma_px), np.float32
    )


@dataclass(frozen=True, eq=False)
class SensorView:
    """What is the same in every frame of a capture.

    Attributes
    ----------
    depth_m : ndarray (h, w)
        True depth with the patient in the middle of the sway; the noise is set by it.
    cosine : ndarray (h, w)
        Of the angle between the surface normal and the line of sight.
    shadow : ndarray (h, w) bool
        Seen by the camera but not by the projector.
    """

    depth_m: Image
    cosine: Image
    shadow: BoolArray


class FrameMaker:
    """Makes raw depth frames of one device.

    Parameters
    ----------
    sensor : DepthSensor
    view : SensorView
    device_seed : int
        Which device: fixes the ripple.
    rng : Generator
    """

    def __init__(
        self, sensor: DepthSensor, view: SensorView, device_seed: int, rng: np.random.Generator
    ) -> None:
        self._sensor, self._rng = sensor, rng
        self._ripple = device_ripple(sensor, device_seed)
        self._shadow = view.shadow
        incidence = np.arccos(np.clip(view.cosine, 1e-3, 1.0)).astype(np.float32)
        self._grazing = np.clip((np.rad2deg(incidence) - 68.0) / 15.0, 0.0, 1.0).astype(np.float32)
        total = sensor.axial_sigma(np.minimum(view.depth_m, _FAR), incidence)
        step = sensor.quantisation_step(np.minimum(view.depth_m, _FAR))
        self._sigma = np.sqrt(np.maximum(total**2 - step**2 / 12.0, (0.3 * total) ** 2))
        h, w = sensor.camera.height, sensor.camera.width
        self._u, self._v = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))
        self._kernel = np.ones((3, 3), np.uint8)

    def frame(self, true_depth_m: Image) -> NDArray[np.uint16]:
        """One raw frame in `DEPTH_UNIT_M`, 0 for no measurement, of true depth (h, w), inf for nothing."""
        s, rng = self._sensor, self._rng
        z = np.minimum(true_depth_m, _FAR)
        shape = (z.shape[0], z.shape[1])
        u = self._u + s.lateral_px * _correlated_noise(rng, shape, 1.0)
        v = self._v + s.lateral_px * _correlated_noise(rng, shape, 1.0)
        nearest = cv2.remap(z, u, v, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        smooth = cv2.remap(z, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        z_seen = np.where(np.abs(smooth - nearest) < 0.05, smooth, nearest)
        grain = 0.6 * rng.standard_normal(shape, dtype=np.float32) + 0.8 * _correlated_noise(rng, shape, 1.2)
        noisy = np.maximum(z_seen + self._sigma * grain, 0.2)
        focal_baseline = s.camera.fx * s.baseline_m
        disparity = (
            np.rint((focal_baseline / noisy + self._ripple) / s.disparity_step_px) * s.disparity_step_px
        )
        measured = focal_baseline / np.maximum(disparity, s.disparity_step_px)
        jump = cv2.morphologyEx(z, cv2.MORPH_GRADIENT, self._kernel) > 0.05
        chance = rng.random(shape, dtype=np.float32)
        lost = (chance < self._grazing) | (jump & (chance < 0.45)) | (chance < 0.001) | self._shadow
        lost |= (measured > s.far_m) | (measured < s.near_m) | (nearest >= _FAR)
        return np.where(lost, 0, np.rint(measured / DEPTH_UNIT_M)).astype(np.uint16)
