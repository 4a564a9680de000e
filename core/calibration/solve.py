"""From views of the board to the geometry of a rig, with how well every parameter is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.calibration.bundle import Adjusted, Bundle, Noise, adjust
from core.calibration.depth_plane import PlaneDepth, plane_depth
from core.calibration.lens import MIN_VIEWS, LensFit, fit_lens, guarded
from core.calibration.profile import DepthCorrection
from core.calibration.sigmas import named_sigmas
from core.calibration.views import RigView
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform
from core.errors import WorkError
from core.progress import Progress, no_progress

FloatArray = NDArray[np.float64]

LENS_SIGMA_FACTOR = 1.35
"""Focal lengths and principal points are stated this much wider than their covariance.

Without it 88 % of their true errors lay within two standard deviations in 23 simulated calibrations: what the
lens model leaves is shared by all views, and no view tells it.
"""

BOARD_SIGMA = 0.0003
"""Relative uncertainty of the measured size of the board: 0.1 mm over an A3 sheet."""

_LEAST_CORNER_SIGMA_PX = 0.01
_LEAST_DEPTH_SIGMA = 0.0002
_OUTLIER = 3.0
_OUTLIER_FLOOR_PX = 0.06
_SAME_DEPTH_SPAN = 0.15


@dataclass(frozen=True)
class ViewResidual:
    """How well one view fits.

    Attributes
    ----------
    number : int
        Place in the given views, from 0.
    used : bool
    reason : str
        Why it was left out.
    infrared_px, color_px : float
        RMS distance of corners, NaN where the camera did not see it.
    depth_m : float
        Corrected depth less the depth that the corners tell; NaN without depth.
    """

    number: int
    used: bool
    reason: str
    infrared_px: float
    color_px: float
    depth_m: float


@dataclass(frozen=True, eq=False)
class RigSolution:
    """Geometry of a rig and its uncertainty.

    Attributes
    ----------
    rig : CameraRig
    depth_correction : DepthCorrection
    names : tuple of str
        Parameters of `covariance`: ``depth.fx`` ... ``color.k1``, ``relation.rx`` (radians) ...
        ``relation.tz`` (metres), ``correction.scale``, ``correction.offset``.
    covariance : ndarray (p, p)
    sigma : dict of str to float
        As a profile keeps it.
    rms_px : dict of str to float
        ``depth``, ``color``: all corners in the adjustment; ``stereo``: both together.
    views : tuple of ViewResidual
        All that were given.
    depth_range_m : tuple of float
        Least and greatest distance at which depth was compared; (0, 0) without depth.
    depth_spread_m : float
        RMS of the depth residuals.
    lenses : tuple of (tuple of str)
        Distortion coefficients that the views bear out, of the depth and the colour camera; the others
        (`core.calibration.lens.guarded`) are refined too, held by what lenses have.
    notes : tuple of str
    """

    rig: CameraRig
    depth_correction: DepthCorrection
    names: tuple[str, ...]
    covariance: FloatArray
    sigma: dict[str, float]
    rms_px: dict[str, float]
    views: tuple[ViewResidual, ...]
    depth_range_m: tuple[float, float]
    depth_spread_m: float
    lenses: tuple[tuple[str, ...], tuple[str, ...]]
    notes: tuple[str, ...]

    @property
    def used(self) -> int:
        """Views that were not left out."""
        return sum(v.used for v in self.views)


def solve_rig(
    views: Sequence[RigView],
    spec: BoardSpec,
    progress: Progress = no_progress,
    *,
    board_sigma: float = BOARD_SIGMA,
) -> RigSolution:
    """Calibrate a rig.

    Each camera by itself chooses its distortion model and gives a start; views that do not fit are left out;
    then everything is refined together, three times with the weights that the residuals tell. A rig
    of which no view has a colour picture is calibrated as a depth camera alone.

    Parameters
    ----------
    views : sequence of RigView
        At least four with an infrared picture of the board; for a colour camera at least four with colour,
        and three with both.
    spec : BoardSpec
        As measured.
    board_sigma : float
        Relative uncertainty of the board's measured size.

    Raises
    ------
    WorkError
        If the views do not determine the rig, with what is missing.
    """
    progress(0.0, "Calibrating the depth camera")
    kept = np.ones(len(views), bool)
    reasons = [""] * len(views)
    depth_lens, depth_at = _lens(views, "infrared", spec, kept, reasons)
    progress(0.3, "Calibrating the colour camera")
    has_color = any(v.color is not None for v in views)
    color_lens, color_at = _lens(views, "color", spec, kept, reasons) if has_color else (None, {})
    relation = RigidTransform() if color_lens is None else _relation(depth_at, color_at, kept, reasons)
    poses: dict[int, RigidTransform] = {}
    for k in map(int, np.flatnonzero(kept)):
        if k in depth_at:
            poses[k] = depth_at[k]
        elif k in color_at:
            poses[k] = relation.inverse() @ color_at[k]
        else:
            kept[k], reasons[k] = False, reasons[k] or "the board was not found"
    lenses = (depth_lens.model, () if color_lens is None else color_lens.model)
    start = Bundle(
        depth_lens.camera, None if color_lens is None else color_lens.camera, relation, 1.0, 0.0, []
    )
    refined = (guarded(lenses[0]), guarded(lenses[1]))
    progress(0.5, "Measuring the board's depth")
    planes = _planes(views, spec, depth_lens, poses)
    adjusted, noise = (
        None,
        Noise(
            max(depth_lens.rms_px / np.sqrt(2), _LEAST_CORNER_SIGMA_PX),
            max((color_lens.rms_px if color_lens else 0.0) / np.sqrt(2), _LEAST_CORNER_SIGMA_PX),
        ),
    )
    rounds = 4
    for turn in range(rounds):
        progress(0.55 + 0.4 * turn / rounds, "Refining all together")
        use = [int(k) for k in np.flatnonzero(kept)]
        _enough(views, use, has_color)
        begin = replace(start, poses=[poses[k] for k in use])
        now = adjust([views[k] for k in use], [planes[k] for k in use], spec, begin, refined, noise)
        noise = _noise(now, [planes[k] for k in use])
        adjusted, start = now, now.bundle
        poses.update(zip(use, now.bundle.poses, strict=True))
        planes = _without_bad_depth(now, use, planes)
        dropped = _reject(now, use, kept, reasons)
        if not dropped and turn >= 2:
            break
    assert adjusted is not None
    solution = _solution(views, planes, adjusted, use, reasons, spec, lenses, board_sigma)
    progress(1.0, "Done")
    return solution


def _lens(
    views: Sequence[RigView], kind: str, spec: BoardSpec, kept: NDArray[np.bool_], reasons: list[str]
) -> tuple[LensFit, dict[int, RigidTransform]]:
    """One camera from the kept views; those far worse than the others are dropped (one at a time)."""
    what = "infrared" if kind == "infrared" else "colour"
    while True:
        numbers = [k for k in map(int, np.flatnonzero(kept)) if getattr(views[k], kind) is not None]
        if len(numbers) < MIN_VIEWS:
            raise WorkError(
                f"Only {len(numbers)} {what} views show the board.",
                f"At least {MIN_VIEWS} are needed, better 25"
                + (
                    ": stream infrared, with the emitter covered if its pattern disturbs."
                    if kind == "infrared"
                    else "."
                ),
            )
        fit = fit_lens([getattr(views[k], kind) for k in numbers], spec)
        limit = max(_OUTLIER * float(np.median(fit.view_rms_px)), _OUTLIER_FLOOR_PX)
        worst = int(np.argmax(fit.view_rms_px))
        if fit.view_rms_px[worst] <= limit or len(numbers) <= MIN_VIEWS:
            return fit, dict(zip(numbers, fit.poses, strict=True))
        kept[numbers[worst]] = False
        reasons[numbers[worst]] = f"its {what} corners do not fit the other views"


def _relation(
    depth_at: dict[int, RigidTransform],
    color_at: dict[int, RigidTransform],
    kept: NDArray[np.bool_],
    reasons: list[str],
) -> RigidTransform:
    """Colour camera from depth camera: the middle of what the common views say."""
    common = [k for k in depth_at if k in color_at and kept[k]]
    if len(common) < 3:
        raise WorkError(
            f"Only {len(common)} views show the board to both cameras.",
            "Hold the board still until both cameras have seen it; at least 3 such views are needed.",
        )
    each = [color_at[k] @ depth_at[k].inverse() for k in common]
    shift = np.array([t.translation for t in each])
    middle = np.median(shift, axis=0)
    far = np.linalg.norm(shift - middle, axis=1)
    best = each[int(np.argmin(far))].rotation
    turn = np.array([np.arccos(np.clip((np.trace(t.rotation @ best.T) - 1) / 2, -1, 1)) for t in each])
    bad = (far > max(6 * float(np.median(far)), 0.02)) | (
        turn > max(6 * float(np.median(turn)), np.deg2rad(2))
    )
    for k, wrong in zip(common, bad, strict=True):
        if wrong:
            kept[k], reasons[k] = False, "the two cameras did not see the board in the same place"
    u, _, vt = np.linalg.svd(np.mean([t.rotation for t, b in zip(each, bad, strict=True) if not b], axis=0))
    return RigidTransform(u @ vt, middle)


def _planes(
    views: Sequence[RigView], spec: BoardSpec, lens: LensFit, poses: dict[int, RigidTransform]
) -> list[PlaneDepth | None]:
    out: list[PlaneDepth | None] = [None] * len(views)
    for k, pose in poses.items():
        depth = views[k].depth
        if depth is not None and depth.shape == (lens.camera.height, lens.camera.width):
            out[k] = plane_depth(depth, views[k].depth_unit_m, lens.camera, pose, spec)
    return out


def _enough(views: Sequence[RigView], use: Sequence[int], has_color: bool) -> None:
    both = sum(views[k].infrared is not None and views[k].color is not None for k in use)
    infrared = sum(views[k].infrared is not None for k in use)
    if infrared < MIN_VIEWS or (has_color and both < 3):
        raise WorkError(
            "Too few views fit each other to calibrate the rig.",
            "Hold the board still for each view and collect them again; check the measured size.",
        )


def _noise(adjusted: Adjusted, planes: Sequence[PlaneDepth | None]) -> Noise:
    """Weights as the residuals tell; each camera keeps its own share of the unknowns."""

    def corner(parts: list[FloatArray]) -> float:
        count = sum(2 * len(p) for p in parts)
        seen = sum(len(p) > 0 for p in parts)
        if not count:
            return Noise().color_px
        total = sum(float((p**2).sum()) for p in parts)
        return max(float(np.sqrt(total / max(count - 3 * seen - 9, count / 4))), _LEAST_CORNER_SIGMA_PX)

    relative = [
        off / plane.depth_m**2
        for off, plane in zip(adjusted.depth_m, planes, strict=True)
        if plane is not None
    ]
    depth = Noise().depth
    if len(relative) > 4:
        depth = max(float(np.sqrt(np.sum(np.square(relative)) / (len(relative) - 2))), _LEAST_DEPTH_SIGMA)
    return Noise(corner(adjusted.infrared), corner(adjusted.color), depth)


def _without_bad_depth(
    adjusted: Adjusted, use: Sequence[int], planes: list[PlaneDepth | None]
) -> list[PlaneDepth | None]:
    """Depth of a view that is far off the others is not used; its corners still are."""
    out = list(planes)
    relative = {
        k: off / plane.depth_m**2
        for k, off in zip(use, adjusted.depth_m, strict=True)
        if (plane := planes[k]) is not None
    }
    if len(relative) >= 6:
        limit = max(4.5 * 1.4826 * float(np.median(np.abs(list(relative.values())))), 0.003)
        for k, value in relative.items():
            if abs(value) > limit:
                out[k] = None
    return out


def _reject(adjusted: Adjusted, use: Sequence[int], kept: NDArray[np.bool_], reasons: list[str]) -> bool:
    """Leave out the worst view of the adjustment if it stands out."""
    worst, excess, why = -1, 1.0, ""
    for what, parts in (("infrared", adjusted.infrared), ("colour", adjusted.color)):
        rms = np.array([_rms(p) for p in parts])
        seen = np.isfinite(rms)
        if seen.sum() < 5:
            continue
        limit = max(_OUTLIER * float(np.median(rms[seen])), _OUTLIER_FLOOR_PX)
        k = int(np.nanargmax(rms))
        if rms[k] / limit > excess:
            worst, excess, why = k, float(rms[k] / limit), f"its {what} corners do not fit the other views"
    if worst < 0 or len(use) <= MIN_VIEWS:
        return False
    kept[use[worst]], reasons[use[worst]] = False, why
    return True


def _rms(off: FloatArray) -> float:
    return float(np.sqrt((off**2).sum(axis=1).mean())) if len(off) else float("nan")


def _solution(
    views: Sequence[RigView],
    planes: Sequence[PlaneDepth | None],
    adjusted: Adjusted,
    use: Sequence[int],
    reasons: Sequence[str],
    spec: BoardSpec,
    lenses: tuple[tuple[str, ...], tuple[str, ...]],
    board_sigma: float,
) -> RigSolution:
    b = adjusted.bundle
    lens = np.array([name.split(".")[-1] in ("fx", "fy", "cx", "cy") for name in adjusted.names])
    widened = np.where(lens, LENS_SIGMA_FACTOR, 1.0)
    covariance = adjusted.covariance * np.outer(widened, widened)
    at = {name: k for k, name in enumerate(adjusted.names)}
    # A board that is larger than measured makes the rig and the distances larger in the same share.
    size = np.zeros(len(at))
    for axis, name in enumerate(("relation.tx", "relation.ty", "relation.tz")):
        if name in at:
            size[at[name]] = b.color_from_depth.translation[axis]
    for name, value in (("correction.scale", b.scale), ("correction.offset", b.offset_m)):
        if name in at:
            size[at[name]] = value
    covariance = covariance + board_sigma**2 * np.outer(size, size)
    notes: list[str] = []
    compared = [planes[k] for k in use if planes[k] is not None]
    distances = [p.depth_m for p in compared if p is not None]
    if len(distances) < 4:
        notes.append("Depth was not compared with the board: scale and offset of the depth are as delivered.")
    elif "correction.offset" not in at or np.ptp(distances) < _SAME_DEPTH_SPAN * np.median(distances):
        notes.append(
            "All views are at about the same distance: scale and offset of the depth are not told apart."
        )
    left_out = sum(bool(r) for r in reasons)
    if left_out:
        notes.append(f"{left_out} of {len(views)} views were left out because they do not fit the others.")
    numbers = {k: n for n, k in enumerate(use)}
    residuals = tuple(
        ViewResidual(
            k,
            k in numbers,
            reasons[k],
            _rms(adjusted.infrared[numbers[k]]) if k in numbers else float("nan"),
            _rms(adjusted.color[numbers[k]]) if k in numbers else float("nan"),
            float(adjusted.depth_m[numbers[k]]) if k in numbers else float("nan"),
        )
        for k in range(len(views))
    )
    infrared = np.concatenate(adjusted.infrared)
    color = np.concatenate(adjusted.color)
    rms = {"depth": _rms(infrared)}
    if len(color):
        rms |= {"color": _rms(color), "stereo": _rms(np.concatenate([infrared, color]))}
    depth_off = adjusted.depth_m[np.isfinite(adjusted.depth_m)]
    return RigSolution(
        CameraRig(b.depth, b.color, None if b.color is None else b.color_from_depth),
        DepthCorrection(b.scale, b.offset_m),
        adjusted.names,
        covariance,
        named_sigmas(adjusted.names, covariance),
        rms,
        residuals,
        (min(distances), max(distances)) if distances else (0.0, 0.0),
        float(np.sqrt((depth_off**2).mean())) if len(depth_off) else float("nan"),
        lenses,
        tuple(notes),
    )
