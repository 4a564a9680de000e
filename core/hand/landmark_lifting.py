"""The measured surface under landmarks of a picture: what a landmark needs to become a place in space.

A single pixel is not enough: beside a finger it hits the wall behind, and its noise is that of one pixel. The
near layer of a small patch is taken (a low percentile of its depths, then the median of what lies within
reach of that), and the place is where the landmark's ray meets it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]

PATCH_M: Final = 0.006
"""Radius of the patch under a landmark."""

PERCENTILE: Final = 15.0
"""Of the depths in a patch: the hand before what is behind it."""

LAYER_M: Final = 0.010
"""What is farther than this behind the near side of the patch belongs to another surface."""

LEAST_PIXELS: Final = 4

_RANGE_M: Final = (0.35, 2.0)
"""Where a hand can be."""


@dataclass(frozen=True, eq=False)
class PictureDepth:
    """A depth image as the picture's camera sees it, looked up patch by patch.

    Attributes
    ----------
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    rig : CameraRig
    """

    depth_m: FloatArray
    rig: CameraRig

    def patch(self, pixel: FloatArray, radius_m: float = PATCH_M) -> tuple[FloatArray, FloatArray]:
        """Measured points around one picture pixel (2,).

        Returns
        -------
        pixels : ndarray (n, 2)
            Where the picture shows them.
        depths_m : ndarray (n,)
            Along the optical axis of the picture's camera.
        """
        rows, columns = self._window(pixel, radius_m)
        crop = self.depth_m[rows, columns]
        measured = (crop > _RANGE_M[0]) & (crop < _RANGE_M[1])
        rays = self.rig.depth.pixel_rays[rows, columns][measured]
        points = self.rig.picture_from_depth.apply(rays * crop[measured][:, None])
        pixels = self.rig.picture_camera.project(points)
        # the patch is a size on the hand: its size in pixels follows from the depth that it finds
        apart = ((pixels - pixel) ** 2).sum(axis=1)
        inside = apart < (self._focal_px * radius_m / points[:, 2]) ** 2
        return pixels[inside], points[inside, 2]

    def near_layer_m(
        self, pixel: FloatArray, radius_m: float = PATCH_M, farthest_m: float = _RANGE_M[1]
    ) -> float:
        """Depth of the nearest surface in the patch under a picture pixel (2,); NaN if none is measured.

        What is farther than ``farthest_m`` counts as not measured.
        """
        depths = self.patch(pixel, radius_m)[1]
        depths = depths[depths < farthest_m]
        if len(depths) < LEAST_PIXELS:
            return float("nan")
        near = np.percentile(depths, PERCENTILE, method="lower")
        return float(np.median(depths[np.abs(depths - near) < LAYER_M]))

    @property
    def _focal_px(self) -> float:
        camera = self.rig.picture_camera
        return 0.5 * (camera.fx + camera.fy)

    def _window(self, pixel: FloatArray, radius_m: float) -> tuple[slice, slice]:
        """The part of the depth image in which the surface under a pixel can be: a strip, for two cameras."""
        camera = self.rig.depth
        ends = camera.project(on_rays(np.tile(pixel, (2, 1)), np.array(_RANGE_M), self.rig))
        if not np.isfinite(ends).all():
            return slice(0, 0), slice(0, 0)
        margin = max(camera.fx, camera.fy) * radius_m / _RANGE_M[0] + 1
        (u0, v0), (u1, v1) = np.floor(ends.min(axis=0) - margin), np.ceil(ends.max(axis=0) + margin) + 1
        return slice(max(int(v0), 0), max(int(v1), 0)), slice(max(int(u0), 0), max(int(u1), 0))


def on_rays(pixels: FloatArray, depths_m: FloatArray, rig: CameraRig) -> FloatArray:
    """Points (k, 3) in the depth camera's frame on the rays of picture pixels (k, 2), at depths (k,)."""
    origin, along = rig.picture_rays(pixels)
    return np.asarray(origin + along * depths_m[:, None])
