"""Whether a lesion's distance rings meet beyond the rim of the seen skin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.relocation.signatures import LesionSignature
from core.relocation.tangent import tangent_slopes
from core.relocation.trilateration import FREEDOM, Fix, SkinField
from core.surface import BodySurface

FloatArray = NDArray[np.float64]

BEYOND_M = 0.015
"""A meeting place farther than this from the seen skin is not in the view."""
FARTHEST_M = 0.12


def meeting_step(
    field: SkinField, surface: BodySurface, signature: LesionSignature, vertex: int
) -> FloatArray | None:
    """Step (3,) in the tangent plane of a vertex to where the rings meet, to first order; None if unknown.

    One Gauss-Newton step of the robust cost. Inside the seen skin it is nearly zero at the minimum; at the
    rim it points to the skin behind.
    """
    model = tangent_slopes(field.distances, surface.vertices, surface.normals, vertex)
    with np.errstate(invalid="ignore"):  # an anchor that is connected in neither visit: inf - inf
        residual = field.distances[:, vertex].astype(float) - signature.distances_m
    use = np.isfinite(residual) & np.isfinite(model.slopes).all(axis=1)
    if use.sum() < 3:
        return None
    slopes, r, sigma = model.slopes[use], residual[use], signature.sigma_m[use]
    weight = (FREEDOM + 1.0) / (FREEDOM + (r / sigma) ** 2) / sigma**2
    normal = slopes.T @ (weight[:, None] * slopes) + np.eye(2) / FARTHEST_M**2
    step = -np.linalg.solve(normal, slopes.T @ (weight * r)) @ model.basis
    length = float(np.linalg.norm(step))
    return np.asarray(step * min(1.0, FARTHEST_M / max(length, 1e-9)))


def beyond_the_rim(
    surface: BodySurface, field: SkinField, signature: LesionSignature, fix: Fix, rig: CameraRig
) -> str:
    """Why the place is not in the view; empty when it is."""
    vertex = fix.best_vertex
    step = meeting_step(field, surface, signature, vertex)
    if step is None:
        return ""
    place = surface.vertices[vertex] + step
    nearest = surface.nearest(place)[0]
    gap = place - nearest.position_m
    normal = surface.normal_at(nearest)
    gap = gap - (gap @ normal) * normal
    if float(np.linalg.norm(gap)) < BEYOND_M:
        return ""
    inside = rig.depth.contains(rig.depth.project(place), 4)[0]
    if rig.color is not None:
        inside = inside and rig.color.contains(rig.project_to_picture(place), 4)[0]
    if not inside:
        return "The place lies outside the picture."
    return "The place lies beyond the edge of the skin that this view shows."
