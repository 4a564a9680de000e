"""The anchors of trilateration with their fields on both surfaces, refined to agree between visits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics import GeodesicFields
from core.relocation.field_store import FIELDS, GeodesicKind
from core.relocation.isometry import residual_sigma, solve_shifts
from core.relocation.pair import VisitPair, anchor_points
from core.relocation.registry import MethodContext
from core.relocation.tangent import tangent_slopes
from core.relocation.trilateration import STRETCH, SkinField, trilaterate, vertex_areas
from core.surface import BodySurface, SurfacePoint

FloatArray = NDArray[np.float64]

KIND: GeodesicKind = "virtual-source"
ISOMETRY_FLOOR_M = 0.006
"""Spread of a geodesic between two well-placed points: what noise and filtering leave."""
ISOMETRY_STRETCH = 0.03
LEAST_SIGMA_M = 0.008
HELPERS = 24
"""Further skin points of the first visit that trilateration places and that then serve as anchors."""
HELPER_PRIOR_M = 0.06
RIM_M = 0.03


@dataclass(frozen=True, eq=False)
class AnchorNetwork:
    """Nodes of trilateration: the shared anchors, and helpers between them.

    Attributes
    ----------
    first : GeodesicFields
        Fields of the nodes over the first surface.
    points : mapping of str to SurfacePoint
        The nodes on the follow-up's skin.
    field : SkinField
        Their fields over the follow-up.
    sigma_m : ndarray (a,)
        Spread that each node's own place adds to a distance difference.
    stretch : float
        Share of a distance that may be gained or lost.
    """

    first: GeodesicFields
    points: Mapping[str, SurfacePoint]
    field: SkinField
    sigma_m: FloatArray
    stretch: float


def build_network(pair: VisitPair, context: MethodContext) -> AnchorNetwork:
    """Fields of the shared anchors on both surfaces; refined unless the options forbid it."""
    names = pair.anchor_names
    surface1, surface2 = pair.first.scan.surface, pair.followup.scan.surface
    with context.clock.phase("geodesics"):
        first = FIELDS.fields(surface1, anchor_points(pair.first, names), KIND)
        points = anchor_points(pair.followup, names)
        context.progress(0.3, "Geodesics of the follow-up")
        second = FIELDS.fields(surface2, points, KIND)
    areas = vertex_areas(surface2.vertices, surface2.triangles)
    sigma = pair.sigma_m(names)
    network = AnchorNetwork(first, points, _skin_field(second, surface2, areas), sigma, STRETCH)
    if not context.options.refine_anchors or len(names) < 5:
        return network
    context.progress(0.5, "Matching the anchors of both visits")
    with context.clock.phase("anchors"):
        return _refined(pair, network, areas)


def _refined(pair: VisitPair, network: AnchorNetwork, areas: FloatArray) -> AnchorNetwork:
    """Two rounds: the anchors among themselves, then with helpers between them."""
    surface1, surface2 = pair.first.scan.surface, pair.followup.scan.surface
    anchors1 = anchor_points(pair.first, network.first.names)
    moved, left = _shifted(network, anchors1, network.points, surface2, network.sigma_m)
    second = FIELDS.fields(surface2, moved, KIND)
    rough = AnchorNetwork(network.first, moved, _skin_field(second, surface2, areas), left, STRETCH)
    helpers1, helpers2 = _helpers(rough, surface1, surface2)
    if len(helpers1) < 4:
        return rough
    all1, all2 = {**anchors1, **helpers1}, {**moved, **helpers2}
    first = _joined(network.first, FIELDS.fields(surface1, helpers1, KIND))
    second = _joined(second, FIELDS.fields(surface2, helpers2, KIND))
    prior = np.concatenate([network.sigma_m, np.full(len(helpers1), HELPER_PRIOR_M)])
    joint = AnchorNetwork(first, all2, _skin_field(second, surface2, areas), prior, STRETCH)
    final, sigma = _shifted(joint, all1, all2, surface2, prior)
    fields = FIELDS.fields(surface2, final, KIND)
    return AnchorNetwork(first, final, _skin_field(fields, surface2, areas), sigma, STRETCH)


def _shifted(
    network: AnchorNetwork,
    nodes1: Mapping[str, SurfacePoint],
    nodes2: Mapping[str, SurfacePoint],
    surface: BodySurface,
    prior_m: FloatArray,
) -> tuple[dict[str, SurfacePoint], FloatArray]:
    distances = network.field.distances
    first = network.first.at(list(nodes1.values())).T
    vertices = surface.nearest_vertex(np.array([p.position_m for p in nodes2.values()]))
    models = [tangent_slopes(distances, surface.vertices, surface.normals, int(v)) for v in vertices]
    offsets = np.array([p.position_m for p in nodes2.values()]) - surface.vertices[vertices]
    slopes = np.stack([m.slopes for m in models])
    lift = np.stack([m.basis @ o for m, o in zip(models, offsets, strict=True)])
    second = distances[:, vertices].T + np.einsum("ijk,ik->ij", np.nan_to_num(slopes), lift)
    spread = residual_sigma(first, ISOMETRY_STRETCH, ISOMETRY_FLOOR_M)
    shifts, sigma = solve_shifts(first, second, slopes, prior_m, spread)
    target = np.stack(
        [p.position_m + s @ m.basis for p, s, m in zip(nodes2.values(), shifts, models, strict=True)]
    )
    placed = surface.nearest(target)
    return dict(zip(nodes2, placed, strict=True)), np.maximum(sigma, LEAST_SIGMA_M)


def _helpers(
    network: AnchorNetwork, surface1: BodySurface, surface2: BodySurface
) -> tuple[dict[str, SurfacePoint], dict[str, SurfacePoint]]:
    """Skin points spread over the first surface that the follow-up shows in one clear place."""
    chosen = _spread_out(surface1, network.first, HELPERS)
    points1 = [surface1.vertex_point(int(v)) for v in chosen]
    distances = network.first.at(points1)
    rim = surface2.vertices[surface2.boundary]
    out1: dict[str, SurfacePoint] = {}
    out2: dict[str, SurfacePoint] = {}
    for k, (point, column) in enumerate(zip(points1, distances.T, strict=True)):
        if np.isfinite(column).sum() < 5:
            continue
        fix = trilaterate(
            network.field, column, np.hypot(network.sigma_m, STRETCH * np.nan_to_num(column, posinf=0))
        )
        if fix is None or fix.others or fix.inliers < 0.6 * fix.used:
            continue
        if float(np.linalg.norm(rim - surface2.vertices[fix.best_vertex], axis=1).min()) < RIM_M / 2:
            continue
        name = f"skin {k}"
        out1[name], out2[name] = point, surface2.nearest(fix.point_m)[0]
    return out1, out2


def _spread_out(surface: BodySurface, fields: GeodesicFields, count: int) -> list[int]:
    """Vertices far from each other, from the anchors and from the rim (farthest-point sampling in space)."""
    from scipy.spatial import cKDTree

    depth, _ = cKDTree(surface.vertices[surface.boundary]).query(surface.vertices)
    allowed = np.flatnonzero((depth > RIM_M) & np.isfinite(fields.distances).any(axis=0))
    if len(allowed) == 0:
        return []
    allowed = allowed[:: max(1, len(allowed) // 6000)]
    nearest = fields.distances[:, allowed].min(axis=0)
    chosen: list[int] = []
    for _ in range(count):
        k = int(nearest.argmax())
        if nearest[k] < 0.05:
            break
        chosen.append(int(allowed[k]))
        nearest = np.minimum(
            nearest, np.linalg.norm(surface.vertices[allowed] - surface.vertices[allowed[k]], axis=1)
        )
    return chosen


def _skin_field(fields: GeodesicFields, surface: BodySurface, areas: FloatArray) -> SkinField:
    return SkinField(
        np.ascontiguousarray(fields.distances, dtype=np.float32), surface.vertices, areas, surface.boundary
    )


def _joined(a: GeodesicFields, b: GeodesicFields) -> GeodesicFields:
    return GeodesicFields(
        a.names + b.names, np.vstack([a.distances, b.distances]), a.vertices, a.triangles, a.method
    )
