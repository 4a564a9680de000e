"""The 15 points of a hand by a landmark detector and the depth image alone, without geodesics.

This is what the geodesic points are measured against, so it is made as good as it gets: every choice here was
made on simulated hands for the smallest error of these points.

* A detector's landmark is not our point: its knuckles lie nearer to the wrist, its joints inside the finger,
  its fingertips farther in. `SHIFTS` moves each on the picture to where our point is seen, in parts of the
  palm's width and length (the median error falls from 8.5 to 4 mm).
* The depth is the near layer of a small patch, larger where nothing was measured; what lies far behind the
  palm is the wall beside a finger.
* Where the measured surface lies clearly before the landmark's own idea of its depth, the point is hidden,
  and the idea is what there is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.hand.landmark_lifting import PictureDepth, on_rays
from core.hand.landmarks import HandLandmarks, landmark
from core.hand.names import POINT_NAMES
from core.hand.palm_anchors import PALM_LANDMARKS

FloatArray = NDArray[np.float64]

NAIL: Final = 0.8
"""Part of the last phalanx at which a tip lies (`core.hand.names`)."""

SHIFTS: Final = np.array(
    [
        (0.106, 0.012),
        (0.141, -0.049),
        (0.104, -0.121),
        (-0.001, 0.055),
        (0.007, 0.017),
        (0.035, 0.099),
        (-0.026, 0.076),
        (-0.046, 0.046),
        (-0.032, 0.108),
        (-0.005, 0.080),
        (-0.030, 0.037),
        (-0.044, 0.107),
        (-0.012, 0.044),
        (-0.037, 0.037),
        (-0.062, 0.089),
    ]
)
"""From a landmark to our point on the picture: parts of the way from the little finger's knuckle to the
index finger's, and from the wrist to the middle finger's knuckle. Robust fit to the tuning hands."""

RADII_M: Final = (0.004, 0.008, 0.014)
"""Of the patch: the next one where the one before holds no measurement."""

HIDDEN_M: Final = 0.030
"""A surface that is this much nearer than the landmark hides it."""

BEHIND_M: Final = 0.12
"""What is farther behind the middle of the palm is not the hand."""

_POINT_LANDMARKS: Final = tuple(
    landmark(finger, part) for finger in range(5) for part in ((3, 2, 1) if finger == 0 else (3, 1, 0))
)
"""The landmark at each point; a tip lies a little before its landmark."""


@dataclass(frozen=True, eq=False)
class LandmarkPoints:
    """Points of a hand, by landmarks.

    Attributes
    ----------
    points_m : ndarray (15, 3)
        Depth-camera frame; all NaN if the depth camera does not measure the palm.
    visible : ndarray (15,) bool
        A guess: no surface was measured before the point.
    """

    points_m: FloatArray
    visible: NDArray[np.bool_]


def landmark_points(
    landmarks: HandLandmarks, depth_m: FloatArray, rig: CameraRig, *, aligned: bool = True
) -> LandmarkPoints:
    """Lift landmarks to the 15 points.

    Parameters
    ----------
    landmarks : HandLandmarks
        On the picture of ``rig.picture_camera``.
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    rig : CameraRig
    aligned : bool
        Move the landmarks to our points first (`SHIFTS`); otherwise they are taken as they are.
    """
    skin = PictureDepth(depth_m, rig)
    palm_px = landmarks.pixels[list(PALM_LANDMARKS)]
    palm_m = np.array([skin.near_layer_m(pixel) for pixel in palm_px])
    if not np.isfinite(palm_m).any():
        return LandmarkPoints(np.full((len(POINT_NAMES), 3), np.nan), np.zeros(len(POINT_NAMES), bool))
    middle_m = float(np.nanmedian(palm_m))
    # the landmarks' own depth is in picture widths: at the palm's distance it becomes metres
    scale = rig.picture_camera.width / rig.picture_camera.fx * middle_m
    own_m = landmarks.relative_depth * scale
    own_m = own_m + np.nanmedian(palm_m - own_m[list(PALM_LANDMARKS)])
    pixels, expected = _on_points(landmarks.pixels), _on_points(own_m[:, None])[:, 0]
    if aligned:
        palm = np.array([palm_px[1] - palm_px[4], palm_px[2] - palm_px[0]])
        pixels = pixels + SHIFTS @ palm
    measured = np.array([_measured(skin, pixel, middle_m + BEHIND_M) for pixel in pixels])
    hidden = measured < expected - HIDDEN_M
    known = np.isfinite(measured)
    depths = np.where(known & ~hidden, measured, expected)
    return LandmarkPoints(on_rays(pixels, depths, rig), known & ~hidden)


def _on_points(values: FloatArray) -> FloatArray:
    """Values (21, d) of the landmarks taken to our points (15, d)."""
    out = values[list(_POINT_LANDMARKS)].copy()
    for tip in range(0, len(out), 3):
        row = _POINT_LANDMARKS[tip]
        out[tip] = values[row - 1] + NAIL * (values[row] - values[row - 1])
    return np.asarray(out)


def _measured(skin: PictureDepth, pixel: FloatArray, farthest_m: float) -> float:
    for radius in RADII_M:
        depth = skin.near_layer_m(pixel, radius, farthest_m)
        if np.isfinite(depth):
            return depth
    return float("nan")
