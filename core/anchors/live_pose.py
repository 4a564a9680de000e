"""A skeleton from moment to moment: light enough for the viewfinder, never stored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from core.anchors.lifting import interior_m
from core.anchors.names import BONES
from core.anchors.skeleton import VISIBLE
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]

LiveSource = Literal["color", "relief"]

_PATCH_M: Final = 0.03
_STRIDE: Final = 3
_LEAST_PIXELS: Final = 4
_NEAR_PERCENTILE: Final = 25.0


@dataclass(frozen=True, eq=False)
class LiveJoint:
    """One joint now.

    Attributes
    ----------
    pixel : ndarray (2,)
        In the picture given to `LiveSkeleton.update` (the depth image for source "relief").
    visibility : float
        0 to 1; falls while a lost joint is held.
    point_m : ndarray (3,) or None
        Joint centre in the depth-camera frame; None without depth there. Centimetres, not millimetres.
    age_s : float
        Time since it was really seen; 0 is now.
    """

    pixel: FloatArray
    visibility: float
    point_m: FloatArray | None = None
    age_s: float = 0.0


@dataclass(frozen=True, eq=False)
class LivePose:
    """The person before the camera now.

    Attributes
    ----------
    joints : mapping of str to LiveJoint
        The 15 joints and the extra landmarks, those whose place is known.
    time_s : float
        Of the picture.
    source : {"color", "relief"}
    size : (int, int)
        Width and height of the image of the pixels.
    age_s : float
        Time since a person was last detected; 0 is now.
    """

    joints: Mapping[str, LiveJoint]
    time_s: float
    source: LiveSource
    size: tuple[int, int]
    age_s: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", MappingProxyType(dict(self.joints)))

    def visible(self) -> tuple[str, ...]:
        """Names of the joints and landmarks that are seen."""
        return tuple(name for name, joint in self.joints.items() if joint.visibility >= VISIBLE)

    def sees(self, *names: str) -> bool:
        """Whether all these are seen."""
        return all(n in self.joints and self.joints[n].visibility >= VISIBLE for n in names)

    def bones(self) -> tuple[tuple[str, str], ...]:
        """Bones with both ends seen, for drawing."""
        return tuple(bone for bone in BONES if self.sees(*bone))

    @property
    def has_points(self) -> bool:
        """Whether any joint has a place in space."""
        return any(joint.point_m is not None for joint in self.joints.values())


def depths_under(pixels: FloatArray, depth_m: NDArray[np.floating], rig: CameraRig) -> FloatArray:
    """Depth (n,) of the skin under pixels (n, 2) of the picture, along the picture camera's axis; else NaN.

    A coarse look for live use (a ninth of the depth pixels, no body mask): the near side of a patch of some
    3 cm, so that a limb wins against the wall behind it.
    """
    out = np.full(len(pixels), np.nan)
    wanted = np.isfinite(pixels).all(axis=1)
    if not wanted.any():
        return out
    sparse = np.asarray(depth_m[::_STRIDE, ::_STRIDE], dtype=np.float32)
    measured = sparse > 0
    points = _sparse_rays(rig.depth)[measured] * sparse[measured][:, None]
    turn = rig.picture_from_depth
    in_picture = points @ turn.rotation.T.astype(np.float32) + turn.translation.astype(np.float32)
    z = in_picture[:, 2]
    # compared as directions, not pixels: the lens is undone for a few pixels instead of for every point
    across = in_picture[:, :2] / np.maximum(z, 0.1)[:, None]
    reach = _PATCH_M / np.maximum(z, 0.2)
    x, y = across[:, 0], across[:, 1]
    rays = rig.picture_camera.rays(pixels[wanted]).astype(np.float32)
    for k, ray in zip(np.flatnonzero(wanted), rays, strict=True):
        rows = np.flatnonzero(np.abs(x - ray[0]) < reach)
        near = z[rows[np.abs(y[rows] - ray[1]) < reach[rows]]]
        if len(near) >= _LEAST_PIXELS:
            out[k] = np.percentile(near, _NEAR_PERCENTILE)
    return out


@lru_cache(maxsize=4)
def _sparse_rays(camera: PinholeCamera) -> NDArray[np.float32]:
    return camera.pixel_rays[::_STRIDE, ::_STRIDE].astype(np.float32)


def points_at(names: tuple[str, ...], pixels: FloatArray, depths: FloatArray, rig: CameraRig) -> FloatArray:
    """Joint centres (n, 3) in the depth-camera frame behind skin at these depths; NaN where unknown."""
    inside = np.array([interior_m(name) for name in names])
    origin, rays = rig.picture_rays(np.nan_to_num(pixels))
    points = origin + rays * (depths + inside)[:, None]
    return np.asarray(np.where(np.isfinite(pixels).all(axis=1, keepdims=True), points, np.nan))
