"""Whether a calibration is good enough for the product, in millimetres on the skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.coverage import CameraCoverage
from core.calibration.solve import RigSolution
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.capture.transform import RigidTransform

FloatArray = NDArray[np.float64]
Grade = Literal["good", "usable", "refused"]

PATIENT_DISTANCE_M = 2.3
LEAST_VIEWS = 20

_BODY_HALF_M = (0.45, 0.90)
_LIMITS: dict[str, tuple[float, float]] = {
    "picture_mm": (2.0, 5.0),
    "depth_mm": (8.0, 20.0),
    "length_percent": (0.3, 1.0),
}
_RMS_SHARE = (0.0008, 0.0025)
_LEAST_SHARE = (0.75, 0.5)


@dataclass(frozen=True)
class Verdict:
    """What the calibration is good for.

    Attributes
    ----------
    grade : {"good", "usable", "refused"}
    picture_mm : float
        95 % bound of how far a place in the picture and the same place in depth are apart on the skin at
        2.3 m, at the worst place of the body; NaN without a colour camera.
    depth_mm : float
        95 % bound of the error of the distance to the patient; NaN where depth was not compared.
    length_percent : float
        95 % bound of the error of lengths on the body.
    reasons : tuple of str
        Why it is not good; empty if it is.
    missing : tuple of str
        What would make it better.
    """

    grade: Grade
    picture_mm: float
    depth_mm: float
    length_percent: float
    reasons: tuple[str, ...]
    missing: tuple[str, ...]


def judge(solution: RigSolution, coverage: Sequence[CameraCoverage] = ()) -> Verdict:
    """Judge a calibration by what its uncertainty means on the skin, by its residuals and by its views.

    Parameters
    ----------
    solution : RigSolution
    coverage : sequence of CameraCoverage
        Of each camera.
    """
    figures = skin_error(solution)
    reasons: list[tuple[int, str]] = []

    def check(value: float, limits: tuple[float, float], text: str) -> None:
        if value > limits[1]:
            reasons.append((2, text))
        elif value > limits[0]:
            reasons.append((1, text))

    picture, depth, length = figures["picture_mm"], figures["depth_mm"], figures["length_percent"]
    check(picture, _LIMITS["picture_mm"], f"Picture and depth may be {picture:.1f} mm apart on the skin.")
    check(depth, _LIMITS["depth_mm"], f"The distance to the patient may be wrong by {depth:.0f} mm.")
    check(length, _LIMITS["length_percent"], f"Lengths on the body may be wrong by {length:.1f} %.")
    if solution.used < LEAST_VIEWS:
        level = 2 if solution.used < LEAST_VIEWS // 2 else 1
        reasons.append((level, f"{solution.used} views are few: {LEAST_VIEWS} or more are needed."))
    left_out = len(solution.views) - solution.used
    if left_out > 0.25 * len(solution.views):
        reasons.append((2, f"{left_out} of {len(solution.views)} views contradict the others."))
    for name, camera in (("infrared", solution.rig.depth), ("colour", solution.rig.color)):
        if camera is None:
            continue
        rms = solution.rms_px["depth" if name == "infrared" else "color"]
        scale = max(camera.width, 640)
        check(
            rms,
            (_RMS_SHARE[0] * scale, _RMS_SHARE[1] * scale),
            f"The {name} corners are {rms:.2f} pixels off.",
        )
    for what, covered in zip(("infrared", "colour"), coverage, strict=False):
        if covered.share < _LEAST_SHARE[0]:
            level = 2 if covered.share < _LEAST_SHARE[1] else 1
            reasons.append(
                (level, f"The views cover {100 * covered.share:.0f} % of what the {what} camera needs.")
            )
    if not np.isfinite(depth):
        reasons.append((1, "Depth was not compared with the board."))
    if not np.isfinite(length):
        reasons.append((2, "The views do not determine the cameras."))
    worst = max((level for level, _ in reasons), default=0)
    missing = list(dict.fromkeys(text for c in coverage for text in c.missing()[:4]))
    if solution.used < LEAST_VIEWS:
        missing.insert(0, f"Collect {LEAST_VIEWS - solution.used} more views")
    if not np.isfinite(depth):
        missing.append("Collect views with depth: the emitter uncovered, the board 0.6 to 2 m away")
    return Verdict(
        ("good", "usable", "refused")[worst],  # type: ignore[arg-type]
        picture,
        depth,
        length,
        tuple(text for _, text in sorted(reasons, key=lambda r: -r[0])),
        tuple(missing) if worst else (),
    )


def skin_error(solution: RigSolution) -> dict[str, float]:
    """95 % bounds of errors on a body at 2.3 m that the uncertainty of a calibration makes.

    Returns
    -------
    dict
        ``picture_mm``, ``depth_mm``, ``length_percent`` as in `Verdict`.
    """
    rig, names = solution.rig, solution.names
    z = PATIENT_DISTANCE_M
    x, y = np.meshgrid(np.linspace(-1, 1, 5) * _BODY_HALF_M[0], np.linspace(-1, 1, 5) * _BODY_HALF_M[1])
    body = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
    pixels = rig.depth.project(body)
    inside = rig.depth.contains(pixels)
    body, pixels = body[inside], pixels[inside]
    scale, offset = solution.depth_correction.scale, solution.depth_correction.offset_m
    raw = (z - offset) / scale
    spread = np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))

    def seen(shift: dict[str, float]) -> tuple[FloatArray, FloatArray, float]:
        shifted = _shifted(rig, shift)
        far = (
            offset + shift.get("correction.offset", 0.0) + (scale + shift.get("correction.scale", 0.0)) * raw
        )
        points = shifted.depth.rays(pixels) * far
        focal = rig.picture_camera.fx
        return points, shifted.project_to_picture(points) * (1000 * z / focal), 1000 * far

    points0, picture0, depth0 = seen({})
    by_points, by_picture, by_depth = [], [], []
    for name, sigma in zip(names, spread, strict=True):
        step = max(1e-3 * float(sigma), 1e-9)
        points, picture, depth = seen({name: step})
        by_points.append((points - points0) / step)
        by_picture.append((picture - picture0) / step)
        by_depth.append((depth - depth0) / step)
    c = solution.covariance

    def bound(jacobian: FloatArray) -> FloatArray:
        """Standard deviation (n, d) of quantities with derivatives (p, n, d)."""
        return np.asarray(np.sqrt(np.maximum(np.einsum("pnd,pq,qnd->nd", jacobian, c, jacobian), 0.0)))

    picture_mm = float("nan")
    if rig.color is not None:
        sigma = bound(np.array(by_picture))
        # The radius of a two-dimensional error stays below 2.45 sigma in 95 % of cases.
        picture_mm = float(2.45 * np.sqrt((sigma**2).sum(axis=1).max() / 2))
    depth_mm = float("nan")
    if any(n.startswith("correction.") for n in names):
        # What single views still differ by is the sensor's own ripple: it is not averaged away on a patient.
        depth_mm = float(2.0 * bound(np.array(by_depth).reshape(-1, 1, 1))[0, 0])
    lengths = np.array(by_points)[:, :, :2]
    ends = lengths - lengths.mean(axis=1, keepdims=True)
    reach = np.linalg.norm(body[:, :2] - body[:, :2].mean(axis=0), axis=1)
    far = reach > 0.5 * reach.max()
    length = (
        float((2.0 * np.linalg.norm(bound(ends), axis=1)[far] / reach[far]).max() * 100)
        if far.any()
        else float("nan")
    )
    return {"picture_mm": picture_mm, "depth_mm": depth_mm, "length_percent": length}


def _shifted(rig: CameraRig, shift: dict[str, float]) -> CameraRig:
    """The rig with some parameters changed by a little."""

    def camera(prefix: str, c: PinholeCamera) -> PinholeCamera:
        values = {n: getattr(c, n) + shift.get(f"{prefix}.{n}", 0.0) for n in ("fx", "fy", "cx", "cy")}
        lens = list(c.distortion) + [0.0] * (5 - len(c.distortion))
        lens = [
            v + shift.get(f"{prefix}.{n}", 0.0)
            for v, n in zip(lens, ("k1", "k2", "p1", "p2", "k3"), strict=True)
        ]
        return replace(c, **values, distortion=tuple(lens) if any(lens) else ())

    color, relation = None, None
    if rig.color is not None and rig.color_from_depth is not None:
        color = camera("color", rig.color)
        vector = np.asarray(cv2.Rodrigues(rig.color_from_depth.rotation)[0], float).ravel()
        vector += [shift.get(f"relation.r{a}", 0.0) for a in "xyz"]
        place = rig.color_from_depth.translation + [shift.get(f"relation.t{a}", 0.0) for a in "xyz"]
        relation = RigidTransform(np.asarray(cv2.Rodrigues(vector)[0], float), place)
    return CameraRig(camera("depth", rig.depth), color, relation)
