"""The software device as a camera in a process of its own, with faults."""

from __future__ import annotations

import os
import threading
import time
from dataclasses import dataclass
from typing import Any

import pyrealsense2 as rs

from devices.realsense.source import RealSenseSource
from tests.devices.realsense.software_device import FPS, SoftwareCamera


@dataclass
class SoftwareSource(RealSenseSource):
    """Feeds the software device in real time; the word says what goes wrong after a second."""

    fault: str = ""
    color_model: str = "brown_conrady"
    own_clock: bool = False

    def find_device(self) -> Any:
        if self.fault == "absent":
            return super().find_device()
        self._camera = SoftwareCamera(self.color_model)
        self._faulty = False
        threading.Thread(target=self._feed, daemon=True).start()
        return self._camera.device

    def is_connected(self) -> bool:
        return super().is_connected() and not (self._faulty and self.fault == "unplugged")

    def read(self, wanted: bool = True) -> Any:
        if self._faulty and self.fault == "hangs":
            time.sleep(3600)
        return super().read(wanted)

    def _feed(self) -> None:
        domain = rs.timestamp_domain.hardware_clock if self.own_clock else rs.timestamp_domain.system_time
        started = time.monotonic()
        for number in range(1, 10**6):
            time.sleep(max(0.0, started + number / FPS - time.monotonic()))
            if self.fault and number > 20:
                self._faulty = True
                if self.fault == "crashes":
                    os.abort()
                if self.fault in ("stalls", "unplugged"):
                    continue
            stamp_ms = 1000.0 * number / FPS if self.own_clock else time.time() * 1000.0
            self._camera.feed(number, stamp_ms, domain)
