"""From a camera's images to what is painted. OpenCV does the work and lets other threads run meanwhile."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QImage

from app.live.status import Shown

NEAR_M: Final = 0.6
FAR_M: Final = 4.0


def fitted(size: tuple[int, int], room: tuple[int, int]) -> tuple[int, int]:
    """The largest width and height of the shape of ``size`` within ``room``."""
    scale = min(room[0] / size[0], room[1] / size[1])
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


def show_color(rgb: NDArray[np.uint8], room: tuple[int, int], number: int, time_s: float) -> Shown:
    """The colour picture in the size in which it is painted."""
    size = (rgb.shape[1], rgb.shape[0])
    to = fitted(size, room)
    shrinking = to[0] < size[0]
    small = cv2.resize(rgb, to, interpolation=cv2.INTER_AREA if shrinking else cv2.INTER_LINEAR)
    return _shown(np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2BGRA), np.uint8), size, number, time_s)


def show_depth(
    depth: NDArray[np.uint16], unit_m: float, room: tuple[int, int], number: int, time_s: float
) -> Shown:
    """The depth as a quiet grey picture: near is light, unmeasured is dark."""
    size = (depth.shape[1], depth.shape[0])
    to = fitted(size, room)
    small = cv2.resize(depth, to, interpolation=cv2.INTER_NEAREST)
    scale = -200.0 * unit_m / (FAR_M - NEAR_M)
    grey = cv2.convertScaleAbs(small.astype(np.float32), alpha=1.0, beta=0.0)
    grey = np.clip(small * np.float32(scale) + np.float32(40 + 200 * FAR_M / (FAR_M - NEAR_M)), 40, 240)
    grey[small == 0] = 20
    pixels = cv2.cvtColor(grey.astype(np.uint8), cv2.COLOR_GRAY2BGRA)
    return _shown(np.asarray(pixels, np.uint8), size, number, time_s)


def _shown(pixels: NDArray[np.uint8], size: tuple[int, int], number: int, time_s: float) -> Shown:
    height, width = pixels.shape[:2]
    image = QImage(pixels.data, width, height, pixels.strides[0], QImage.Format.Format_RGB32)
    return Shown(image, pixels, size, number, time_s)
