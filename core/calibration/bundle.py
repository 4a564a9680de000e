"""Bundle adjustment: cameras, the transform between them, the depth correction and all poses at once.

Unknowns are refined together until the corners of all views in both cameras, and the depth of the board, are
predicted best in the sense of least squares. The inverse of the normal matrix is the covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.calibration.board import BoardSpec
from core.calibration.depth_plane import PlaneDepth
from core.calibration.lens import LENS_NAMES
from core.calibration.views import RigView
from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform

FloatArray = NDArray[np.float64]

INTRINSICS = ("fx", "fy", "cx", "cy", *LENS_NAMES)
_MAX_STEPS = 60
_RELATION = ("rx", "ry", "rz", "tx", "ty", "tz")
_DEPTH = ("scale", "offset")
# How far from zero distortion coefficients of real lenses are: keeps the weakly seen ones from running off.
_LENS_PRIOR = {"k1": 0.5, "k2": 0.5, "p1": 0.002, "p2": 0.002, "k3": 0.3}


@dataclass(frozen=True, eq=False)
class Bundle:
    """Present values of everything that is refined.

    Attributes
    ----------
    depth, color : PinholeCamera
        `color` is None for a rig without a colour camera.
    color_from_depth : RigidTransform
    scale, offset_m : float
        True depth = offset + scale * measured.
    poses : list of RigidTransform
        Depth camera from board, one for each view.
    """

    depth: PinholeCamera
    color: PinholeCamera | None
    color_from_depth: RigidTransform
    scale: float
    offset_m: float
    poses: list[RigidTransform]


@dataclass(frozen=True)
class Noise:
    """Standard deviations that weigh the kinds of measurement.

    Attributes
    ----------
    infrared_px, color_px : float
        Of one coordinate of one corner.
    depth : float
        Of the depth of a plane, in metres at one metre; grows with the square of the distance.
    """

    infrared_px: float = 0.05
    color_px: float = 0.05
    depth: float = 0.002


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Result of the adjustment.

    Attributes
    ----------
    bundle : Bundle
    names : tuple of str
        Of the parameters that all views share, in the order of the covariance: ``depth.fx``,
        ``color.k1``, ``relation.tx``, ``correction.scale``.
    covariance : ndarray (p, p)
    infrared, color : list of ndarray (k, 2)
        Residuals in pixels of each view, empty where it was not seen.
    depth_m : ndarray (n,)
        Residual of the depth of each view, NaN without.
    """

    bundle: Bundle
    names: tuple[str, ...]
    covariance: FloatArray
    infrared: list[FloatArray]
    color: list[FloatArray]
    depth_m: FloatArray


