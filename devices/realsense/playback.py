"""A RealSense recording as its own process sees it: played frame by frame, none lost."""

from __future__ import annotations

import queue
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.errors import InputError, WorkError
from devices.camera_process.packets import Packet
from devices.realsense import library
from devices.realsense.frames import kind_of, pixels_of
from devices.realsense.geometry import camera_facts

_FIRST_FRAME_S = 5.0
_END_S = 0.6
_AHEAD = 8
_EARLIEST_WALL_CLOCK_S = 1.2e9


@dataclass
class PlaybackSource:
    """A ``.bag`` or ``.db3`` file that the library wrote.

    Attributes
    ----------
    path : str
    """

    path: str

    def open(self) -> Mapping[str, Any]:
        """Open the file and read what cameras it was taken with."""
        self._frames: queue.Queue[tuple[str, float, bool, Any]] = queue.Queue(_AHEAD)
        self._playing: list[Any] = []  # first: `close` comes also after a library that was not found
        self._stopping = False
        self._rs = library.load()
        self._load()
        facts = self._facts()
        self._play()
        return facts

    def read(self, wanted: bool = True) -> Packet | None:
        """Nothing by itself: frames are asked for by `request`."""
        time.sleep(0.01)
        return None

    def request(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Answer ``burst``: the next depth frames, and the colour picture nearest to their middle."""
        if name != "burst":
            raise ValueError(name)
        wanted = int(arguments["frames"])
        packet = self._burst(wanted)
        if packet is None or (packet.facts["ended"] and len(packet.arrays["depth"]) < wanted):
            # At its end the recording starts again with the next burst.
            self._stop()
            self._load()
            self._play()
        if packet is None:
            packet = self._burst(wanted)
        if packet is None:
            raise WorkError("The recording has no depth frames.", "Choose another recording.")
        return packet

    def close(self) -> None:
        """Stop playing."""
        self._stop()

    def _load(self) -> None:
        rs = self._rs
        try:
            self._device = rs.context().load_device(self.path)
            self._device.as_playback().set_real_time(False)
            self._sensors = list(self._device.query_sensors())
            self._profiles: dict[str, Any] = {}
            for sensor in self._sensors:
                for profile in sensor.get_stream_profiles():
                    kind = kind_of(profile)
                    if kind in ("depth", "color"):
                        self._profiles.setdefault(kind, profile)
        except RuntimeError as error:
            raise InputError(
                f"The file is not a recording that the RealSense library can play. ({error})",
                "Choose a .bag or .db3 file that a RealSense program wrote to its end.",
            ) from error
        if "depth" not in self._profiles:
            raise InputError("The RealSense recording has no depth stream.", "Record depth and colour.")

    def _facts(self) -> dict[str, Any]:
        rs, info = self._rs, self._rs.camera_info
        depth, color = self._profiles["depth"], self._profiles.get("color")
        facts: dict[str, Any] = {
            "depth": camera_facts(depth.as_video_stream_profile().get_intrinsics()),
            "color": None,
            "rotation": None,
            "translation": None,
            "serial": self._device.get_info(info.serial_number)
            if self._device.supports(info.serial_number)
            else "",
        }
        units = [s for s in self._sensors if s.supports(rs.option.depth_units)]
        facts["unit_m"] = float(f"{units[0].get_option(rs.option.depth_units):.7g}") if units else 0.001
        facts["told_unit"] = bool(units)
        if color is not None:
            try:
                pose = depth.get_extrinsics_to(color)
                facts["color"] = camera_facts(color.as_video_stream_profile().get_intrinsics())
                facts["rotation"], facts["translation"] = list(pose.rotation), list(pose.translation)
            except RuntimeError:
                # Without the cameras' relation a picture cannot be laid on the depth: told as a warning.
                del self._profiles["color"]
                facts["no_extrinsics"] = True
        return facts

    def _play(self) -> None:
        self._stopping = False
        for sensor in self._sensors:
            ids = {p.unique_id() for p in sensor.get_stream_profiles()}
            own = [p for p in self._profiles.values() if p.unique_id() in ids]
            if own:
                sensor.open(own)
                self._playing.append(sensor)
        for sensor in self._playing:
            sensor.start(self._heard)

    def _heard(self, frame: Any) -> None:
        """From the library's threads: waits until there is room, so that playing waits for the taker."""
        kind = kind_of(frame.get_profile())
        if kind is None:
            return
        domains = (self._rs.timestamp_domain.global_time, self._rs.timestamp_domain.system_time)
        on_wall = frame.get_frame_timestamp_domain() in domains
        item = (kind, float(frame.get_timestamp()) / 1000.0, on_wall, pixels_of(frame))
        while not self._stopping:
            try:
                self._frames.put(item, timeout=0.1)
                return
            except queue.Full:
                continue

    def _burst(self, wanted: int) -> Packet | None:
        depth: list[Any] = []
        times: list[float] = []
        colors: list[tuple[float, Any]] = []
        wall, ended = False, False
        quiet_since = time.monotonic()
        while len(depth) < wanted or ("color" in self._profiles and not colors):
            try:
                kind, stamp_s, on_wall, pixels = self._frames.get(timeout=0.05)
            except queue.Empty:
                # A file is read at its own pace; once the library has stopped, only its queues are left.
                patience_s = _END_S if self._stopped() else _FIRST_FRAME_S
                if time.monotonic() - quiet_since > patience_s:
                    ended = True
                    break
                continue
            quiet_since = time.monotonic()
            if kind == "color":
                colors.append((stamp_s, pixels))
            elif len(depth) < wanted:
                depth.append(pixels)
                times.append(stamp_s)
                wall = on_wall
        if not depth:
            return None
        middle = 0.5 * (times[0] + times[-1])
        arrays = {"depth": np.stack(depth)}
        facts: dict[str, Any] = {"times": times, "ended": ended, "taken_at": None, "color_time": 0.0}
        if colors:
            facts["color_time"], arrays["rgb"] = min(colors, key=lambda c: abs(c[0] - middle))
        if wall and middle > _EARLIEST_WALL_CLOCK_S:
            facts["taken_at"] = middle
        return Packet(arrays, facts)

    def _stopped(self) -> bool:
        status = self._device.as_playback().current_status()
        return bool(status == self._rs.playback_status.stopped)

    def _stop(self) -> None:
        self._stopping = True
        for sensor in self._playing:
            for step in (sensor.stop, sensor.close):
                try:
                    step()
                except RuntimeError:
                    continue  # it has stopped by itself at the end of the file
        self._playing = []
        while not self._frames.empty():
            self._frames.get_nowait()
