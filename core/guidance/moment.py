"""One moment before the camera, small enough to be judged many times a second."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from core.anchors.live_pose import LivePose
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]

COARSE_WIDTH: Final = 160
"""Depth is judged on a grid of about this width."""

PICTURE_WIDTH: Final = 640
"""Colour is judged on a picture of at most this width."""


@dataclass(frozen=True, eq=False)
class Moment:
    """Depth, colour and joints of one moment.

    Attributes
    ----------
    time_s : float
    depth_m : ndarray (h, w) float64
        Coarse depth, 0 where there is no measurement.
    camera : PinholeCamera
        Of the coarse depth.
    rgb : ndarray (h', w', 3) uint8 or None
        At most `PICTURE_WIDTH` wide.
    rig : CameraRig
        Of the full images.
    pose : LivePose or None
        Of the person, in pixels of the full picture.
    """

    time_s: float
    depth_m: FloatArray
    camera: PinholeCamera
    rgb: NDArray[np.uint8] | None
    rig: CameraRig
    pose: LivePose | None = None

    @classmethod
    def of(
        cls,
        time_s: float,
        depth: NDArray[np.uint16],
        depth_unit_m: float,
        rgb: NDArray[np.uint8] | None,
        rig: CameraRig,
        pose: LivePose | None = None,
    ) -> Moment:
        """Coarse depth and a small picture from the images of a camera."""
        step = max(1, rig.depth.width // COARSE_WIDTH)
        coarse = depth[step // 2 :: step, step // 2 :: step].astype(np.float64) * depth_unit_m
        return cls(time_s, coarse, coarse_camera(rig.depth, step), _small(rgb), rig, pose)

    @property
    def step(self) -> int:
        """Pixels of the full depth image from one coarse pixel to the next."""
        return max(1, self.rig.depth.width // COARSE_WIDTH)

    @cached_property
    def points(self) -> FloatArray:
        """Points (h, w, 3) of the coarse depth."""
        return self.camera.backproject(self.depth_m)

    @cached_property
    def grey(self) -> NDArray[np.uint8] | None:
        """Brightness of the picture."""
        return None if self.rgb is None else np.asarray(cv2.cvtColor(self.rgb, cv2.COLOR_RGB2GRAY), np.uint8)

    @property
    def picture_scale(self) -> float:
        """Pixels of `rgb` for one of the full picture."""
        return 1.0 if self.rgb is None else self.rgb.shape[1] / self.rig.picture_camera.width

    @property
    def picture_focal(self) -> float:
        """Focal length in pixels of `rgb`."""
        return self.rig.picture_camera.fx * self.picture_scale

    def to_picture(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of `rgb` that show points (n, 3)."""
        return (self.rig.project_to_picture(points) + 0.5) * self.picture_scale - 0.5

    def picture_mask(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
        """The part of `rgb` that shows a coarse mask."""
        if self.rgb is None:
            return None
        height, width = self.rgb.shape[:2]
        pixels = self.to_picture(self.points[mask])
        at = np.rint(pixels[np.isfinite(pixels).all(1)]).astype(int)
        inside = (at[:, 0] >= 0) & (at[:, 0] < width) & (at[:, 1] >= 0) & (at[:, 1] < height)
        shown = np.zeros((height, width), np.uint8)
        shown[at[inside, 1], at[inside, 0]] = 1
        gap = int(np.ceil(self.picture_focal / self.camera.fx)) | 1
        return np.asarray(cv2.morphologyEx(shown, cv2.MORPH_CLOSE, np.ones((gap + 2, gap + 2), np.uint8))) > 0


@lru_cache(maxsize=8)
def coarse_camera(camera: PinholeCamera, step: int) -> PinholeCamera:
    """The camera of every ``step``-th pixel, from the middle of the first ones."""
    first = step // 2
    return PinholeCamera(
        len(range(first, camera.width, step)),
        len(range(first, camera.height, step)),
        camera.fx / step,
        camera.fy / step,
        (camera.cx - first) / step,
        (camera.cy - first) / step,
        camera.distortion,
    )


def _small(rgb: NDArray[np.uint8] | None) -> NDArray[np.uint8] | None:
    if rgb is None or rgb.shape[1] <= PICTURE_WIDTH:
        return rgb
    height = round(rgb.shape[0] * PICTURE_WIDTH / rgb.shape[1])
    return np.asarray(cv2.resize(rgb, (PICTURE_WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)
