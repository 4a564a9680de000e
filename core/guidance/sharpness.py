"""How blurred a picture is, in pixels, from the width of its edges.

An edge of contrast C that is blurred with a Gaussian of standard deviation s has a largest slope of
C / (s sqrt(2 pi)). Blurring the picture once more with a known s0 makes that C / (sqrt(s^2 + s0^2)
sqrt(2 pi)): the ratio R of both slopes gives s = s0 / sqrt(R^2 - 1), whatever the contrast (Zhuo and Sim,
Pattern Recognition 44, 2011). Motion blurs along its direction only, so both directions are measured and the
worse one counts.
"""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from core.guidance.readings import Reading, unknown

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHARP_PX: Final = 1.4
BLURRED_PX: Final = 1.9
"""Standard deviations of the blur, in pixels of a picture 640 wide."""

_AGAIN_PX: Final = 1.2
_DENOISE_PX: Final = 0.7
_SLOPE: Final = 5.0
_FEWEST: Final = 40


def edge_blur(grey: NDArray[np.uint8], where: BoolArray | None = None) -> tuple[float, float] | None:
    """Blur across (x, y) of the sharper edges, standard deviations in pixels; None without edges.

    Parameters
    ----------
    grey : ndarray (h, w) uint8
    where : ndarray (h, w) bool, optional
        Edges outside do not count.
    """
    once = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), _DENOISE_PX)
    twice = cv2.GaussianBlur(once, (0, 0), _AGAIN_PX)
    found: list[float] = []
    for axis in (1, 0):
        kernel = (1, 0) if axis == 1 else (0, 1)
        before, after = (
            np.abs(cv2.Sobel(p, cv2.CV_32F, *kernel, ksize=3, scale=0.25)) for p in (once, twice)
        )
        peak = before > _SLOPE
        # only the crest of an edge follows the formula
        for shift in (1, -1):
            peak &= before >= np.roll(before, shift, axis=axis)
        if where is not None:
            peak &= where
        if int(peak.sum()) < _FEWEST:
            continue
        ratio = before[peak] / np.maximum(after[peak], 1e-3)
        spread = _AGAIN_PX / np.sqrt(np.maximum(ratio, 1.02) ** 2 - 1.0)
        wide = float(np.percentile(spread, 30))
        found.append(float(np.sqrt(max(wide**2 - _DENOISE_PX**2, 0.0))))
    if not found:
        return None
    return (found[0], found[-1])


def blur_reading(grey: NDArray[np.uint8], person: BoolArray) -> Reading:
    """Blur of the picture at the person."""
    around = np.asarray(cv2.dilate(person.astype(np.uint8), np.ones((7, 7), np.uint8))) > 0
    rows, columns = (np.flatnonzero(around.any(axis=k)) for k in (1, 0))
    if not len(rows):
        return unknown("blur")
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    found = edge_blur(grey[box], around[box])
    if found is None:
        return unknown("blur")
    worst = max(found)
    if worst > BLURRED_PX:
        return Reading("blur", worst, "px", "bad", "The picture is blurred: hold still, give more light.")
    if worst > SHARP_PX:
        return Reading("blur", worst, "px", "fair", "The picture is a little blurred.")
    return Reading("blur", worst, "px", "good")
