"""What registration libraries give: iterative closest point (Open3D), coherent point drift (pycpd)."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from core.evaluation.baselines import joint_alignment, on_skin
from core.relocation import MethodContext, MethodOutcome
from core.relocation.pair import PickedLesion, VisitPair
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

_ICP_GATES_M = (0.20, 0.05)
_ICP_ITERATIONS = 60

_CPD_POINTS = 600
_CPD_BETA, _CPD_ALPHA = 2.0, 2.0
"""pycpd's own defaults: width of the motion's kernel in units of the body's spread, and its stiffness."""
_CPD_OUTLIERS = 0.1
_CPD_ITERATIONS, _CPD_TOLERANCE = 50, 1e-7
_CPD_START_M = 0.1
"""Spread of the first correspondences. The library's own start, the whole body, forgets the joints' fit, and
its own tolerance stops the drift half-way: on a tuning pair the mean error was 67 mm then, 14 mm so
(1000 points)."""


class IterativeClosestPoint:
    """The body moved as one stiff piece until the surfaces meet (point to plane), from the joints' fit."""

    name = "icp"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        import open3d

        registration = open3d.pipelines.registration
        clouds = []
        for surface in (pair.first.scan.surface, pair.followup.scan.surface):
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(surface.vertices))
            cloud.normals = open3d.utility.Vector3dVector(surface.normals)
            clouds.append(cloud)
        rotation, translation = joint_alignment(pair)
        motion = np.eye(4)
        motion[:3, :3], motion[:3, 3] = rotation, translation
        for gate in _ICP_GATES_M:
            motion = registration.registration_icp(
                *clouds,
                gate,
                motion,
                registration.TransformationEstimationPointToPlane(),
                registration.ICPConvergenceCriteria(max_iteration=_ICP_ITERATIONS),
            ).transformation
        places = np.array([motion[:3, :3] @ p.point.position_m + motion[:3, 3] for p in lesions])
        return on_skin(pair, places)


class CoherentPointDrift:
    """Both skins as 600 points, drifted together (Myronenko and Song 2010) from the joints' fit."""

    name = "cpd"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        from pycpd import DeformableRegistration  # type: ignore[import-untyped]

        rng = np.random.default_rng(context.seed)
        rotation, translation = joint_alignment(pair)
        target = _some_points(pair.followup.scan.surface, rng)
        source = _some_points(pair.first.scan.surface, rng) @ rotation.T + translation
        places = np.array([rotation @ p.point.position_m + translation for p in lesions])
        middle = target.mean(axis=0)
        spread = float(np.sqrt(((target - middle) ** 2).sum(axis=1).mean()))
        source, target, places = ((x - middle) / spread for x in (source, target, places))
        drift = DeformableRegistration(
            X=target,
            Y=source,
            alpha=_CPD_ALPHA,
            beta=_CPD_BETA,
            w=_CPD_OUTLIERS,
            sigma2=(_CPD_START_M / spread) ** 2,
            max_iterations=_CPD_ITERATIONS,
            tolerance=_CPD_TOLERANCE,
        )
        drift.register()
        weights = drift.get_registration_parameters()[1]
        away = ((places[:, None] - source[None]) ** 2).sum(axis=2)
        moved = places + np.exp(-away / (2 * _CPD_BETA**2)) @ weights
        return on_skin(pair, moved * spread + middle)


def has_cpd() -> bool:
    """Whether the library for coherent point drift is installed; it is a tool of development."""
    return find_spec("pycpd") is not None


def _some_points(surface: BodySurface, rng: np.random.Generator) -> FloatArray:
    """Points drawn by the area of skin they stand for, so that near skin counts no more than far."""
    weight = surface.vertices[:, 2] ** 2
    count = min(_CPD_POINTS, len(weight))
    rows = rng.choice(len(weight), count, replace=False, p=weight / weight.sum())
    return np.asarray(surface.vertices[rows])
