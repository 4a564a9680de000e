"""The ten-second check before the first patient: does the rig still stand as it was calibrated?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.calibration.bundle import plane_at
from core.calibration.depth_plane import plane_depth
from core.calibration.profile import CalibrationProfile
from core.calibration.views import RigView, board_pose
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform

FloatArray = NDArray[np.float64]
CheckVerdict = Literal["ok", "moved", "cannot tell"]

WARN_PX_AT_640 = 2.0
WARN_DEG = 0.2
WARN_MM = 3.0
WARN_DEPTH_SHARE = 0.008
LEAST_VIEWS = 3
LEAST_SPREAD = 0.12
"""How far apart the places of the board in the picture must be, as a share of its width, for angles."""

_SIGMAS = 2.0


@dataclass(frozen=True)
class CheckResult:
    """How the rig stands against its profile.

    Attributes
    ----------
    verdict : {"ok", "moved", "cannot tell"}
    message : str
        For people, with what to do.
    views : int
        Used.
    shift_px : float
        Median distance of colour corners from where the profile expects them, in pixels of the colour
        picture; NaN if unknown.
    limit_px : float
        From where on `shift_px` counts as moved.
    rotation_deg, translation_mm : float
        The smallest motion of the colour camera that explains it; one of the two that explains it better
        alone. NaN if unknown.
    rotation_sigma_deg, translation_sigma_mm : float
    depth_error_mm : float
        Median of corrected depth less what the corners tell, at the board; NaN without depth.
    depth_limit_mm : float
    """

    verdict: CheckVerdict
    message: str
    views: int
    shift_px: float = float("nan")
    limit_px: float = float("nan")
    rotation_deg: float = float("nan")
    rotation_sigma_deg: float = float("nan")
    translation_mm: float = float("nan")
    translation_sigma_mm: float = float("nan")
    depth_error_mm: float = float("nan")
    depth_limit_mm: float = float("nan")


@dataclass
class DailyCheck:
    """Collects a few views and compares them with the profile.

    Parameters
    ----------
    profile : CalibrationProfile
    spec : BoardSpec
    """

    profile: CalibrationProfile
    spec: BoardSpec
    _views: list[RigView] = field(default_factory=list)

    def add(self, view: RigView) -> None:
        """Take a view into account; it should be of a board that stands still."""
        self._views.append(view)

    @property
    def views(self) -> int:
        """Views so far."""
        return len(self._views)

    def result(self) -> CheckResult:
        """What the views so far tell."""
        return check_rig(self.profile, self.spec, self._views)


def check_rig(profile: CalibrationProfile, spec: BoardSpec, views: Sequence[RigView]) -> CheckResult:
    """Compare seen colour corners with those that the infrared corners and the profile predict.

    Each board pose comes from the infrared picture. A pose is uncertain mostly along the line of sight, and
    that hardly moves the prediction, because the cameras stand side by side. What is left is explained by a
    turn of the colour camera or by a shift of it, whichever needs less; the board's depth is compared too.

    Parameters
    ----------
    profile : CalibrationProfile
    spec : BoardSpec
    views : sequence of RigView
        Three or more, with infrared and (for a colour rig) colour.
    """
    rig = profile.rig
    depth_off, depth_at = _depth_errors(profile, spec, views)
    usable: list[tuple[RigidTransform, RigView]] = []
    for view in views:
        if view.infrared is None or view.infrared.size != (rig.depth.width, rig.depth.height):
            continue
        if rig.color is not None and (
            view.color is None or view.color.size != (rig.color.width, rig.color.height)
        ):
            continue
        pose = board_pose(view.infrared, spec, rig.depth)
        if pose is not None:
            usable.append((pose, view))
    if len(usable) < LEAST_VIEWS:
        return CheckResult(
            "cannot tell",
            f"Only {len(usable)} pictures show the board to "
            + ("both cameras" if rig.color is not None else "the camera")
            + f" at the calibrated size: hold it up again; at least {LEAST_VIEWS} are needed.",
            len(usable),
        )
    result = _compared(rig, spec, usable) if rig.color is not None else CheckResult("ok", "", len(usable))
    return _with_depth(result, profile, depth_off, depth_at)


def _compared(
    rig: CameraRig, spec: BoardSpec, usable: Sequence[tuple[RigidTransform, RigView]]
) -> CheckResult:
    camera = rig.picture_camera
    limit = WARN_PX_AT_640 * camera.width / 640
    rows, off, median, own = [], [], [], []
    for pose, view in usable:
        assert view.color is not None
        assert view.infrared is not None
        own.append(
            _rms(rig.depth.project(pose.apply(spec.corners_m[view.infrared.ids])) - view.infrared.pixels)
        )
        points = rig.picture_from_depth.apply(pose.apply(spec.corners_m[view.color.ids]))
        d = view.color.pixels - camera.project(points)
        good = np.isfinite(d).all(axis=1)
        off.append(d[good])
        median.append(np.median(d[good], axis=0))
        rows.append(_motion_jacobian(camera, points[good]))
    shift = float(np.median([np.hypot(*m) for m in median]))
    if float(np.median(own)) > limit:
        return CheckResult(
            "moved",
            "The infrared camera itself no longer sees the board as calibrated: its lens has changed, or "
            "the measured size of the board. Calibrate the rig again.",
            len(usable), shift, limit,
        )  # fmt: skip
    jacobian, residual = np.concatenate(rows).reshape(-1, 6), np.concatenate(off).ravel()
    # Corners of one view share the error of its pose: views, not corners, count.
    views = len(usable)
    found = {}
    for name, part in (("rotation", slice(0, 3)), ("translation", slice(3, 6))):
        a = jacobian[:, part]
        x, *_ = np.linalg.lstsq(a, residual, rcond=None)
        left = residual - a @ x
        variance = float((left**2).mean()) / views * len(residual)
        sigma = float(np.sqrt(np.trace(variance * np.linalg.inv(a.T @ a))))
        found[name] = (float(np.linalg.norm(x)), sigma, float((left**2).sum()))
    turn, turn_sigma = np.rad2deg(found["rotation"][0]), np.rad2deg(found["rotation"][1])
    move, move_sigma = 1000 * found["translation"][0], 1000 * found["translation"][1]
    turned = turn > max(WARN_DEG, _SIGMAS * turn_sigma)
    shifted = move > max(WARN_MM, _SIGMAS * move_sigma)
    by_turn = found["rotation"][2] <= found["translation"][2]
    moved = shift > limit or (turned if by_turn else shifted)
    centres = np.array([m.pixels.mean(axis=0) for _, v in usable if (m := v.color) is not None])
    spread = float(np.ptp(centres, axis=0).max()) / camera.width
    if moved:
        how = f"turned by about {turn:.1f} degrees" if by_turn else f"shifted by about {move:.0f} mm"
        verdict: CheckVerdict = "moved"
        message = (
            f"The colour camera has moved: corners are {shift:.1f} pixels off, as if it were {how}. "
            "Put it back, or calibrate the rig again before the next patient."
        )
    elif turn_sigma > WARN_DEG and move_sigma > WARN_MM:
        verdict, message = (
            "cannot tell",
            "The pictures differ too much to tell: hold the board still, a little closer.",
        )
    else:
        verdict, message = "ok", "The cameras stand as calibrated."
        if spread < LEAST_SPREAD:
            message += " The board stayed in one place; moving it across the picture tests turns better."
    return CheckResult(
        verdict, message, views, shift, limit, float(turn), float(turn_sigma), float(move), float(move_sigma)
    )


def _motion_jacobian(camera: object, points: FloatArray) -> FloatArray:
    """Change of pixels (n, 2, 6) with a turn (rad) and a shift (m) of points in the colour camera's frame."""
    from core.capture.camera import PinholeCamera

    assert isinstance(camera, PinholeCamera)
    step = 1e-5
    base = camera.project(points)
    columns = []
    for axis in np.eye(3):
        turn = np.asarray(cv2.Rodrigues(step * axis)[0], float)
        columns.append((camera.project(points @ turn.T) - base) / step)
    for axis in np.eye(3):
        columns.append((camera.project(points + step * axis) - base) / step)
    return np.stack(columns, axis=2)


