"""A capture backend that behaves like a UVC camera: modes, controls, slow frames, stalls, unplugging."""

from __future__ import annotations

import os
import time

import cv2
import numpy as np
from numpy.typing import NDArray

SIZES = ((640, 480), (1280, 720), (1920, 1080))
FPS = 30.0


class FakeWebcam:
    """Has the interface of `cv2.VideoCapture`, and V4L2's manners.

    The address is a word that says what goes wrong: ``well``, ``stalls`` (one call blocks for ever, as a read
    on a wedged driver does), ``unplugged``, ``crashes``, ``stumbles`` (some reads fail, then it goes on),
    ``wrong-size``, ``grey``, ``deaf`` (takes no setting), ``absent``, ``24mp`` or ``30mp``.
    """

    def __init__(self, address: int | str) -> None:
        self._kind = str(address)
        self._sizes = {"24mp": ((1920, 1080), (6000, 4000)), "30mp": ((6600, 4600),)}.get(self._kind, SIZES)
        self._size = self._sizes[0]
        self._count = 0
        self._started = time.monotonic()
        self._stamp = 0.0
        self._values = {
            cv2.CAP_PROP_AUTO_EXPOSURE: 3.0,
            cv2.CAP_PROP_EXPOSURE: 157.0,
            cv2.CAP_PROP_AUTOFOCUS: 1.0,
            cv2.CAP_PROP_AUTO_WB: 1.0,
            cv2.CAP_PROP_WB_TEMPERATURE: 4600.0,
        }
        self._pictures: dict[tuple[int, int], NDArray[np.uint8]] = {}

    def isOpened(self) -> bool:
        return self._kind != "absent"

    def getBackendName(self) -> str:
        return "V4L2"

    def get(self, prop: int) -> float:
        if prop == cv2.CAP_PROP_FRAME_WIDTH:
            return float(self._size[0])
        if prop == cv2.CAP_PROP_FRAME_HEIGHT:
            return float(self._size[1])
        if prop == cv2.CAP_PROP_FPS:
            return FPS
        if prop == cv2.CAP_PROP_POS_MSEC:
            return self._stamp * 1000.0
        return self._values.get(prop, -1.0)

    def set(self, prop: int, value: float) -> bool:
        if prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT):
            axis = 0 if prop == cv2.CAP_PROP_FRAME_WIDTH else 1
            self._size = min(self._sizes, key=lambda s: abs(s[axis] - value))
        elif prop in self._values and self._kind != "deaf":
            self._values[prop] = value
        return True

    def grab(self) -> bool:
        self._wait()
        return self._kind != "unplugged" or self._count <= 10

    def _wait(self) -> None:
        self._count += 1
        wait = self._started + self._count / FPS - time.monotonic()
        if wait > 0:
            time.sleep(wait)

    def read(self) -> tuple[bool, NDArray[np.uint8] | None]:
        self._wait()
        if self._kind == "stalls" and self._count > 10:
            time.sleep(3600)
        if self._kind == "crashes" and self._count > 10:
            os.abort()
        if self._kind == "unplugged" and self._count > 10:
            return False, None
        if self._kind == "stumbles" and 5 < self._count < 12:
            return False, None
        self._stamp = time.monotonic()
        size = (800, 600) if self._kind == "wrong-size" else self._size
        if size not in self._pictures:
            self._pictures[size] = np.full((size[1], size[0], 3), (10, 20, 30), np.uint8)
        picture = self._pictures[size]
        # The exposure in force can be read off the picture, as in life.
        picture[0, 0] = self._values[cv2.CAP_PROP_EXPOSURE] % 256
        return True, picture[..., 0] if self._kind == "grey" else picture

    def release(self) -> None:
        self._kind = "absent"


def open_fake(address: int | str) -> FakeWebcam:
    return FakeWebcam(address)
