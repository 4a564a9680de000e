"""Many depth frames of one stance become one depth image and its noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.surface.threads import in_chunks

FloatArray = NDArray[np.float64]

_ROWS = 32


@dataclass(frozen=True, eq=False)
class FusedDepth:
    """The robust mean of the frames of one stance.

    Attributes
    ----------
    depth_m : ndarray (h, w)
        Metres; 0 means no reliable measurement.
    noise_m : ndarray (h, w)
        Standard deviation of a single measurement, metres; NaN where fewer than two frames agree.
    frames : int
        How many frames were fused.
    """

    depth_m: FloatArray
    noise_m: FloatArray
    frames: int


def fuse_depth(
    frames: NDArray[np.uint16], unit_m: float, *, gate_m: float = 0.025, share: float = 0.3
) -> FusedDepth:
    """Fuse the frames of one stance pixel by pixel (METHOD section 2).

    The answer is the mean of the measurements within ``gate_m`` of their median, where at least ``share`` of
    the frames agree: a pixel that flickers between arm and wall takes one side or none, never the middle.

    Parameters
    ----------
    frames : ndarray (n, h, w) uint16
        Raw depth, 0 means no measurement.
    unit_m : float
        Metres per raw unit.
    """
    if frames.ndim != 3 or len(frames) == 0 or frames.dtype != np.uint16:
        raise InputError("Fusing needs at least one 16-bit depth frame.")
    from core.surface.depth_kernels import fuse_frames

    n, height, width = frames.shape
    mean, spread = np.empty((height, width)), np.empty((height, width))
    least = max(1, int(np.ceil(share * n)))
    frames = np.ascontiguousarray(frames)
    gate = max(1, round(gate_m / unit_m))
    in_chunks(lambda first, last: fuse_frames(frames, gate, least, mean, spread, first, last), height, _ROWS)
    return FusedDepth(mean * unit_m, spread * unit_m, n)
