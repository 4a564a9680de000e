"""The open device inside the runtime's process: its streams, its settings, its recorder, its frames."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from core.errors import WorkError
from devices.openni import settings
from devices.openni.binding import binding_part
from devices.openni.clock import DeviceClock
from devices.openni.ring import KINDS, FrameRing, RingLayout
from devices.openni.runtime import load_runtime
from devices.openni.streams import Mode, OpenedStream, StreamInfo

if TYPE_CHECKING:
    from devices.live import StreamKind

FRAME_TIMEOUT_S = 3.0
_PARTNER_SHARE = 0.5
_FIRST_PARTNERS_S = 1.5
_SERIAL_NUMBER = 3
_WORDS: dict[str, str] = {"depth": "depth", "color": "colour", "infrared": "infrared"}


@dataclass(frozen=True)
class OpenedDevice:
    """What the application is told when a device is open.

    Attributes
    ----------
    uri, name, vendor : str
    usb : tuple of int
        Vendor and product id; 0 where the driver does not tell.
    serial : str
        Empty if the driver does not tell one.
    kinds : tuple of str
        Streams there are.
    modes : tuple of Mode
    """

    uri: str
    name: str
    vendor: str
    usb: tuple[int, int]
    serial: str
    kinds: tuple[StreamKind, ...]
    modes: tuple[Mode, ...]


@dataclass(frozen=True)
class StartedStreams:
    """What the application is told when streams have started.

    Attributes
    ----------
    infos : dict of str to StreamInfo
        Of the running streams.
    layout : RingLayout
    ring : str
        Name of the shared memory.
    """

    infos: Mapping[StreamKind, StreamInfo]
    layout: RingLayout
    ring: str


@dataclass
class _Pending:
    """A frame of the leading stream that waits for the pictures of its moment."""

    stamp_s: float
    until_s: float
    waits_for: set[StreamKind] = field(default_factory=set)


class Session:
    """The runtime and at most one open device. Used by one thread."""

    def __init__(self) -> None:
        self._openni: ModuleType | None = None
        self._device: Any = None
        self._is_file = False
        self._uri = b""
        self._streams: dict[StreamKind, OpenedStream] = {}
        self._running: dict[StreamKind, OpenedStream] = {}
        self._ring: FrameRing | None = None
        self._clock = DeviceClock()
        self._stamps: dict[StreamKind, float] = {}
        self._half_period_s = 0.0
        self._first_until_s = 0.0
        self._pending: _Pending | None = None
        self._recorder: Any = None
        self._callbacks: Any = None
        self._read: dict[StreamKind, int] = {}
        self._expected: dict[StreamKind, int] = {}

    @property
    def streaming(self) -> bool:
        """Whether frames of a live device are to be pumped."""
        return bool(self._running) and not self._is_file

    @property
    def _runtime(self) -> ModuleType:
        if self._openni is None:
            self._openni = load_runtime()
            self._listen()
        return self._openni

    def _listen(self) -> None:
        """Be told of unplugged devices. The callback comes in a thread of the driver: it only sets a mark."""
        c_api = binding_part("_openni2")
        nothing = c_api.OniDeviceInfoCallback(lambda info, cookie: None)
        self._callbacks = c_api.OniDeviceCallbacks(
            deviceConnected=nothing,
            deviceDisconnected=c_api.OniDeviceInfoCallback(self._on_disconnected),
            deviceStateChanged=c_api.OniDeviceStateCallback(lambda info, state, cookie: None),
        )
        handle = c_api.OniCallbackHandle()
        c_api.oniRegisterDeviceCallbacks(self._callbacks, None, ctypes.byref(handle))

    def _on_disconnected(self, info: Any, cookie: Any) -> None:
        ring = self._ring
        if ring is not None and info[0].uri == self._uri:
            ring.say_gone()

    def list_devices(self) -> list[tuple[str, str]]:
        """Address and name of every connected device."""
        c_api = binding_part("_openni2")
        _ = self._runtime  # must be initialised
        pointer = ctypes.POINTER(c_api.OniDeviceInfo)()
        count = ctypes.c_int()
        c_api.oniGetDeviceList(ctypes.byref(pointer), ctypes.byref(count))
        found = [
            (pointer[i].uri.decode(errors="replace"), pointer[i].name.decode(errors="replace"))
            for i in range(count.value)
        ]
        c_api.oniReleaseDeviceList(pointer)
        return found

    def open(self, address: str, is_file: bool) -> OpenedDevice:
        """Open a device or a file."""
        self.close()
        runtime = self._runtime
        self._is_file = is_file
        try:
            self._device = runtime.Device(os.fsencode(address) if address else None)
        except Exception as error:
            what = "recording" if is_file else "device"
            raise WorkError(f"OpenNI2 could not open the {what}.", open_advice(is_file)) from error
        if is_file:
            if self._device.playback is None:
                raise WorkError("This file is not an OpenNI2 recording.", open_advice(True))
            self._device.playback.speed = -1.0  # step frame by frame; nothing is dropped
            self._device.playback.repeat = False
        create: dict[StreamKind, Any] = {
            "depth": self._device.create_depth_stream,
            "infrared": self._device.create_ir_stream,
            "color": self._device.create_color_stream,
        }
        for kind in KINDS:
            if (stream := create[kind]()) is not None:
                self._streams[kind] = OpenedStream(kind, stream, is_file)
        if not self._streams.keys() & {"depth", "infrared"}:
            raise WorkError("This source has no depth stream.", "Choose a depth camera or its recording.")
        about = self._device.device_info
        self._uri = bytes(about.uri)
        return OpenedDevice(
            uri=about.uri.decode(errors="replace"),
            name=about.name.decode(errors="replace"),
            vendor=about.vendor.decode(errors="replace"),
            usb=(int(about.usbVendorId), int(about.usbProductId)),
            serial=self._serial(),
            kinds=tuple(self._streams),
            modes=tuple(mode for opened in self._streams.values() for mode in opened.modes()),
        )

    def _serial(self) -> str:
        c_api = binding_part("_openni2")
        if not self._device.is_property_supported(_SERIAL_NUMBER):
            return ""
        text, size = ctypes.create_string_buffer(256), ctypes.c_int(256)
        try:
            c_api.oniDeviceGetProperty(self._device._handle, _SERIAL_NUMBER, text, ctypes.byref(size))
        except Exception:  # noqa: BLE001 - the binding raises bare kinds; a camera without a number is served
            return ""
        return text.value.decode(errors="replace").strip()

    def start(
        self,
        kinds: Collection[StreamKind] | None,
        modes: Mapping[StreamKind, Mode] | None = None,
        before: int = 0,
    ) -> StartedStreams:
        """Run these streams from now on, None for all there are; frames are numbered from ``before + 1``."""
        self._stop()
        wanted: list[StreamKind] = [k for k in KINDS if k in (self._streams if kinds is None else kinds)]
        for kind in wanted:
            if kind not in self._streams:
                raise WorkError(f"This camera has no {_WORDS[kind]} stream.", "Use another camera.")
        for kind, mode in (modes or {}).items():
            if kind in self._streams:
                self._streams[kind].choose(mode)
        infos = {kind: self._streams[kind].info() for kind in wanted}
        layout = RingLayout(
            {kind: self._streams[kind].image_layout() for kind in wanted},
            infos["depth"].unit_m if "depth" in infos else 0.001,
            before,
        )
        self._ring = FrameRing.create(layout)
        try:
            for kind in wanted:
                self._start_one(kind, wanted)
        except BaseException:
            self._stop()
            raise
        self._half_period_s = _PARTNER_SHARE / max(infos[layout.leader].fps, 1)
        self._first_until_s = time.monotonic() + _FIRST_PARTNERS_S
        self._clock = DeviceClock()
        self._read = dict.fromkeys(wanted, 0)
        self._expected = {kind: info.frames for kind, info in infos.items()}
        return StartedStreams(infos, layout, self._ring.name)

    def _start_one(self, kind: StreamKind, wanted: Collection[StreamKind]) -> None:
        try:
            self._streams[kind].start()
        except Exception as error:
            if {"color", "infrared"} <= set(wanted):
                raise WorkError(
                    "The camera cannot deliver infrared and colour at the same time.",
                    "Use one of them; calibration asks for infrared alone.",
                ) from error
            raise WorkError(
                f"The camera's {_WORDS[kind]} stream does not start.",
                "Unplug and reconnect the camera, then try again.",
            ) from error
        self._running[kind] = self._streams[kind]

    def pump(self, wait_s: float) -> None:
        """Wait for one frame of a live device and put it into the ring."""
        self._flush()
        self._take(wait_s)

    def step(self) -> int | None:
        """Read a recording up to its next frame; its number, or None at the end."""
        assert self._ring is not None
        before = self._ring.newest
        while self._ring.newest == before:
            left = [k for k in self._running if self._read[k] < (self._expected[k] or 1 << 62)]
            if not left or not self._take(FRAME_TIMEOUT_S):
                if self._pending is None:
                    return None
                self._publish()
        return self._ring.newest

    def _take(self, wait_s: float) -> bool:
        """Read one image of any stream if one comes in time."""
        by_stream = {opened.stream: opened for opened in self._running.values()}
        # read_frame blocks for ever on a stream that has stopped: never read without waiting first.
        ready = self._runtime.wait_for_any_stream(list(by_stream), wait_s)
        if ready is None:
            return False
        opened = by_stream[ready]
        self._read[opened.kind] += 1
        opened.read(lambda image, stamp_s: self._store(opened.kind, image, stamp_s))
        return True

    def _store(self, kind: StreamKind, image: NDArray[Any], stamp_s: float) -> None:
        """Put an image into the ring; a leading one waits half a period for the pictures of its moment."""
        ring = self._ring
        assert ring is not None
        now = time.monotonic()
        time_s = stamp_s if self._is_file else self._clock.at(stamp_s, now)
        leads = kind == ring.layout.leader
        if leads and self._pending is not None and (self._is_file or not self._warming_up(now)):
            self._publish()
        ring.put(kind, image, time_s)
        self._stamps[kind] = stamp_s
        if leads:
            late = {k for k in self._running if k != kind and not self._belongs(k, stamp_s)}
            if self._is_file:
                late = {k for k in late if self._read[k] < (self._expected[k] or 1 << 62)}
            self._pending = _Pending(stamp_s, now + self._half_period_s, late)
        elif self._pending is not None and self._belongs(kind, self._pending.stamp_s):
            self._pending.waits_for.discard(kind)
        self._flush()

    def _belongs(self, kind: StreamKind, stamp_s: float) -> bool:
        """Whether the newest image of a stream is of this moment or later."""
        return self._stamps.get(kind, -np.inf) >= stamp_s - self._half_period_s

    def _flush(self) -> None:
        """Publish the waiting frame if it is complete, or has waited long enough."""
        pending = self._pending
        if pending is None:
            return
        now = time.monotonic()
        waited = not self._is_file and now >= pending.until_s and not self._warming_up(now)
        if not pending.waits_for or waited:
            self._publish()

    def _warming_up(self, now: float) -> bool:
        """Whether the first picture of some stream is still to come: no frame is without it until then."""
        return now < self._first_until_s and not self._running.keys() <= self._stamps.keys()

    def _publish(self) -> None:
        assert self._ring is not None
        self._pending = None
        self._ring.publish()

    def beat(self) -> None:
        """Say that this process is well."""
        if self._ring is not None:
            self._ring.beat()

    def controls(self) -> list[tuple[str, float, float, float]]:
        """Name, value, minimum and maximum of what can be set."""
        return settings.read_controls(self._device, self._streams.get("color"))

    def set_control(self, name: str, value: float) -> float:
        """Set a control; return what it then is."""
        return settings.write_control(self._device, self._streams.get("color"), name, value)

    def record(self, path: str, lossy: bool) -> None:
        """Record the running streams with the runtime's own recorder from now on."""
        if self._recorder is not None:
            raise WorkError("This camera is being recorded already.", "Stop that recording first.")
        if not self._running:
            raise WorkError("No stream runs.", "Start the camera first.")
        recorder = self._runtime.Recorder(os.fsencode(path))
        try:
            for opened in self._running.values():
                recorder.attach(opened.stream, lossy and opened.kind == "color")
            recorder.start()
        except Exception as error:
            recorder.close()
            Path(path).unlink(missing_ok=True)
            raise WorkError(
                "The OpenNI2 recorder does not take these streams.", "Choose another mode of the camera."
            ) from error
        self._recorder = recorder

    def stop_recording(self) -> None:
        """Complete the recording."""
        if self._recorder is not None:
            recorder, self._recorder = self._recorder, None
            # The recorder's end and a driver's next frame can wait for each other for ever (seen in 3 of 16
            # recordings): nothing is delivered while it ends.
            for opened in self._running.values():
                opened.stop()
            recorder.stop()
            recorder.close()
            for opened in self._running.values():
                opened.start()

    def _stop(self) -> None:
        self.stop_recording()
        for opened in self._running.values():
            opened.stop()
        self._running.clear()
        self._pending = None
        self._stamps.clear()
        if self._ring is not None:
            ring, self._ring = self._ring, None
            ring.remove()
            ring.close()

    def close(self) -> None:
        """Stop the streams and close the device."""
        self._stop()
        for opened in self._streams.values():
            with contextlib.suppress(Exception):  # a stream of a device that is gone
                opened.stream.close()
        self._streams.clear()
        if self._device is not None:
            device, self._device = self._device, None
            device.close()


def open_advice(is_file: bool) -> str:
    """What to do about a device or file that does not open."""
    if is_file:
        return "Check that it is a complete .oni file; a recording that was cut off cannot be played."
    return "Check the cable and that no other program uses the camera."
