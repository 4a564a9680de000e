"""Pinhole camera with OpenCV's distortion model (thesis eq. 2 and 3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError

FloatArray = NDArray[np.float64]

_DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)

# OpenCV's own five steps leave 0.01 px near the corners of a wide lens.
_UNDISTORT_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-10)


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics of one camera. Axes: x right, y down, z forward; pixel centres at integer coordinates.

    Attributes
    ----------
    width, height : int
        Image size in pixels.
    fx, fy, cx, cy : float
        Focal lengths and principal point in pixels.
    distortion : tuple of float
        OpenCV's order (k1 k2 p1 p2 k3 ...), possibly empty.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        values = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not all(np.isfinite(v) for v in values):
            raise InputError("Camera intrinsics must be finite numbers.")
        if self.width < 1 or self.height < 1 or self.fx <= 0 or self.fy <= 0:
            raise InputError("Camera image size and focal lengths must be positive.")
        if len(self.distortion) not in _DISTORTION_LENGTHS:
            raise InputError("Lens distortion must have 0, 4, 5, 8, 12 or 14 coefficients.")

    def document(self) -> dict[str, Any]:
        """The intrinsics as JSON holds them in capture folders, records and calibrations."""
        return {
            "width": int(self.width),
            "height": int(self.height),
            "fx": float(self.fx),
            "fy": float(self.fy),
            "cx": float(self.cx),
            "cy": float(self.cy),
            "distortion": [float(k) for k in self.distortion],
        }

    @property
    def matrix(self) -> FloatArray:
        """K of thesis eq. 2, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def _coefficients(self) -> FloatArray:
        return np.array(self.distortion or (0.0,) * 5)

    def project(self, points: ArrayLike) -> FloatArray:
        """Pixels (n, 2) of points (n, 3) in this camera's frame; NaN for points not in front of it."""
        p = np.asarray(points, dtype=float).reshape(-1, 3)
        out = np.full((len(p), 2), np.nan)
        front = p[:, 2] > 1e-6
        if front.any():
            if any(self.distortion):
                pixels, _ = cv2.projectPoints(
                    p[front].reshape(-1, 1, 3), np.zeros(3), np.zeros(3), self.matrix, self._coefficients
                )
                out[front] = pixels.reshape(-1, 2)
            else:
                z = p[front, 2]
                out[front, 0] = p[front, 0] / z * self.fx + self.cx
                out[front, 1] = p[front, 1] / z * self.fy + self.cy
        return out

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """Directions (n, 3) with z = 1 through pixels (n, 2): depth times ray is the point (eq. 3)."""
        q = np.asarray(pixels, dtype=float).reshape(-1, 2)
        out = np.ones((len(q), 3))
        if len(q) and any(self.distortion):
            undistorted = cv2.undistortPoints(
                q.reshape(-1, 1, 2), self.matrix, self._coefficients, None, None, None, _UNDISTORT_STOP
            )
            out[:, :2] = undistorted.reshape(-1, 2)
        else:
            out[:, 0] = (q[:, 0] - self.cx) / self.fx
            out[:, 1] = (q[:, 1] - self.cy) / self.fy
        return out

    @cached_property
    def pixel_rays(self) -> FloatArray:
        """Ray of every pixel, (height, width, 3)."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return self.rays(np.stack([u, v], -1)).reshape(self.height, self.width, 3)

    def backproject(self, depth_m: ArrayLike) -> FloatArray:
        """Points (height, width, 3) of a depth image in metres; zero where there is no measurement."""
        z = np.asarray(depth_m, dtype=float)
        if z.shape != (self.height, self.width):
            raise InputError(
                f"The depth image is {z.shape[1]} x {z.shape[0]} pixels, but its camera says "
                f"{self.width} x {self.height}."
            )
        return np.asarray(self.pixel_rays * z[..., None])

    def contains(self, pixels: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether pixels (n, 2) lie inside the image, at least ``margin`` pixels from its border."""
        q = np.asarray(pixels, dtype=float).reshape(-1, 2)
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (q[:, 0] >= margin - 0.5)
                & (q[:, 1] >= margin - 0.5)
                & (q[:, 0] <= self.width - 0.5 - margin)
                & (q[:, 1] <= self.height - 0.5 - margin)
            )
