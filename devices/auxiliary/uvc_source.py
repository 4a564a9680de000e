"""A webcam as its own process sees it: OpenCV's VideoCapture with modes, exposure lock and time stamps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, WorkError
from devices.auxiliary.camera import MOST_PIXELS
from devices.camera_process.packets import Packet, SourceGone

FILE_BACKENDS = ("FFMPEG", "CV_IMAGES", "CV_MJPEG", "GSTREAMER")
_COMMON_SIZES = (
    (640, 480),
    (1280, 720),
    (1280, 960),
    (1600, 1200),
    (1920, 1080),
    (2048, 1536),
    (2592, 1944),
    (3264, 2448),
    (3840, 2160),
    (4000, 3000),
    (4208, 3120),
    (4656, 3496),
    (5472, 3648),
    (6000, 4000),
)
_ASK_FOR_MOST = 10_000
_GONE_AFTER_S = 1.5
_RETRY_S = 0.05
_SETTLE_PICTURES = 4
_NOTHING = WorkError("The colour camera delivers no pictures.", "Unplug and reconnect it, then try again.")


class VideoCapture(Protocol):
    """What is used of `cv2.VideoCapture`."""

    def isOpened(self) -> bool: ...  # noqa: D102

    def read(self) -> tuple[bool, NDArray[np.uint8] | None]: ...  # noqa: D102

    def grab(self) -> bool: ...  # noqa: D102

    def get(self, prop: int) -> float: ...  # noqa: D102

    def set(self, prop: int, value: float) -> bool: ...  # noqa: D102

    def getBackendName(self) -> str: ...  # noqa: D102

    def release(self) -> None: ...  # noqa: D102


MakeCapture = Callable[[int | str], VideoCapture]
"""Opens an address; a function of a module, for it is sent to another process by name."""


def open_video_capture(address: int | str) -> VideoCapture:
    """OpenCV's own capture, silent on standard error."""
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture: VideoCapture = cv2.VideoCapture(address)
    return capture