class _Problem:
    def __init__(
        self,
        views: Sequence[RigView],
        planes: Sequence[PlaneDepth | None],
        spec: BoardSpec,
        start: Bundle,
        lenses: tuple[tuple[str, ...], tuple[str, ...]],
        noise: Noise,
    ) -> None:
        self.views, self.planes, self.spec, self.start, self.noise = views, planes, spec, start, noise
        self.names: list[str] = []
        for prefix, camera, lens in (("depth", start.depth, lenses[0]), ("color", start.color, lenses[1])):
            if camera is not None:
                self.names += [f"{prefix}.{n}" for n in INTRINSICS[:4] + lens]
        if start.color is not None:
            self.names += [f"relation.{n}" for n in _RELATION]
        measured = sum(p is not None for p in planes)
        self.fit_depth = _DEPTH[: min(measured // 4, 2)]
        self.names += [f"correction.{n}" for n in self.fit_depth]
        self.at = {name: k for k, name in enumerate(self.names)}
        self.shared = len(self.names)

    def pack(self, bundle: Bundle) -> FloatArray:
        values = {f"correction.{n}": v for n, v in zip(_DEPTH, (bundle.scale, bundle.offset_m), strict=True)}
        for prefix, camera in (("depth", bundle.depth), ("color", bundle.color)):
            if camera is not None:
                values |= {f"{prefix}.{n}": v for n, v in zip(INTRINSICS, _intrinsics(camera), strict=True)}
        relation = np.concatenate([_turn(bundle.color_from_depth), bundle.color_from_depth.translation])
        values |= {f"relation.{n}": v for n, v in zip(_RELATION, relation, strict=True)}
        poses = [np.concatenate([_turn(p), p.translation]) for p in bundle.poses]
        return np.concatenate([[values[n] for n in self.names], *poses])

    def unpack(self, x: FloatArray) -> Bundle:
        s = self.start

        def camera(prefix: str, like: PinholeCamera) -> PinholeCamera:
            values = [
                float(x[self.at[f"{prefix}.{n}"]]) if f"{prefix}.{n}" in self.at else 0.0 for n in INTRINSICS
            ]
            lens = tuple(values[4:]) if any(values[4:]) else ()
            return PinholeCamera(like.width, like.height, values[0], values[1], values[2], values[3], lens)

        relation = s.color_from_depth
        if s.color is not None:
            k = self.at["relation.rx"]
            relation = _transform(x[k : k + 6])
        correction = [
            float(x[self.at[f"correction.{n}"]]) if n in self.fit_depth else v
            for n, v in zip(_DEPTH, (s.scale, s.offset_m), strict=True)
        ]
        return Bundle(
            camera("depth", s.depth),
            None if s.color is None else camera("color", s.color),
            relation,
            correction[0],
            correction[1],
            [_transform(x[k : k + 6]) for k in range(self.shared, len(x), 6)],
        )

    def evaluate(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residuals (m,) and their Jacobian (m, p)."""
        bundle = self.unpack(x)
        rows: list[FloatArray] = []
        blocks: list[FloatArray] = []
        self.ends: list[int] = []
        for k, view in enumerate(self.views):
            place = slice(self.shared + 6 * k, self.shared + 6 * k + 6)
            pose = x[place]
            for kind in ("depth", "color"):
                seen = view.infrared if kind == "depth" else view.color
                camera = bundle.depth if kind == "depth" else bundle.color
                if seen is None or camera is None:
                    continue
                sigma = self.noise.infrared_px if kind == "depth" else self.noise.color_px
                residual, jacobian = self._corners(x, kind, camera, seen.ids, seen.pixels, pose, place)
                rows.append(residual / sigma)
                blocks.append(jacobian / sigma)
            plane = self.planes[k]
            if plane is not None:
                sigma = self.noise.depth * plane.depth_m**2
                value, gradient = self._depth(x, bundle, plane, pose, place)
                rows.append(np.array([value / sigma]))
                blocks.append(gradient[None] / sigma)
            self.ends.append(sum(map(len, rows)))
        for name, spread in _LENS_PRIOR.items():
            for prefix in ("depth", "color"):
                if (index := self.at.get(f"{prefix}.{name}")) is not None:
                    row = np.zeros(len(x))
                    row[index] = 1 / spread
                    rows.append(np.array([x[index] / spread]))
                    blocks.append(row[None])
        return np.concatenate(rows), np.concatenate(blocks)

    def _corners(
        self, x: FloatArray, kind: str, camera: PinholeCamera, ids: NDArray[np.int64], pixels: FloatArray,
        pose: FloatArray, place: slice,
    ) -> tuple[FloatArray, FloatArray]:  # fmt: skip
        turn, shift = pose[:3], pose[3:]
        chain: tuple[FloatArray, ...] = ()
        if kind == "color":
            k = self.at["relation.rx"]
            turn, shift, *chain_list = cv2.composeRT(turn, shift, x[k : k + 3], x[k + 3 : k + 6])
            chain = tuple(np.asarray(c) for c in chain_list)
        expected, d = cv2.projectPoints(
            self.spec.corners_m[ids], turn, shift, camera.matrix, np.array(_intrinsics(camera)[4:])
        )
        # OpenCV's columns: 3 of the rotation, 3 of the translation, fx fy, cx cy, k1 k2 p1 p2 k3.
        d = np.asarray(d, float)
        out = np.zeros((2 * len(ids), len(x)))
        for column, name in enumerate(INTRINSICS):
            if (index := self.at.get(f"{kind}.{name}")) is not None:
                out[:, index] = d[:, 6 + column]
        if kind == "depth":
            out[:, place] = d[:, :6]
        else:
            dr_dr1, dr_dt1, dr_dr2, dr_dt2, dt_dr1, dt_dt1, dt_dr2, dt_dt2 = chain
            by_turn, by_shift = d[:, :3], d[:, 3:6]
            k = self.at["relation.rx"]
            out[:, place] = by_turn @ np.hstack([dr_dr1, dr_dt1]) + by_shift @ np.hstack([dt_dr1, dt_dt1])
            out[:, k : k + 6] = by_turn @ np.hstack([dr_dr2, dr_dt2]) + by_shift @ np.hstack([dt_dr2, dt_dt2])
        return (np.asarray(expected).reshape(-1, 2) - pixels).ravel(), out

    def _depth(
        self, x: FloatArray, bundle: Bundle, plane: PlaneDepth, pose: FloatArray, place: slice
    ) -> tuple[float, FloatArray]:
        rotation, by_turn = cv2.Rodrigues(pose[:3])
        normal = np.asarray(rotation)[:, 2]
        # Rodrigues' derivative is (3, 9), row by row of the matrix: column 2 is entries 2, 5, 8.
        d_normal = np.asarray(by_turn)[:, [2, 5, 8]].T
        ray = bundle.depth.rays(np.array([plane.pixel]))[0]
        facing, reach = float(normal @ ray), float(normal @ pose[3:])
        out = np.zeros(len(x))
        z = reach / facing
        by_normal = pose[3:] / facing - z * ray / facing
        out[place] = -np.concatenate([by_normal @ d_normal, normal / facing])
        c = bundle.depth
        # The lens' part of the ray's derivative is far below the depth's noise; that of fx, cx is not.
        by_ray = -z * normal / facing
        for name, change in (
            ("fx", np.array([-ray[0] / c.fx, 0, 0])),
            ("fy", np.array([0, -ray[1] / c.fy, 0])),
            ("cx", np.array([-1 / c.fx, 0, 0])),
            ("cy", np.array([0, -1 / c.fy, 0])),
        ):
            out[self.at[f"depth.{name}"]] -= by_ray @ change
        if "scale" in self.fit_depth:
            out[self.at["correction.scale"]] = plane.depth_m
        if "offset" in self.fit_depth:
            out[self.at["correction.offset"]] = 1.0
        return bundle.offset_m + bundle.scale * plane.depth_m - z, out


def adjust(
    views: Sequence[RigView],
    planes: Sequence[PlaneDepth | None],
    spec: BoardSpec,
    start: Bundle,
    lenses: tuple[tuple[str, ...], tuple[str, ...]],
    noise: Noise,
) -> Adjusted:
    """Refine everything from ``start``.

    Parameters
    ----------
    views : sequence of RigView
    planes : sequence of PlaneDepth or None
        Of each view; the depth correction is fitted from eight on, only the scale from four on.
    lenses : pair of tuple of str
        Distortion coefficients to refine, of the depth and of the colour camera.
    """
    problem = _Problem(views, planes, spec, start, lenses, noise)
    x, normal = _minimise(problem, problem.pack(start))
    bundle = problem.unpack(x)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-30))
    whole = np.linalg.pinv(normal * np.outer(scale, scale), hermitian=True) * np.outer(scale, scale)
    covariance = _by_view(problem, x, np.asarray(whole, float))
    infrared, color, depth = [], [], np.full(len(views), np.nan)
    for k, (view, pose) in enumerate(zip(views, bundle.poses, strict=True)):
        infrared.append(_off(bundle.depth, pose, view.infrared, spec))
        color.append(_off(bundle.color, bundle.color_from_depth @ pose, view.color, spec))
        plane = planes[k]
        if plane is not None:
            depth[k] = (
                bundle.offset_m + bundle.scale * plane.depth_m - plane_at(bundle.depth, pose, plane.pixel)
            )
    return Adjusted(bundle, tuple(problem.names), covariance, infrared, color, depth)


def _minimise(problem: _Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Levenberg and Marquardt's method on the normal equations: the solution and its normal matrix.

    The equations are a tenth as large as the Jacobian, and scaled to ones on the diagonal they are well
    conditioned enough for their inverse to be the covariance.
    """
    residual, jacobian = problem.evaluate(x)
    cost, damping = float(residual @ residual), 1e-4
    normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
    for _ in range(_MAX_STEPS):
        scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-30))
        scaled = normal * np.outer(scale, scale) + damping * np.eye(len(x))
        step = -scale * np.linalg.solve(scaled, scale * gradient)
        new_residual, new_jacobian = problem.evaluate(x + step)
        new_cost = float(new_residual @ new_residual)
        if not new_cost < cost:
            damping *= 10.0
            if damping > 1e8:
                break
            continue
        gained, cost = cost - new_cost, new_cost
        x, jacobian = x + step, new_jacobian
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ new_residual
        damping = max(damping / 10.0, 1e-12)
        if gained < 1e-7 * cost:
            break
    return x, normal


def _by_view(problem: _Problem, x: FloatArray, whole: FloatArray) -> FloatArray:
    """Covariance of the shared parameters, widened where the corners of a picture err together.

    A hand that moves between two exposures, or a bent board, shifts many corners alike, which independent
    noise does not explain. Summing the pull of each view on the parameters (the sandwich estimator, Liang and
    Zeger, Biometrika 1986, with the views as clusters) sees it; the wider of both is stated.
    """
    residual, jacobian = problem.evaluate(x)
    starts = [0, *problem.ends[:-1]]
    pulls = np.array([jacobian[a:b].T @ residual[a:b] for a, b in zip(starts, problem.ends, strict=True)])
    shared = problem.shared
    moved = pulls @ whole[:, :shared]
    views = len(problem.views)
    # With about eight numbers a view that the parameters share, few views look better than they are.
    correction = views / max(views - shared / 3.0, views / 4.0)
    clustered = correction * moved.T @ moved
    independent = whole[:shared, :shared]
    ratio = np.diag(clustered) / np.maximum(np.diag(independent), 1e-300)
    widen = np.sqrt(np.maximum(ratio, 1.0))
    return np.asarray(independent * np.outer(widen, widen))


def plane_at(camera: PinholeCamera, depth_from_board: RigidTransform, pixel: tuple[float, float]) -> float:
    """Depth in metres of the board's plane along a pixel's ray."""
    normal = depth_from_board.rotation[:, 2]
    return float(normal @ depth_from_board.translation / (normal @ camera.rays(np.array([pixel]))[0]))


def _off(camera: PinholeCamera | None, pose: RigidTransform, seen: object, spec: BoardSpec) -> FloatArray:
    from core.calibration.board import BoardView

    if camera is None or not isinstance(seen, BoardView):
        return np.zeros((0, 2))
    return seen.pixels - camera.project(pose.apply(spec.corners_m[seen.ids]))


def _intrinsics(camera: PinholeCamera) -> list[float]:
    return [
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        *camera.distortion,
        *(0.0,) * (5 - len(camera.distortion)),
    ]


def _turn(transform: RigidTransform) -> FloatArray:
    return np.asarray(cv2.Rodrigues(transform.rotation)[0], float).ravel()


def _transform(x: FloatArray) -> RigidTransform:
    return RigidTransform(np.asarray(cv2.Rodrigues(x[:3])[0], float), x[3:6].copy())
