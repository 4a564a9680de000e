"""The outline of an earlier capture in the present picture, so that a stance can be repeated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig, RgbdCapture
from core.surface import fuse_depth, segment_body

FloatArray = NDArray[np.float64]

_STRIDE: Final = 2
_SMOOTH_M: Final = 0.012
_SPECK_PX: Final = 60.0


@dataclass(frozen=True, eq=False)
class Ghost:
    """Where a body was.

    Attributes
    ----------
    points_m : ndarray (n, 3)
        On the body, in the depth camera's frame.
    spacing_m : float
        Between neighbours.
    """

    points_m: FloatArray
    spacing_m: float

    @classmethod
    def of_capture(cls, capture: RgbdCapture) -> Ghost:
        """The body of a capture; a single depth frame is enough.

        Raises
        ------
        WorkError
            If there is no body.
        """
        fused = fuse_depth(capture.depth_frames, capture.depth_unit_m)
        camera = capture.rig.depth
        mask = segment_body(fused.depth_m, camera).mask
        points = camera.backproject(fused.depth_m)
        inner = points[::_STRIDE, ::_STRIDE][mask[::_STRIDE, ::_STRIDE]]
        distance = float(np.median(inner[:, 2]))
        return cls(inner, _STRIDE * distance / camera.fx)

    def outlines(self, rig: CameraRig) -> list[FloatArray]:
        """Closed outlines (n, 2) in pixels of the picture of a rig that stands where the old one stood."""
        camera = rig.picture_camera
        share = min(1.0, 640 / camera.width)
        width, height = round(camera.width * share), round(camera.height * share)
        pixels = (rig.project_to_picture(self.points_m) + 0.5) * share - 0.5
        at = np.rint(pixels[np.isfinite(pixels).all(1)]).astype(int)
        ok = (at >= 0).all(1) & (at[:, 0] < width) & (at[:, 1] < height)
        shown = np.zeros((height, width), np.uint8)
        shown[at[ok, 1], at[ok, 0]] = 1
        distance = float(np.median(self.points_m[:, 2])) if len(self.points_m) else 1.0
        pixels_per_m = camera.fx * share / distance
        gap = max(3, round((1.6 * self.spacing_m + _SMOOTH_M) * pixels_per_m)) | 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (gap, gap))
        padded = np.pad(shown, gap)
        closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)
        smooth = cv2.GaussianBlur(255 * closed, (0, 0), 1.5)
        found, _ = cv2.findContours(
            (smooth > 127).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE
        )
        return [
            (contour[:, 0].astype(float) - gap + 0.5) / share - 0.5
            for contour in found
            if cv2.contourArea(contour) >= _SPECK_PX
        ]
