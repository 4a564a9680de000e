"""Edge-preserving smoothing of a depth image, for noise lengthens every geodesic (METHOD section 2)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.surface.threads import in_chunks

FloatArray = NDArray[np.float64]

_ROWS = 32


def denoise_depth(depth_m: FloatArray, *, sigma_px: float = 1.5, gate_m: float = 0.020) -> FloatArray:
    """Replace each depth by the plane fitted to its neighbourhood in inverse depth.

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres; 0 means no measurement and stays so.
    sigma_px : float
        Standard deviation of the neighbours' Gaussian weights.
    gate_m : float
        Neighbours that differ by more in depth do not count, so that an arm does not melt into the torso
        behind it.
    """
    from core.surface.depth_kernels import fit_planes

    radius = max(1, int(np.ceil(2.5 * sigma_px)))
    steps = np.arange(-radius, radius + 1) ** 2
    weights = np.exp(-(steps[:, None] + steps[None]) / (2.0 * sigma_px**2)).astype(np.float32)
    depth = np.pad(np.asarray(depth_m, dtype=np.float32), radius)
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=depth > 0)
    # In a noisy single frame the gate must not sit on the pixel's own error.
    median = cv2.medianBlur(depth, 5)
    reference = np.where(np.abs(median - depth) < gate_m, median, depth)
    out = np.empty(np.shape(depth_m))
    in_chunks(
        lambda first, last: fit_planes(depth, inverse, reference, weights, gate_m, out, first, last),
        len(out),
        _ROWS,
    )
    return out
