"""Whether the follow-up's cameras can see a place, by an explicit test.

The carried place is held against the measured depth, the turn of its skin and the frame of both images; the
fit of the registration says nothing about it (METHOD section 4). Skin that has turned away is not carried
quite behind the body: the registration lays it onto the rim. How far it hangs off the skin there and how
differently it is turned tell it from skin that is seen; their weights were learned on the calibration
patients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

FRAME_MARGIN_PX = 2.0
WEIGHTS = (-1.66, -6.59, 1.99, 2.32, 0.56)
"""Of 1, the cosine of the carried skin to the camera, its distance to seen skin in centimetres, the cosine of
that skin, and another stance: a logistic model of being hidden."""
PIXEL_M = 0.006
"""Largest depth pixel on the skin for which distances hold; a coarser camera counts in its own pixels."""
HIDDEN_LOGIT = -1.2
"""From here on a place counts as hidden: 84 % of hidden and 2.5 % of visible calibration places."""
TURNED_COSINE = 0.10
"""Below, the reason told is that the skin has turned away."""
COVERED_M = 0.025
"""Something lies this far before the place."""

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


def look_at(
    places: FloatArray,
    normals: FloatArray,
    surface: BodySurface,
    rig: CameraRig,
    *,
    other_stance: bool,
    depth_excess_m2: float = 0.0,
) -> Sight:
    """Judge carried places (k, 3) with their normals (k, 3) in the depth-camera frame of the follow-up.

    Of their distance to the seen skin, what the sensors err more than a Kinect v1 is taken off
    (`core.relocation.depth_floor`).
    """
    if len(places) == 0:
        return Sight((), np.zeros(0), np.zeros(0))
    eyes = [np.zeros(3)]
    inside = rig.depth.contains(rig.depth.project(places), FRAME_MARGIN_PX)
    if rig.color is not None:
        eyes.append(rig.picture_from_depth.inverse().translation)
        inside &= rig.color.contains(rig.project_to_picture(places), FRAME_MARGIN_PX)
    nearest = surface.nearest_arrays(places)[2]
    off = np.linalg.norm(nearest - places, axis=1)
    if depth_excess_m2 > 0:
        off = np.sqrt(np.maximum(off**2 - depth_excess_m2, 0.0))
    cosine = np.ones(len(places))
    covered = np.zeros(len(places), bool)
    for eye in eyes:
        way = eye - places
        length = np.linalg.norm(way, axis=1)
        cosine = np.minimum(cosine, np.einsum("ki,ki->k", normals, way) / length)
        hits = surface.raycast(eye, -way / length[:, None])
        covered |= hits.hit & (hits.t < length - COVERED_M)
    coarse = min(1.0, PIXEL_M * rig.depth.fx / float(np.median(surface.vertices[:, 2])))
    logit = _logit(cosine, coarse * off, surface, nearest, other_stance)
    hidden = tuple(
        OUTSIDE
        if not inside[k]
        else COVERED
        if covered[k]
        else ""
        if logit[k] <= HIDDEN_LOGIT
        else TURNED
        if cosine[k] < TURNED_COSINE
        else BEYOND
        for k in range(len(places))
    )
    return Sight(hidden, cosine, off)


def _logit(
    cosine: FloatArray, off_m: FloatArray, surface: BodySurface, nearest: FloatArray, other_stance: bool
) -> FloatArray:
    """Logit (k,) of a place's being hidden."""
    normal = surface.normals[surface.nearest_vertex(nearest)]
    facing = -np.einsum("ki,ki->k", normal, nearest) / np.linalg.norm(nearest, axis=1)
    one, carried, off, seen, stance = WEIGHTS
    return np.asarray(
        one
        + carried * np.clip(cosine, -0.3, 0.8)
        + off * 100.0 * np.minimum(off_m, 0.04)
        + seen * np.clip(facing, 0.0, 1.0)
        + stance * float(other_stance)
    )
