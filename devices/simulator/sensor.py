"""Noise of a depth sensor: what turns true depth into raw frames.

The figures are those of a `core.capture.sensors.SensorModel`: axial and sideways noise, range, and pixels
that drop out at grazing angles, at silhouettes and in the shadow between two lenses. What only one principle
of measuring gets wrong is in `devices.simulator.sensor_principles`.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.sensors import SensorModel
from devices.simulator.sensor_principles import (
    JUMP_M,
    correlated_noise,
    device_ripple,
    jumps,
    principle_maker,
)
from devices.simulator.sensor_view import FAR_M, SensorView

__all__ = ["DEPTH_UNIT_M", "FrameMaker", "SensorView", "device_ripple"]

Image = NDArray[np.float32]

DEPTH_UNIT_M = 0.001
_NEAREST_M = 0.2
_SPECKLE_PX = 1.0


class FrameMaker:
    """Makes raw depth frames of one device in one capture.

    Parameters
    ----------
    sensor : SensorModel
    view : SensorView
    device_seed : int
        Which device: fixes what all its captures get wrong alike.
    rng : Generator
    """

    def __init__(
        self, sensor: SensorModel, view: SensorView, device_seed: int, rng: np.random.Generator
    ) -> None:
        self._sensor, self._rng = sensor, rng
        self._principle = principle_maker(sensor, view, device_seed, rng)
        self._shadow = view.shadow
        incidence = np.arccos(np.clip(view.cosine, 1e-3, 1.0)).astype(np.float32)
        lost = sensor.dropout
        steep = (np.rad2deg(incidence) - lost.grazing_deg) / (lost.lost_deg - lost.grazing_deg)
        self._grazing = np.clip(steep, 0.0, 1.0).astype(np.float32)
        total = sensor.axial_sigma(np.minimum(view.depth_m, FAR_M), incidence)
        step = sensor.quantisation_step(np.minimum(view.depth_m, FAR_M))
        self._sigma = np.sqrt(np.maximum(total**2 - step**2 / 12.0, (0.3 * total) ** 2))
        if self._principle.noise is not None:
            self._sigma = self._sigma * self._principle.noise
        h, w = sensor.depth_camera.height, sensor.depth_camera.width
        self._u, self._v = np.meshgrid(np.arange(w, dtype=np.float32), np.arange(h, dtype=np.float32))

    def frame(self, true_depth_m: Image) -> NDArray[np.uint16]:
        """One raw frame in `DEPTH_UNIT_M`, 0 for no measurement, of true depth (h, w), inf for nothing."""
        s, rng = self._sensor, self._rng
        z = self._principle.seen(np.minimum(true_depth_m, FAR_M))
        shape = (z.shape[0], z.shape[1])
        u = self._u + s.lateral_px * correlated_noise(rng, shape, _SPECKLE_PX)
        v = self._v + s.lateral_px * correlated_noise(rng, shape, _SPECKLE_PX)
        nearest = cv2.remap(z, u, v, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
        smooth = cv2.remap(z, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        z_seen = np.where(np.abs(smooth - nearest) < JUMP_M, smooth, nearest)
        grain = s.grain.white * rng.standard_normal(shape, dtype=np.float32)
        grain = grain + s.grain.correlated * correlated_noise(rng, shape, s.grain.window_px)
        noisy = np.maximum(z_seen + self._sigma * grain, _NEAREST_M)
        measured = self._principle.measured(noisy)
        chance = rng.random(shape, dtype=np.float32)
        lost = (chance < self._grazing) | (jumps(z) & (chance < s.dropout.silhouette))
        lost |= (chance < s.dropout.random) | self._shadow
        lost |= (measured > s.far_m) | (measured < s.near_m) | (nearest >= FAR_M)
        return np.where(lost, 0, np.rint(measured / DEPTH_UNIT_M)).astype(np.uint16)
