"""Skin points between the anchors that the follow-up shows clearly: they tie far anchors together."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from core.geodesics import GeodesicFields
from core.relocation.trilateration import SkinField, trilaterate
from core.surface import BodySurface, SurfacePoint

FloatArray = NDArray[np.float64]

HELPERS = 32
RIM_M = 0.03
"""Helpers keep this far from the rim in the first visit, half as far in the follow-up."""
APART_M = 0.04
AGREEING = 0.6
"""Share of the anchors that must agree about a helper."""
LEAST_ANCHORS = 5

Spread = Callable[[FloatArray, FloatArray], FloatArray]


def place_helpers(
    field: SkinField, first: GeodesicFields, spread: Spread, surface1: BodySurface, surface2: BodySurface
) -> dict[str, tuple[SurfacePoint, SurfacePoint]]:
    """Skin points by name, on the first surface and where trilateration puts them on the follow-up's.

    Parameters
    ----------
    field, first : SkinField, GeodesicFields
        Anchor fields of the follow-up and of the first visit.
    spread : callable
        Spread (a, k) of distances (a, k) to places (k, 3).
    """
    points = [surface1.vertex_point(int(v)) for v in spread_out(surface1, first, HELPERS)]
    if not points:
        return {}
    distances = first.at(points)
    sigma = spread(distances, surface1.positions(points))
    rim = surface2.vertices[surface2.boundary]
    out: dict[str, tuple[SurfacePoint, SurfacePoint]] = {}
    for k, point in enumerate(points):
        if np.isfinite(distances[:, k]).sum() < LEAST_ANCHORS:
            continue
        fix = trilaterate(field, distances[:, k], sigma[:, k])
        if fix is None or fix.others or fix.inliers < AGREEING * fix.used:
            continue
        if float(np.linalg.norm(rim - surface2.vertices[fix.best_vertex], axis=1).min()) < RIM_M / 2:
            continue
        out[f"skin {k}"] = (point, surface2.nearest(fix.point_m)[0])
    return out


def spread_out(surface: BodySurface, fields: GeodesicFields, count: int) -> list[int]:
    """Vertices far from each other, from the anchors and from the rim (farthest-point sampling in space)."""
    from scipy.spatial import cKDTree

    candidates = np.flatnonzero(np.isfinite(fields.distances).any(axis=0))
    candidates = candidates[:: max(1, len(candidates) // 5000)]
    if len(candidates) == 0:
        return []
    depth, _ = cKDTree(surface.vertices[surface.boundary]).query(surface.vertices[candidates])
    allowed = candidates[depth > RIM_M]
    chosen: list[int] = []
    nearest = fields.distances[:, allowed].min(axis=0)
    while len(allowed) and len(chosen) < count:
        k = int(nearest.argmax())
        if nearest[k] < APART_M:
            break
        chosen.append(int(allowed[k]))
        away = np.linalg.norm(surface.vertices[allowed] - surface.vertices[allowed[k]], axis=1)
        nearest = np.minimum(nearest, away)
    return chosen