@dataclass
class UvcSource:
    """Reads a camera, or a video file in real time.

    Attributes
    ----------
    address : int or str
        Index or device path of a camera; path of a video, or of an image sequence (``frame_%03d.png``).
    size : (width, height) or None
        Resolution to run in; None for the largest.
    latency_s : float
        From the middle of the exposure to the driver's time stamp.
    make : callable
    """

    address: int | str
    size: tuple[int, int] | None = None
    latency_s: float = 0.0
    make: MakeCapture = open_video_capture

    def open(self) -> Mapping[str, Any]:
        """Open the camera in the wanted resolution and wait for nothing."""
        self._capture = self.make(self.address)
        if not self._capture.isOpened():
            raise WorkError(
                "The colour camera cannot be opened.",
                "Check its cable, and that no other program is using it.",
            )
        self._backend = self._capture.getBackendName()
        self._is_file = self._backend in FILE_BACKENDS
        self._failing_since: float | None = None
        self._modes: list[tuple[int, int, int]] | None = None
        self._due_s = time.monotonic()
        if self._is_file:
            self._best = self._now_size()
        else:
            self._capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
            self._best = self._run_in((_ASK_FOR_MOST, _ASK_FOR_MOST))
            if self.size is not None and self._run_in(self.size) != self.size:
                raise InputError(
                    f"The colour camera has no mode of {self.size[0]} x {self.size[1]} pixels.",
                    f"Its largest is {self._best[0]} x {self._best[1]}.",
                )
        return {"backend": self._backend, "mode": self._mode(), "best": self._best}

    def read(self, wanted: bool = True) -> Packet | None:
        """The next picture; blocks as long as the driver does."""
        if self._is_file:
            self._keep_pace()
        if not wanted:
            if not self._capture.grab():
                self._failed(time.monotonic())
            return None
        ok, picture = self._capture.read()
        arrived_s = time.monotonic()
        if not ok or picture is None:
            self._failed(arrived_s)
            return None
        self._failing_since = None
        height, width = picture.shape[:2]
        if height * width > MOST_PIXELS:
            raise SourceGone(
                f"The colour camera's pictures of {width} x {height} pixels are too large.",
                "Choose a mode of at most 24 megapixels.",
            )
        code = cv2.COLOR_GRAY2RGB if picture.ndim == 2 else cv2.COLOR_BGR2RGB
        return Packet({"rgb": cv2.cvtColor(picture, code)}, {"time_s": self._exposed_s(arrived_s)})

    def request(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Answer ``still``, ``modes``, ``choose_mode``, ``controls``, ``set_control``, ``latency``."""
        if name == "still":
            return self._still(float(arguments["within_s"]))
        if name == "modes":
            return self._all_modes()
        if name == "choose_mode":
            return self._choose(tuple(arguments["size"]))
        if name == "controls":
            return self._controls()
        if name == "latency":
            self.latency_s = float(arguments["value"])
            return None
        if name == "set_control":
            return self._set_control(arguments["control"], float(arguments["value"]))
        raise ValueError(name)

    def close(self) -> None:
        """Release the camera."""
        self._capture.release()

    def _keep_pace(self) -> None:
        """A file would come as fast as it can be read; a camera does not."""
        fps = self._capture.get(cv2.CAP_PROP_FPS)
        wait_s = self._due_s - time.monotonic()
        if wait_s > 0:
            time.sleep(min(wait_s, 1.0))
        self._due_s = max(self._due_s, time.monotonic() - 0.5) + 1.0 / (fps if 0.1 < fps < 240 else 25.0)

    def _failed(self, now_s: float) -> None:
        if self._is_file:
            raise SourceGone("The file of the colour camera has ended.", "Open it again.")
        self._failing_since = self._failing_since or now_s
        if now_s - self._failing_since > _GONE_AFTER_S:
            raise SourceGone(
                "The colour camera is gone: it was unplugged or its driver failed.",
                "Plug it in again, then choose it again.",
            )
        time.sleep(_RETRY_S)

    def _exposed_s(self, arrived_s: float) -> float:
        """Time of the exposure: the driver's stamp where it is on our clock (V4L2), else the arrival."""
        if self._backend == "V4L2":
            stamp_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
            if 0.0 <= arrived_s - stamp_s < 2.0:
                return stamp_s - self.latency_s
        return arrived_s - self.latency_s

    def _now_size(self) -> tuple[int, int]:
        get = self._capture.get
        return round(get(cv2.CAP_PROP_FRAME_WIDTH)), round(get(cv2.CAP_PROP_FRAME_HEIGHT))

    def _run_in(self, size: tuple[int, int]) -> tuple[int, int]:
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
        return self._now_size()

    def _mode(self) -> tuple[int, int, int]:
        fps = self._capture.get(cv2.CAP_PROP_FPS)
        return (*self._now_size(), round(fps) if math.isfinite(fps) and fps > 0 else 0)

    def _all_modes(self) -> list[tuple[int, int, int]]:
        """Sizes that the camera takes, by asking for the usual ones: OpenCV cannot list them."""
        if self._modes is None:
            before, found = self._now_size(), {}
            if self._is_file:
                return [self._mode()]
            for size in (*_COMMON_SIZES, self._best):
                if size[0] * size[1] <= MOST_PIXELS and self._run_in(size) == size:
                    found[size] = self._mode()
            self._run_in(before)
            self._modes = sorted(found.values(), key=lambda m: m[0] * m[1])
        return self._modes

    def _choose(self, size: tuple[int, int]) -> tuple[int, int, int]:
        before = self._now_size()
        if size != before and (self._is_file or self._run_in(size) != size):
            if not self._is_file:
                self._run_in(before)
            raise InputError(f"The colour camera has no mode of {size[0]} x {size[1]} pixels.")
        return self._mode()

    def _still(self, timeout_s: float) -> Packet:
        """A picture exposed from now on, in the best resolution; the stream then goes on as before."""
        asked_s, before = time.monotonic(), self._now_size()
        switched = self._best != before and not self._is_file
        if switched:
            self._run_in(self._best)
        # Without the driver's own time stamps one picture may still lie in its queue.
        skip = _SETTLE_PICTURES if switched else int(self._backend != "V4L2")
        try:
            while time.monotonic() - asked_s < timeout_s:
                packet = self.read()
                if packet is None or packet.facts["time_s"] < asked_s:
                    continue
                if skip == 0:
                    return packet
                skip -= 1
        finally:
            if switched:
                self._run_in(before)
        raise _NOTHING

    # What OpenCV's backends mean by the value of CAP_PROP_AUTO_EXPOSURE and CAP_PROP_EXPOSURE differs.
    def _manual_auto(self) -> tuple[float, float]:
        return (1.0, 3.0) if self._backend == "V4L2" else (0.0, 1.0)

    def _exposure_s(self) -> float:
        value = self._capture.get(cv2.CAP_PROP_EXPOSURE)
        return value * 1e-4 if self._backend == "V4L2" else 2.0**value

    def _controls(self) -> list[tuple[str, float, float, float]]:
        """Name, value, minimum and maximum of what this camera lets be set."""
        if self._is_file:
            return []
        get = self._capture.get
        found: list[tuple[str, float, float, float]] = []
        automatic = get(cv2.CAP_PROP_AUTO_EXPOSURE)
        if automatic != -1:
            is_auto = float(automatic != self._manual_auto()[0])
            found += [("auto_exposure", is_auto, 0, 1), ("exposure_lock", 1 - is_auto, 0, 1)]
            if get(cv2.CAP_PROP_EXPOSURE) != -1 or self._backend != "V4L2":
                found.append(("exposure_s", self._exposure_s(), 1e-4, 1.0))
        focus = get(cv2.CAP_PROP_AUTOFOCUS)
        if focus != -1:
            found.append(("focus_lock", float(focus == 0), 0, 1))
        white = get(cv2.CAP_PROP_AUTO_WB)
        if white != -1:
            found.append(("auto_white_balance", float(white != 0), 0, 1))
            kelvin = get(cv2.CAP_PROP_WB_TEMPERATURE)
            if kelvin > 0:
                found.append(("white_balance_k", kelvin, 2000, 10000))
        return found

    def _set_control(self, name: str, value: float) -> None:
        manual, automatic = self._manual_auto()
        if name in ("auto_exposure", "exposure_lock"):
            lock = value == (1.0 if name == "exposure_lock" else 0.0)
            exposure = self._capture.get(cv2.CAP_PROP_EXPOSURE)
            self._set(name, cv2.CAP_PROP_AUTO_EXPOSURE, manual if lock else automatic)
            if lock and exposure != -1:
                # Some drivers fall back to the last manual value: keep the one in force.
                self._capture.set(cv2.CAP_PROP_EXPOSURE, exposure)
        elif name == "exposure_s":
            self._set("auto_exposure", cv2.CAP_PROP_AUTO_EXPOSURE, manual)
            raw = round(value * 1e4) if self._backend == "V4L2" else math.log2(value)
            self._set(name, cv2.CAP_PROP_EXPOSURE, raw)
        elif name == "focus_lock":
            self._set(name, cv2.CAP_PROP_AUTOFOCUS, 1.0 - value)
        elif name == "auto_white_balance":
            self._set(name, cv2.CAP_PROP_AUTO_WB, value)
        else:
            self._set("auto_white_balance", cv2.CAP_PROP_AUTO_WB, 0.0)
            self._set(name, cv2.CAP_PROP_WB_TEMPERATURE, value)

    def _set(self, name: str, prop: int, value: float) -> None:
        """Set a property and see whether the camera took it: many drivers say yes and do nothing."""
        self._capture.set(prop, value)
        # Drivers round exposure and colour temperature to their own steps; switches are 0, 1 or 3.
        allowed = 0.5 if abs(value) <= 3 else 0.05 * abs(value) + 1.0
        if abs(self._capture.get(prop) - value) > allowed:
            raise WorkError(f"The colour camera did not take the setting '{name}'.", "Set it at the camera.")
