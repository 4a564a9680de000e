"""What runs inside the runtime's own process: a loop that answers requests over a pipe.

The OpenNI2 runtime can crash or hang natively (seeking does, so does reading a stream that has stopped). In
a process of its own that costs a message, not the consultation. Requests are ``(operation, arguments)``;
answers are ``("progress", fraction)``, ``("done", value)`` or ``("error", message, advice)``.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import GeodermError, WorkError
from devices.openni.binding import binding_part
from devices.openni.runtime import load_runtime
from devices.openni.streams import OpenedStream, StreamBatch, StreamInfo

FRAME_TIMEOUT_S = 3.0


def serve(pipe: Connection) -> None:
    """Answer requests until the other side closes the pipe, then leave without native clean-up.

    The runtime's own shutdown crashes in some builds when streams were open; nothing is left to lose here.
    """
    session = _Session()
    try:
        while True:
            operation, arguments = pipe.recv()
            try:
                value = getattr(session, operation)(
                    lambda fraction: pipe.send(("progress", fraction)), **arguments
                )
                pipe.send(("done", value))
            except GeodermError as error:
                pipe.send(("error", error.message, error.advice))
            except Exception as error:  # noqa: BLE001 - the binding raises bare kinds; all cross as messages
                first = str(error).strip().splitlines()
                pipe.send(("error", f"OpenNI2: {first[0] if first else type(error).__name__}.", ""))
    except (EOFError, OSError, KeyboardInterrupt):
        pass
    os._exit(0)


class _Session:
    """The runtime and at most one open device."""

    def __init__(self) -> None:
        self._openni: ModuleType | None = None
        self._device: Any = None
        self._streams: dict[str, OpenedStream] = {}
        self._last_color: NDArray[np.uint8] | None = None

    @property
    def _runtime(self) -> ModuleType:
        if self._openni is None:
            self._openni = load_runtime()
        return self._openni

    def list_devices(self, report: Callable[[float], None]) -> list[tuple[str, str]]:
        """Address and name of every connected device."""
        import ctypes

        c_api = binding_part("_openni2")
        _ = self._runtime  # must be initialised
        pointer = ctypes.POINTER(c_api.OniDeviceInfo)()
        count = ctypes.c_int()
        c_api.oniGetDeviceList(ctypes.byref(pointer), ctypes.byref(count))
        found = [(pointer[i].uri.decode(), pointer[i].name.decode()) for i in range(count.value)]
        c_api.oniReleaseDeviceList(pointer)
        return found

    def open(self, report: Callable[[float], None], address: str, is_file: bool) -> dict[str, StreamInfo]:
        """Open a device or a file and start its streams; return what they deliver."""
        self.close(report)
        runtime = self._runtime
        try:
            self._device = runtime.Device(os.fsencode(address) if address else None)
        except Exception as error:
            what = "recording" if is_file else "device"
            raise WorkError(f"OpenNI2 could not open the {what}.", _open_advice(is_file)) from error
        if is_file:
            if self._device.playback is None:
                raise WorkError("This file is not an OpenNI2 recording.", _open_advice(True))
            self._device.playback.speed = -1.0  # step frame by frame; nothing is dropped
            self._device.playback.repeat = False
        for kind, create in (
            ("depth", self._device.create_depth_stream),
            ("color", self._device.create_color_stream),
        ):
            if (stream := create()) is not None:
                self._streams[kind] = OpenedStream(kind, stream, is_file)
        if "depth" not in self._streams:
            raise WorkError("This source has no depth stream.", "Choose a depth camera or its recording.")
        for opened in self._streams.values():
            opened.start()
        return {kind: opened.info() for kind, opened in self._streams.items()}

    def read(self, report: Callable[[float], None], frames: int, color_frames: int) -> StreamBatch:
        """Read the next ``frames`` depth frames and at most ``color_frames`` colour frames beside them."""
        if not self._streams:
            raise WorkError("No device is open.")
        depth: list[NDArray[np.uint16]] = []
        color: list[NDArray[np.uint8]] = []
        ended = False
        wanted_color = color_frames if "color" in self._streams else 0
        for kind, image in self._frames():
            if kind == "depth":
                depth.append(image)
                report(len(depth) / frames)
            else:
                self._last_color = image
                if len(color) < wanted_color:
                    color.append(image)
            if len(depth) >= frames and len(color) >= wanted_color:
                break
            if len(depth) >= frames and self._last_color is not None and wanted_color:
                # The colour stream is slower than the depth stream: its last picture is the current one.
                color.append(self._last_color)
                break
            if len(depth) >= 3 * frames:  # a colour stream that never delivers must not hold the depth up
                break
        else:
            ended = True
        return StreamBatch(depth[:frames], color, ended)

    def _frames(self) -> Iterator[tuple[str, NDArray[Any]]]:
        by_stream = {opened.stream: opened for opened in self._streams.values()}
        while True:
            # read_frame blocks for ever on a stream that has stopped: never read without waiting first.
            ready = self._runtime.wait_for_any_stream(list(by_stream), FRAME_TIMEOUT_S)
            if ready is None:
                return
            opened = by_stream[ready]
            yield opened.kind, opened.read()

    def close(self, report: Callable[[float], None]) -> None:
        """Stop the streams and close the device."""
        for opened in self._streams.values():
            opened.stream.close()
        self._streams.clear()
        self._last_color = None
        if self._device is not None:
            self._device.close()
            self._device = None


def _open_advice(is_file: bool) -> str:
    if is_file:
        return "Check that it is a complete .oni file; a recording that was cut off cannot be played."
    return "Check the cable and that no other program uses the camera."
