"""Where the corners of a calibration are, and how far from where it puts them. Called in the worker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from app.workflows.calibrating import CalibrationResult
    from core.calibration.board import BoardSpec, BoardView
    from core.calibration.views import RigView
    from core.capture.camera import PinholeCamera

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CornerResiduals:
    """Residuals of one camera.

    Attributes
    ----------
    size : tuple of int
        Of its picture.
    places, off : ndarray (n, 2)
        Corners in pixels, and seen less expected.
    """

    size: tuple[int, int]
    places: FloatArray
    off: FloatArray


def corner_residuals(
    result: CalibrationResult, views: Sequence[RigView], spec: BoardSpec
) -> tuple[CornerResiduals, CornerResiduals | None]:
    """Residuals of the depth and the colour camera over the views that were used.

    Each board is placed anew by the camera's own corners: what is left is what the lens does not explain.
    """
    used = [views[v.number] for v in result.views if v.used and v.number < len(views)]
    rig = result.profile.rig
    depth = _of_camera(rig.depth, [v.infrared for v in used], spec)
    return depth, None if rig.color is None else _of_camera(rig.color, [v.color for v in used], spec)


def _of_camera(camera: PinholeCamera, views: Sequence[BoardView | None], spec: BoardSpec) -> CornerResiduals:
    from core.calibration.views import board_pose

    places, off = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for view in views:
        pose = None if view is None else board_pose(view, spec, camera)
        if view is None or pose is None:
            continue
        expected = camera.project(pose.apply(spec.corners_m[view.ids]))
        good = np.isfinite(expected).all(axis=1)
        places.append(view.pixels[good])
        off.append((view.pixels - expected)[good])
    return CornerResiduals((camera.width, camera.height), np.concatenate(places), np.concatenate(off))
