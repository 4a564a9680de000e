"""A depth image drawn as a lit sculpture, so that a tracker made for photographs can read it.

Median, bilateral filter, normals, one lamp, skin colour on grey (METHOD section 4, DEVICES). It serves
recordings without colour, dark rooms, and as a second opinion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera

FloatArray = NDArray[np.float64]

LAMPS: Final[tuple[tuple[float, float, float], ...]] = (
    (-0.35, -0.55, -0.75),
    (0.35, -0.55, -0.75),
    (0.0, -0.25, -0.97),
)
"""Directions towards lamps in camera axes (x right, y down, z away): upper left, upper right, in front."""

_SKIN = np.array([226.0, 178.0, 150.0])
_BACKGROUND = 118
_AMBIENT = 0.28


def shade_depth(
    depth_m: FloatArray,
    mask: NDArray[np.bool_],
    camera: PinholeCamera,
    lamp: tuple[float, float, float] = LAMPS[0],
) -> NDArray[np.uint8]:
    """Shaded relief of a depth image.

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres, 0 where there is no measurement.
    mask : ndarray (h, w) of bool
        The body; everything else becomes plain grey.
    camera : PinholeCamera
        The depth camera.
    lamp : tuple of float
        Direction from the body towards the lamp in camera axes.

    Returns
    -------
    ndarray (h, w, 3) uint8
        RGB.
    """
    return shade_depths(depth_m, mask, camera, (lamp,))[0]


def shade_depths(
    depth_m: FloatArray,
    mask: NDArray[np.bool_],
    camera: PinholeCamera,
    lamps: Sequence[tuple[float, float, float]] = LAMPS,
) -> list[NDArray[np.uint8]]:
    """The same relief under several lamps, one image each; see `shade_depth`."""
    seen = mask & (depth_m > 0)
    plain = np.full((camera.height, camera.width, 3), _BACKGROUND, np.uint8)
    if not seen.any():
        return [plain for _ in lamps]
    filled = _fill(np.where(seen, depth_m, 0.0), seen)
    smooth = cv2.bilateralFilter(cv2.medianBlur(filled, 5), 7, 0.03, 3.0).astype(np.float64)
    normals = _normals(camera.pixel_rays * smooth[..., None], seen)
    near, far = np.percentile(depth_m[seen], [2.0, 98.0])
    haze = 1.0 - 0.25 * np.clip((smooth[seen] - near) / max(far - near, 0.2), 0.0, 1.0)
    images = []
    for lamp in lamps:
        towards = np.asarray(lamp) / np.linalg.norm(lamp)
        light = np.clip(normals @ towards, 0.0, 1.0)
        brightness = (_AMBIENT + (1.0 - _AMBIENT) * light) * haze
        image = plain.copy()
        image[seen] = np.clip(brightness[:, None] * _SKIN, 0, 255).astype(np.uint8)
        images.append(image)
    return images


def _fill(depth: FloatArray, seen: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Depth with the background set to the nearest body pixel's depth, so that no rim is lit falsely."""
    _, label = cv2.distanceTransformWithLabels(
        (~seen).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(label.max()) + 1)
    of_label[label[seen]] = depth[seen]
    return np.asarray(of_label[label], dtype=np.float32)


def _normals(points: FloatArray, seen: NDArray[np.bool_]) -> FloatArray:
    """Unit normals (n, 3) towards the camera at the n seen pixels of an image of points."""
    across = cv2.Sobel(points, cv2.CV_64F, 1, 0, ksize=3)[seen]
    down = cv2.Sobel(points, cv2.CV_64F, 0, 1, ksize=3)[seen]
    normals = np.cross(down, across)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.asarray(normals / np.maximum(length, 1e-12))
