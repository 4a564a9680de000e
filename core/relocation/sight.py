"""Whether the follow-up's cameras can see a place, by an explicit test.

The carried place is held against the measured depth, the turn of its skin and the frame of both images; the
fit of the registration says nothing about it (METHOD section 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

FRAME_MARGIN_PX = 2.0
TURNED_COSINE = -0.10
"""Of the angle between carried skin and the camera: below, the skin has turned away."""
COVERED_M = 0.025
"""Something lies this far before the place."""
OFF_SKIN_M = 0.018
"""The place is this far from all skin that was seen."""

OUTSIDE = "The place lies outside the picture."
TURNED = "The skin there is turned away from the camera."
COVERED = "Another part of the body covers the place."
BEYOND = "The place lies beyond the edge of the skin that this view shows."


@dataclass(frozen=True, eq=False)
class Sight:
    """What the cameras can see of carried places.

    Attributes
    ----------
    hidden : tuple of str (k)
        Why a place cannot be seen; empty where it can.
    cosine : ndarray (k,)
        Of the skin's normal with the way to the camera; 1 is square on.
    off_m : ndarray (k,)
        Distance to the nearest skin that was seen.
    """

    hidden: tuple[str, ...]
    cosine: FloatArray
    off_m: FloatArray


def look_at(places: FloatArray, normals: FloatArray, surface: BodySurface, rig: CameraRig) -> Sight:
    """Judge carried places (k, 3) with their normals (k, 3) in the depth-camera frame of the follow-up."""
    if len(places) == 0:
        return Sight((), np.zeros(0), np.zeros(0))
    eyes = [np.zeros(3)]
    inside = rig.depth.contains(rig.depth.project(places), FRAME_MARGIN_PX)
    if rig.color is not None:
        eyes.append(rig.picture_from_depth.inverse().translation)
        inside &= rig.color.contains(rig.project_to_picture(places), FRAME_MARGIN_PX)
    nearest = np.array([p.position_m for p in surface.nearest(places)])
    off = np.linalg.norm(nearest - places, axis=1)
    cosine = np.ones(len(places))
    covered = np.zeros(len(places), bool)
    for eye in eyes:
        way = eye - places
        length = np.linalg.norm(way, axis=1)
        cosine = np.minimum(cosine, np.einsum("ki,ki->k", normals, way) / length)
        hits = surface.raycast(eye, -way / length[:, None])
        covered |= hits.hit & (hits.t < length - COVERED_M)
    hidden = tuple(
        OUTSIDE
        if not inside[k]
        else TURNED
        if cosine[k] < TURNED_COSINE
        else COVERED
        if covered[k]
        else BEYOND
        if off[k] > OFF_SKIN_M
        else ""
        for k in range(len(places))
    )
    return Sight(hidden, cosine, off)
