"""One depth image of a capture: of a still hand all frames count, of a moving one only the first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.surface.fusion import fuse_depth

FloatArray = NDArray[np.float64]

_REACH_M = 1.2
_MOVED_M = 0.015
_MOVED_SHARE = 0.12


def still_depth(capture: RgbdCapture) -> FloatArray:
    """Depth (h, w) of a capture in metres, 0 for no measurement.

    Several frames are fused if the hand kept still, which lowers the noise. The frames of a moving hand would
    make a surface that never was: then the first is taken, which the colour picture goes with.
    """
    frames, unit_m = capture.depth_frames, capture.depth_unit_m
    if len(frames) == 1 or not _still(frames, unit_m):
        return np.asarray(frames[0] * unit_m, dtype=float)
    return fuse_depth(frames, unit_m).depth_m


def _still(frames: NDArray[np.uint16], unit_m: float) -> bool:
    """Whether what is near in the first frame is at the same distance in the middle and last ones.

    Rims flicker by themselves, which the share allows for.
    """
    first = frames[0] * unit_m
    near = (first > 0) & (first < _REACH_M)
    if not near.any():
        return True
    later = [frames[len(frames) // 2], frames[-1]]
    moved = [np.mean(np.abs(frame[near] * unit_m - first[near]) > _MOVED_M) for frame in later]
    return bool(max(moved) <= _MOVED_SHARE)
