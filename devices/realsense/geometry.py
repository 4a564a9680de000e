"""Intrinsics and extrinsics of the library as cameras of the application."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from devices.realsense import library

_GRID = 21
_FIT_ALLOWED_PX = 0.3


def camera_facts(intrinsics: Any) -> dict[str, Any]:
    """What the application needs of the library's intrinsics, picklable.

    The library's Brown-Conrady model is OpenCV's. Of its other models (the colour cameras of some D4xx store
    the inverse of one) OpenCV's five coefficients are fitted to what the library itself computes;
    ``fit_px`` is the largest deviation that is left.
    """
    rs = library.load()
    i = intrinsics
    facts: dict[str, Any] = {
        "width": i.width,
        "height": i.height,
        "fx": i.fx,
        "fy": i.fy,
        "cx": i.ppx,
        "cy": i.ppy,
        "distortion": (),
        "fit_px": 0.0,
    }
    if i.model == rs.distortion.none or not any(i.coeffs):
        return facts
    if i.model == rs.distortion.brown_conrady:
        facts["distortion"] = tuple(float(c) for c in i.coeffs)
        return facts
    rays, pixels = _samples(rs, i)
    facts["distortion"], facts["fit_px"] = fit_distortion(rays, pixels, (i.fx, i.fy, i.ppx, i.ppy))
    return facts


def camera_of(facts: Mapping[str, Any]) -> tuple[PinholeCamera, tuple[str, ...]]:
    """Camera of `camera_facts`, and a warning if its lens could not be put into OpenCV's terms."""
    names = ("width", "height", "fx", "fy", "cx", "cy", "distortion")
    camera = PinholeCamera(**{name: facts[name] for name in names})
    if facts["fit_px"] > _FIT_ALLOWED_PX:
        off = f"{facts['fit_px']:.1f} pixels"
        return camera, (f"The lens model of the camera is followed only to {off}; calibrate the rig.",)
    return camera, ()


def transform_of(rotation: Any, translation: Any) -> RigidTransform:
    """Transform of the library's extrinsics: nine numbers by columns, and metres."""
    matrix = np.eye(4)
    turned = np.asarray(rotation, dtype=float).reshape(3, 3).T
    # Stored in single precision: the nearest rotation.
    u, _, vt = np.linalg.svd(turned)
    matrix[:3, :3] = u @ vt
    matrix[:3, 3] = np.asarray(translation, dtype=float)
    return RigidTransform.from_matrix(matrix)


def fit_distortion(
    rays: NDArray[np.float64], pixels: NDArray[np.float64], lens: tuple[float, float, float, float]
) -> tuple[tuple[float, ...], float]:
    """OpenCV's k1 k2 p1 p2 k3 that take rays to pixels; the model is linear in them.

    Parameters
    ----------
    rays : ndarray (n, 2)
        At z = 1.
    pixels : ndarray (n, 2)
    lens : fx, fy, cx, cy

    Returns
    -------
    coefficients : tuple of 5 float
    largest : float
        Largest deviation, pixels.
    """
    fx, fy, cx, cy = lens
    x, y = rays[:, 0], rays[:, 1]
    r2 = x * x + y * y
    columns = np.stack(
        [
            np.concatenate([x * r2 * fx, y * r2 * fy]),
            np.concatenate([x * r2**2 * fx, y * r2**2 * fy]),
            np.concatenate([2 * x * y * fx, (r2 + 2 * y * y) * fy]),
            np.concatenate([(r2 + 2 * x * x) * fx, 2 * x * y * fy]),
            np.concatenate([x * r2**3 * fx, y * r2**3 * fy]),
        ],
        axis=1,
    )
    wanted = np.concatenate([pixels[:, 0] - cx - fx * x, pixels[:, 1] - cy - fy * y])
    found, *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    left = (columns @ found - wanted).reshape(2, -1)
    return tuple(float(c) for c in found), float(np.hypot(*left).max())


def _samples(rs: Any, i: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays and the pixels they belong to, all over the image, by the direction the model is defined in."""
    u, v = np.meshgrid(np.linspace(0, i.width - 1, _GRID), np.linspace(0, i.height - 1, _GRID))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    if i.model == rs.distortion.modified_brown_conrady:
        rays = (pixels - (i.ppx, i.ppy)) / (i.fx, i.fy)
        seen = [rs.rs2_project_point_to_pixel(i, [float(x), float(y), 1.0]) for x, y in rays]
        return rays, np.array(seen)
    found = [rs.rs2_deproject_pixel_to_point(i, [float(a), float(b)], 1.0)[:2] for a, b in pixels]
    return np.array(found), pixels