def _depth_errors(
    profile: CalibrationProfile, spec: BoardSpec, views: Sequence[RigView]
) -> tuple[list[float], list[float]]:
    """Corrected depth less that of the corners, and the distance, of each view that has depth."""
    off, at = [], []
    camera, correction = profile.rig.depth, profile.depth_correction
    for view in views:
        if view.depth is None or view.infrared is None or view.depth.shape != (camera.height, camera.width):
            continue
        pose = board_pose(view.infrared, spec, camera)
        plane = None if pose is None else plane_depth(view.depth, view.depth_unit_m, camera, pose, spec)
        if pose is not None and plane is not None:
            corrected = correction.offset_m + correction.scale * plane.depth_m
            off.append(corrected - plane_at(camera, pose, plane.pixel))
            at.append(corrected)
    return off, at


def _with_depth(
    result: CheckResult, profile: CalibrationProfile, off: Sequence[float], at: Sequence[float]
) -> CheckResult:
    from dataclasses import replace

    if not off:
        note = " Depth was not checked: none was measured on the board."
        message = (result.message or "The camera sees the board as calibrated.") + note
        return replace(result, message=message)
    error, distance = float(np.median(off)), float(np.median(at))
    sigma = profile.sigma
    known = np.hypot(sigma.get("depth_offset_m", 0.0), distance * sigma.get("depth_scale", 0.0))
    limit = 0.003 + WARN_DEPTH_SHARE * distance + _SIGMAS * float(known)
    result = replace(result, depth_error_mm=1000 * error, depth_limit_mm=1000 * limit)
    if result.verdict == "ok" and abs(error) > limit:
        return replace(
            result,
            verdict="moved",
            message=f"Depth is {1000 * error:+.0f} mm off at {distance:.1f} m: let the camera warm up for "
            "15 minutes and check again; if it stays, calibrate the rig again.",
        )
    return replace(result, message=result.message or "The camera sees the board as calibrated.")


def _rms(off: FloatArray) -> float:
    return float(np.sqrt((off**2).sum(axis=1).mean()))
