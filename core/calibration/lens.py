"""One camera from its views of the board, with no more lens distortion than the views bear out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec, BoardView
from core.calibration.views import guess_camera
from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from core.errors import WorkError

FloatArray = NDArray[np.float64]

LENS_NAMES = ("k1", "k2", "p1", "p2", "k3")
LENS_MODELS: tuple[tuple[str, ...], ...] = (
    (),
    ("k1",),
    ("k1", "k2"),
    ("k1", "k2", "p1", "p2"),
    ("k1", "k2", "p1", "p2", "k3"),
)
"""Distortion models from the simplest to the richest; names in OpenCV's order."""

MIN_VIEWS = 4


def guarded(model: tuple[str, ...]) -> tuple[str, ...]:
    """The coefficients to refine for a model: one radial term more, and decentring.

    What the views do not bear out is not zero but unknown within what lenses have (a prior holds it). Left
    at zero, it would shift the principal point by several of its stated uncertainties.
    """
    radial = [n for n in ("k1", "k2", "k3") if n in model]
    more = ("k1", "k2", "k3")[: min(len(radial) + 1, 3)]
    return tuple(n for n in LENS_NAMES if n in more or n in ("p1", "p2"))


@dataclass(frozen=True, eq=False)
class LensFit:
    """One camera by itself.

    Attributes
    ----------
    camera : PinholeCamera
    poses : list of RigidTransform
        Camera frame from board frame, one for each view.
    rms_px : float
        Root mean square of the distance between seen and predicted corners.
    view_rms_px : ndarray (n,)
    model : tuple of str
        Distortion coefficients in use.
    """

    camera: PinholeCamera
    poses: list[RigidTransform]
    rms_px: float
    view_rms_px: FloatArray
    model: tuple[str, ...]


def fit_lens(
    views: Sequence[BoardView], spec: BoardSpec, models: Sequence[tuple[str, ...]] = LENS_MODELS
) -> LensFit:
    """Calibrate one camera with the distortion model that the Bayesian information criterion prefers.

    Raises
    ------
    WorkError
        If there are fewer than four views, or they do not determine a camera.
    """
    if len(views) < MIN_VIEWS:
        raise WorkError(
            f"{len(views)} views of the board are too few to calibrate a camera.",
            f"Collect at least {MIN_VIEWS}, better 25, at different places, distances and tilts.",
        )
    best: LensFit | None = None
    lowest = np.inf
    for model in models:
        fit = _fit(views, spec, model)
        if fit is None:
            continue
        count = 2 * sum(len(v) for v in views)
        score = count * np.log(max(fit.rms_px, 1e-6) ** 2) + (4 + len(model)) * np.log(count)
        if score < lowest:
            best, lowest = fit, score
    if best is None:
        raise WorkError(
            "The views of the board do not determine the camera.",
            "Collect views in which the board is tilted, at different places and distances.",
        )
    return best


def _fit(views: Sequence[BoardView], spec: BoardSpec, model: tuple[str, ...]) -> LensFit | None:
    width, height = views[0].size
    flags = cv2.CALIB_USE_INTRINSIC_GUESS
    for name, flag in (("k1", cv2.CALIB_FIX_K1), ("k2", cv2.CALIB_FIX_K2), ("k3", cv2.CALIB_FIX_K3)):
        if name not in model:
            flags |= flag
    if "p1" not in model:
        flags |= cv2.CALIB_ZERO_TANGENT_DIST
    try:
        _, matrix, lens, turns, shifts = cv2.calibrateCamera(
            [spec.corners_m[v.ids].astype(np.float32) for v in views],
            [v.pixels.astype(np.float32).reshape(-1, 1, 2) for v in views],
            (width, height),
            guess_camera((width, height)).matrix,
            np.zeros(5),
            flags=flags,
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-9),
        )
    except cv2.error:
        return None
    lens = np.asarray(lens, float).ravel()[:5]
    values = (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *lens)
    if not np.isfinite(values).all() or matrix[0, 0] < 0.1 * width or matrix[0, 0] > 20 * width:
        return None
    if not (-width < matrix[0, 2] < 2 * width and -height < matrix[1, 2] < 2 * height):
        return None
    camera = PinholeCamera(
        width, height, float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2]),
        tuple(float(x) for x in lens) if model else (),
    )  # fmt: skip
    poses = [
        RigidTransform(np.asarray(cv2.Rodrigues(r)[0], float), np.asarray(t, float).ravel())
        for r, t in zip(turns, shifts, strict=True)
    ]
    squared = [
        ((camera.project(pose.apply(spec.corners_m[v.ids])) - v.pixels) ** 2).sum(axis=1)
        for v, pose in zip(views, poses, strict=True)
    ]
    if not all(np.isfinite(s).all() for s in squared):
        return None
    return LensFit(
        camera,
        poses,
        float(np.sqrt(np.concatenate(squared).mean())),
        np.sqrt([s.mean() for s in squared]),
        model,
    )
