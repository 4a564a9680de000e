"""The library's own software device, fed with known frames, and recordings that the library writes of it.

Run with a path it records one. Since 2.56 the library writes ``.db3``; ``software_camera.bag`` was written by
its version 2.55.1 in this way.
"""

from __future__ import annotations

import gc
import sys
import time
from typing import Any

import numpy as np
import pyrealsense2 as rs

DEPTH_SIZE = (160, 120)
COLOR_SIZE = (320, 180)
FPS = 30
SERIAL = "000000000042"
TRANSLATION = (0.015, 0.0001, -0.0002)
ANGLE = 0.02
TRUE_UNIT_M = 0.0005


def intrinsics(size: tuple[int, int], focal: float, model: Any, coefficients: list[float]) -> Any:
    i = rs.intrinsics()
    i.width, i.height = size
    i.ppx, i.ppy, i.fx, i.fy = size[0] / 2 - 1.5, size[1] / 2 + 2.25, focal, focal + 1
    i.model, i.coeffs = model, coefficients
    return i


class SoftwareCamera:
    """Depth and infrared on one sensor, colour on another, as a D435 has them."""

    def __init__(self, color_model: str = "brown_conrady") -> None:
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "Software RealSense")
        self.device.register_info(rs.camera_info.serial_number, SERIAL)
        self.stereo = self.device.add_sensor("Stereo Module")
        self.color = self.device.add_sensor("RGB Camera")
        straight = intrinsics(DEPTH_SIZE, 150.0, rs.distortion.brown_conrady, [0.0] * 5)
        lens = intrinsics(
            COLOR_SIZE, 250.0, getattr(rs.distortion, color_model), [0.05, -0.08, 0.001, 0.002, 0.01]
        )
        self.profiles = {
            "depth": self._add(self.stereo, rs.stream.depth, 0, DEPTH_SIZE, 2, rs.format.z16, straight),
            "infrared": self._add(self.stereo, rs.stream.infrared, 1, DEPTH_SIZE, 1, rs.format.y8, straight),
            "color": self._add(self.color, rs.stream.color, 2, COLOR_SIZE, 3, rs.format.rgb8, lens),
        }
        self.stereo.add_read_only_option(rs.option.depth_units, TRUE_UNIT_M)
        for sensor, option, least, most, value in (
            (self.stereo, rs.option.enable_auto_exposure, 0, 1, 1),
            (self.stereo, rs.option.exposure, 1, 165000, 8500),
            (self.stereo, rs.option.emitter_enabled, 0, 1, 1),
            (self.color, rs.option.enable_auto_exposure, 0, 1, 1),
            (self.color, rs.option.exposure, 1, 10000, 156),
            (self.color, rs.option.enable_auto_white_balance, 0, 1, 1),
            (self.color, rs.option.white_balance, 2800, 6500, 4600),
        ):
            span = rs.option_range()
            span.min, span.max, span.step, span.default = least, most, 1, value
            sensor.add_option(option, span, True)
        pose = rs.extrinsics()
        c, s = float(np.cos(ANGLE)), float(np.sin(ANGLE))
        # By columns: a turn about y, x to the right.
        pose.rotation = [c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c]
        pose.translation = list(TRANSLATION)
        self.profiles["depth"].register_extrinsics_to(self.profiles["color"], pose)

    def _add(
        self, sensor: Any, kind: Any, uid: int, size: tuple[int, int], bpp: int, pixel: Any, lens: Any
    ) -> Any:
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid = kind, 0, uid
        stream.width, stream.height, stream.fps, stream.bpp, stream.fmt = *size, FPS, bpp, pixel
        stream.intrinsics = lens
        return sensor.add_video_stream(stream)

    def feed(self, number: int, stamp_ms: float, domain: Any) -> None:
        """One moment: depth of a wall 2 m away plus ``number``, colour with ``number`` in its first pixel."""
        w, h = DEPTH_SIZE
        depth = np.full((h, w), 4000 + number, np.uint16)
        depth[:10] = 0
        infrared = np.full((h, w), number % 256, np.uint8)
        color = np.zeros((COLOR_SIZE[1], COLOR_SIZE[0], 3), np.uint8)
        color[..., 0], color[0, 0, 1] = 200, number % 256
        for sensor, kind, pixels in (
            (self.color, "color", color),
            (self.stereo, "infrared", infrared),
            (self.stereo, "depth", depth),
        ):
            frame = rs.software_video_frame()
            frame.pixels, frame.stride, frame.bpp = pixels, pixels.strides[0], pixels.strides[1]
            frame.timestamp, frame.domain, frame.frame_number = stamp_ms, domain, number
            frame.profile = self.profiles[kind].as_video_stream_profile()
            frame.depth_units = TRUE_UNIT_M
            sensor.on_video_frame(frame)


def record(path: str, frames: int, wall_clock_s: float = 1_790_000_000.0) -> None:
    """Let the library's own recorder write what the software device delivers."""
    camera = SoftwareCamera()
    recorder = rs.recorder(path, camera.device)
    sensors = recorder.query_sensors()
    for sensor in sensors:
        sensor.open(sensor.get_stream_profiles())
        sensor.start(lambda frame: None)
    for number in range(1, frames + 1):
        camera.feed(number, 1000.0 * (wall_clock_s + number / FPS), rs.timestamp_domain.system_time)
        time.sleep(0.01)
    time.sleep(0.3)
    for sensor in sensors:
        sensor.stop()
        sensor.close()


if __name__ == "__main__":
    record(sys.argv[1], 12)
    # The recorder writes the index of a .bag when it is let go of.
    gc.collect()
    time.sleep(0.5)
