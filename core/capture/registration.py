"""Colour-depth registration (thesis eq. 2 to 4): depth seen by the colour camera, colour on depth."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig, FloatArray
from core.errors import InputError


def register_depth_to_color(depth_m: FloatArray, rig: CameraRig, *, jump_m: float = 0.05) -> FloatArray:
    """The depth image as the colour camera would measure it.

    Each depth pixel becomes a point (eq. 3), moves into the colour camera's frame (the inverse of eq. 4) and
    is projected (eq. 2). The grid is drawn as a surface, so that a colour image of more pixels has no holes;
    the nearest surface wins.

    Parameters
    ----------
    depth_m : ndarray (h, w)
        Metres; 0 means no measurement.
    rig : CameraRig
        With a colour camera.
    jump_m : float
        Neighbours further apart in depth are not joined.

    Returns
    -------
    ndarray (colour height, colour width)
        Metres along the colour camera's axis; 0 where it sees no measured surface.
    """
    from core.capture.raster_kernels import draw_grid

    color = rig.color
    if color is None:
        raise InputError("The capture has no colour camera to register with.")
    points = rig.picture_from_depth.apply(rig.depth.backproject(depth_m))
    pixels = color.project(points).reshape(*depth_m.shape, 2)
    out = np.zeros((color.height, color.width))
    draw_grid(np.asarray(depth_m, dtype=float), pixels, np.ascontiguousarray(points[..., 2]), jump_m, out)
    return out


def register_color_to_depth(
    color: NDArray[np.uint8], depth_m: FloatArray, rig: CameraRig, *, tolerance_m: float = 0.02
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """The colour of every depth pixel.

    Returns
    -------
    colors : ndarray (h, w, 3) uint8
        RGB, black where unknown.
    known : ndarray (h, w) bool
        Whether the pixel has depth, projects into the colour image, and is not hidden from the colour camera
        by something more than ``tolerance_m`` nearer.
    """
    camera = rig.color
    if camera is None:
        raise InputError("The capture has no colour camera to register with.")
    points = rig.picture_from_depth.apply(rig.depth.backproject(depth_m))
    pixels = camera.project(points)
    known = (np.asarray(depth_m) > 0) & camera.contains(pixels).reshape(depth_m.shape)
    pixels = np.nan_to_num(pixels, nan=-1.0).reshape(*depth_m.shape, 2).astype(np.float32)
    nearest = register_depth_to_color(depth_m, rig)
    u = np.clip(np.rint(pixels[..., 0]), 0, camera.width - 1).astype(int)
    v = np.clip(np.rint(pixels[..., 1]), 0, camera.height - 1).astype(int)
    front = nearest[v, u]
    known &= (front == 0) | (points[..., 2] <= front + tolerance_m)
    sampled = cv2.remap(
        color, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.where(known[..., None], sampled, 0).astype(np.uint8), known
