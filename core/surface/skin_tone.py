"""The person's own skin colour, measured in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture

FloatArray = NDArray[np.float64]

_LEAST_SKIN_SHARE = 0.04
_MAX_SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class SkinTone:
    """The person's own skin in CIE Lab (OpenCV's float scale): median and robust spread of L, a, b."""

    center: FloatArray
    spread: FloatArray


def measure_skin_tone(capture: RgbdCapture, body_pixels: FloatArray) -> SkinTone | None:
    """The person's skin tone; None if there is no picture or too little of it looks like skin.

    Parameters
    ----------
    body_pixels : ndarray (n, 2)
        Picture pixels on the body.
    """
    if capture.color is None:
        return None
    pixels = body_pixels[:: max(1, len(body_pixels) // _MAX_SAMPLES)]
    pixels = pixels[capture.rig.picture_camera.contains(pixels)]
    if len(pixels) == 0:
        return None
    u, v = np.rint(pixels).astype(int).T
    rgb = capture.color[v, u]
    lab = to_lab(rgb)
    hue = np.degrees(np.arctan2(lab[:, 2], lab[:, 1]))
    chroma = np.hypot(lab[:, 1], lab[:, 2])
    loose = (lab[:, 0] > 15) & (hue > 10) & (hue < 80) & (chroma > 8) & (chroma < 55)
    if loose.mean() < _LEAST_SKIN_SHARE or loose.sum() < 200:
        return None
    skin = np.ascontiguousarray(lab[loose].T)  # medians of rows are found faster than those of columns
    for _ in range(3):
        center = np.median(skin, axis=1)
        away = np.abs(skin - center[:, None])
        spread = np.maximum(1.4826 * np.median(away, axis=1), (4.0, 2.0, 2.0))
        inlier = (away < 3.0 * spread[:, None]).all(axis=0)
        if inlier.sum() < 100:
            break
        skin = skin[:, inlier]
    return SkinTone(center, spread)


def to_lab(rgb: NDArray[np.uint8]) -> FloatArray:
    """CIE Lab (n, 3) of RGB colours (n, 3): L 0..100."""
    scaled = rgb.reshape(-1, 1, 3).astype(np.float32) / 255.0
    return np.asarray(cv2.cvtColor(scaled, cv2.COLOR_RGB2Lab).reshape(-1, 3), dtype=float)
