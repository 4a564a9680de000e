"""A RealSense camera as its own process sees it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from core.errors import InputError, WorkError
from devices.camera_process.packets import Packet, SourceGone
from devices.realsense import library
from devices.realsense.controls import read_controls, write_control
from devices.realsense.frames import KINDS, FrameClock, kind_of, pixels_of
from devices.realsense.geometry import camera_facts

_WAIT_MS = 100
_LOOK_EVERY_S = 0.5
_QUEUE = 16
_WANTED = {
    "depth": ((848, 480, 30), (640, 480, 30), (1280, 720, 30)),
    "color": ((1920, 1080, 30), (1280, 720, 30), (640, 480, 30)),
    "infrared": ((848, 480, 30), (640, 480, 30), (1280, 720, 30)),
}
"""Width, height, frames/s, the best first. 848 x 480 is the depth resolution at which D4xx are most exact."""

_GONE = SourceGone("The RealSense camera was unplugged.", "Plug it in again, then choose it again.")


@dataclass
class RealSenseSource:
    """A connected camera.

    Attributes
    ----------
    serial : str
        Empty for the first one.
    """

    serial: str = ""

    def open(self) -> Mapping[str, Any]:
        """Find the camera and start depth and colour."""
        self._running: list[Any] = []  # first: `close` comes also after a camera that was not found
        self._rs = library.load()
        self._removed = False
        self._device = self.find_device()
        self._sensors = list(self._device.query_sensors())
        self._profiles = {
            kind: [p for s in self._sensors for p in s.get_stream_profiles() if kind_of(p) == kind]
            for kind in KINDS
        }
        self._chosen = {kind: self._best(kind) for kind in KINDS if self._profiles[kind]}
        self._queue = self._rs.frame_queue(_QUEUE, keep_frames=True)
        self._clock = FrameClock()
        self._looked_s = 0.0
        if "depth" not in self._chosen:
            raise WorkError("This RealSense camera has no depth stream.", "Choose another camera.")
        self._start([kind for kind in ("depth", "color") if kind in self._chosen])
        return {**self._names(), **self._geometry()}

    def find_device(self) -> Any:
        """The library's device; a test puts its software device here."""
        self._context = self._rs.context()
        for device in self._context.query_devices():
            if self.serial in ("", self._info(device, "serial_number")):
                self._context.set_devices_changed_callback(self._on_change)
                return device
        raise WorkError(
            f"The RealSense camera {self.serial} is not connected.",
            "Plug it into a USB 3 socket; close other programs that use it.",
        )

    def is_connected(self) -> bool:
        """Whether the device is still there."""
        return not self._removed and bool(self._device.is_connected())

    def read(self, wanted: bool = True) -> Packet | None:
        """The next depth frame with the newest pictures of the other streams."""
        waiting, frame = self._queue.try_wait_for_frame(_WAIT_MS)
        if not waiting:
            self._look()
            return None
        kind = kind_of(frame.get_profile())
        if kind is None or kind not in self._kinds:
            return None
        self._newest[kind] = pixels_of(frame)
        self._times[kind] = self._clock.time_s(frame, kind)
        leading = next(k for k in KINDS if k in self._kinds)
        if kind != leading:
            return None
        facts = {"times": dict(self._times), "unit_m": self._unit_m()}
        return Packet(dict(self._newest), facts)

    def request(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Answer ``start``, ``modes``, ``choose_mode``, ``controls``, ``set_control``."""
        if name == "start":
            self._start(list(arguments["kinds"]))
            return self._geometry()
        if name == "modes":
            return [
                (kind, p.width(), p.height(), p.fps())
                for kind in KINDS
                for p in (q.as_video_stream_profile() for q in self._profiles[kind])
            ]
        if name == "choose_mode":
            return self._choose(arguments["kind"], tuple(arguments["mode"]))
        if name == "controls":
            return read_controls(self._rs, self._sensors)
        if name == "set_control":
            return write_control(self._rs, self._sensors, arguments["control"], arguments["value"])
        raise ValueError(name)

    def close(self) -> None:
        """Stop the streams."""
        self._stop()

    def _on_change(self, change: Any) -> None:
        if change.was_removed(self._device):
            self._removed = True

    def _look(self) -> None:
        """Nothing came for a while: is the camera still there?"""
        if time.monotonic() - self._looked_s > _LOOK_EVERY_S:
            self._looked_s = time.monotonic()
            if not self.is_connected():
                raise _GONE

    def _start(self, kinds: Sequence[str]) -> None:
        missing = [kind for kind in kinds if kind not in self._chosen]
        if missing or not kinds:
            raise WorkError(f"The RealSense camera has no {' or '.join(missing) or 'such'} stream.")
        self._stop()
        self._kinds = tuple(kinds)
        self._newest: dict[str, Any] = {}
        self._times: dict[str, float] = {}
        try:
            for sensor in self._sensors:
                ids = {p.unique_id() for p in sensor.get_stream_profiles()}
                own = [self._chosen[k] for k in kinds if self._chosen[k].unique_id() in ids]
                if own:
                    sensor.open(own)
                    self._running.append(sensor)
                    sensor.start(self._queue)
        except RuntimeError as error:
            self._stop()
            raise WorkError(
                "The RealSense camera does not start.",
                f"Unplug and reconnect it; use a USB 3 socket. ({error})",
            ) from error

    def _stop(self) -> None:
        for sensor in self._running:
            for step in (sensor.stop, sensor.close):
                try:
                    step()
                except RuntimeError:
                    continue  # it was not started, or the camera is gone: nothing is left to stop
        self._running = []

    def _best(self, kind: str) -> Any:
        def rank(profile: Any) -> tuple[int, int]:
            p = profile.as_video_stream_profile()
            size = (p.width(), p.height(), p.fps())
            place = _WANTED[kind].index(size) if size in _WANTED[kind] else len(_WANTED[kind])
            return place, -p.width() * p.height()

        return min(self._profiles[kind], key=rank)

    def _choose(self, kind: str, mode: tuple[int, int, int]) -> dict[str, Any]:
        for profile in self._profiles.get(kind, []):
            p = profile.as_video_stream_profile()
            if (p.width(), p.height(), p.fps()) == mode:
                self._chosen[kind] = profile
                self._start(self._kinds)
                return self._geometry()
        raise InputError(f"The RealSense camera has no such {kind} mode.")

    def _geometry(self) -> dict[str, Any]:
        """Factory calibration of the chosen modes."""
        depth, color = self._chosen["depth"], self._chosen.get("color")
        facts: dict[str, Any] = {
            "depth": camera_facts(depth.as_video_stream_profile().get_intrinsics()),
            "color": None,
            "rotation": None,
            "translation": None,
        }
        if color is not None:
            facts["color"] = camera_facts(color.as_video_stream_profile().get_intrinsics())
            try:
                pose = depth.get_extrinsics_to(color)
            except RuntimeError as error:
                raise WorkError(
                    "The RealSense camera does not tell how its depth and colour cameras stand."
                ) from error
            facts["rotation"], facts["translation"] = list(pose.rotation), list(pose.translation)
        return facts

    def _names(self) -> dict[str, Any]:
        return {
            "name": self._info(self._device, "name") or "RealSense camera",
            "serial": self._info(self._device, "serial_number"),
        }

    def _info(self, device: Any, name: str) -> str:
        key = getattr(self._rs.camera_info, name)
        return str(device.get_info(key)) if device.supports(key) else ""

    def _unit_m(self) -> float:
        option = self._rs.option.depth_units
        if not hasattr(self, "_unit"):
            has = [s for s in self._sensors if s.supports(option)]
            # The library stores single precision: 0.001 comes as 0.0010000000475.
            self._unit = float(f"{has[0].get_option(option):.7g}") if has else 0.001
        return self._unit


@dataclass
class RealSenseList:
    """Tells which cameras are connected, then waits to be closed."""

    def open(self) -> Mapping[str, Any]:
        """Serial number and name of every connected camera."""
        rs = library.load()
        info = rs.camera_info
        found = rs.context().query_devices()
        return {"found": [(d.get_info(info.serial_number), d.get_info(info.name)) for d in found]}

    def read(self, wanted: bool = True) -> Packet | None:
        """Nothing ever comes."""
        time.sleep(0.02)
        return None

    def request(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Answer nothing."""
        raise ValueError(name)

    def close(self) -> None:
        """Nothing is open."""
