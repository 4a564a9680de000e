"""The anchors of trilateration with their fields on both surfaces, refined to agree between visits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geodesics import GeodesicFields
from core.relocation.articulation import Articulation, articulation
from core.relocation.bones import bones
from core.relocation.field_store import FIELDS, GeodesicKind
from core.relocation.helpers import place_helpers
from core.relocation.isometry import residual_sigma, solve_shifts
from core.relocation.pair import VisitPair, anchor_points
from core.relocation.registry import MethodContext
from core.relocation.shortcuts import is_shortcut, moved
from core.relocation.tangent import tangent_slopes
from core.relocation.trilateration import STRETCH, SkinField, vertex_areas
from core.surface import BodySurface, SurfacePoint

FloatArray = NDArray[np.float64]

KIND: GeodesicKind = "virtual-source"
ISOMETRY_FLOOR_M = 0.006
"""Spread of a geodesic between two well-placed points: what noise and filtering leave."""
ISOMETRY_STRETCH = 0.03
LEAST_SIGMA_M = 0.008
CERTAIN_M = 0.005
"""Spread of a lesion that the doctor has confirmed in both visits."""
HELPER_PRIOR_M = 0.06
LEAST_ANCHORS_TO_REFINE = 5
LEAST_HELPERS = 4


@dataclass(frozen=True, eq=False)
class AnchorNetwork:
    """Nodes of trilateration: the shared anchors, and helpers between them.

    Attributes
    ----------
    first : GeodesicFields
        Fields of the nodes over the first surface.
    places : mapping of str to SurfacePoint
        The nodes on the first skin.
    points : mapping of str to SurfacePoint
        The nodes on the follow-up's skin.
    field : SkinField
        Their fields over the follow-up.
    sigma_m : ndarray (a,)
        Spread that each node's own place adds to a distance difference.
    joints : Articulation
        What bent between the captures.
    """

    first: GeodesicFields
    places: Mapping[str, SurfacePoint]
    points: Mapping[str, SurfacePoint]
    field: SkinField
    sigma_m: FloatArray
    joints: Articulation

    def distance_spread_m(self, distances: FloatArray, places_m: FloatArray) -> FloatArray:
        """Spread (a, k) of distances (a, k) from the nodes to places (k, 3) of the first visit."""
        stretch = STRETCH * np.where(np.isfinite(distances), distances, 0.0)
        bend = self.joints.spread_m(_positions(self.places), places_m)
        return np.asarray(np.sqrt(self.sigma_m[:, None] ** 2 + stretch**2 + bend**2))


def build_network(pair: VisitPair, context: MethodContext) -> AnchorNetwork:
    """Fields of the shared anchors on both surfaces; refined unless the options forbid it."""
    network = plain_network(pair, context, pair.anchor_names)
    if not context.options.refine_anchors or len(network.places) < LEAST_ANCHORS_TO_REFINE:
        return network
    context.progress(0.5, "Matching the anchors of both visits")
    with context.clock.phase("anchors"):
        return _refined(pair, network)


def plain_network(pair: VisitPair, context: MethodContext, names: tuple[str, ...]) -> AnchorNetwork:
    """Fields of named anchors and of the confirmed lesions on both surfaces, as they were found."""
    surface1, surface2 = pair.first.scan.surface, pair.followup.scan.surface
    certain1 = {f"lesion {k.id}": k.first for k in context.known}
    certain2 = {f"lesion {k.id}": k.followup for k in context.known}
    with context.clock.phase("geodesics"):
        places, points = anchor_points(pair.first, names), anchor_points(pair.followup, names)
        first = FIELDS.fields(surface1, places, KIND)
        context.progress(0.3, "Geodesics of the follow-up")
        second = FIELDS.fields(surface2, points, KIND)
        if certain1:
            first = _joined(first, FIELDS.fields(surface1, certain1, KIND))
            second = _joined(second, FIELDS.fields(surface2, certain2, KIND))
    places, points = {**places, **certain1}, {**points, **certain2}
    joints = articulation(pair, bones(pair))
    first = _without_shortcuts(first, places, joints)
    areas = vertex_areas(surface2.vertices, surface2.triangles)
    field = _skin_field(second, surface2, areas, points, joints)
    sigma = np.concatenate([pair.sigma_m(names), np.full(len(certain1), CERTAIN_M)])
    return AnchorNetwork(first, places, points, field, sigma, joints)


def _refined(pair: VisitPair, network: AnchorNetwork) -> AnchorNetwork:
    """Two rounds: the anchors among themselves, then with helpers between them."""
    surface1, surface2 = pair.first.scan.surface, pair.followup.scan.surface
    rough = _shifted(network, surface2, network.sigma_m, network.points)
    placed = place_helpers(rough.field, rough.first, rough.distance_spread_m, surface1, surface2)
    if len(placed) < LEAST_HELPERS:
        return rough
    helpers1 = {name: one for name, (one, _) in placed.items()}
    helpers2 = {name: two for name, (_, two) in placed.items()}
    prior = np.concatenate([network.sigma_m, np.full(len(placed), HELPER_PRIOR_M)])
    second = FIELDS.fields(surface2, helpers2, KIND)
    added = _skin_field(second, surface2, rough.field.areas, helpers2, network.joints)
    distances = np.vstack([rough.field.distances, added.distances])
    joint = AnchorNetwork(
        first=_joined(
            rough.first,
            _without_shortcuts(FIELDS.fields(surface1, helpers1, KIND), helpers1, network.joints),
        ),
        places={**rough.places, **helpers1},
        points={**rough.points, **helpers2},
        field=SkinField(distances, surface2.vertices, rough.field.areas, surface2.boundary),
        sigma_m=prior,
        joints=network.joints,
    )
    return _shifted(joint, surface2, prior, {**network.points, **helpers2})


def _shifted(
    network: AnchorNetwork,
    surface: BodySurface,
    prior_m: FloatArray,
    evidence: Mapping[str, SurfacePoint],
) -> AnchorNetwork:
    """The network with its nodes shifted on the follow-up's skin; ``evidence`` is where each was seen."""
    distances = network.field.distances
    first = network.first.at(list(network.places.values())).T
    here = _positions(network.points)
    vertices = surface.nearest_vertex(here)
    models = [tangent_slopes(distances, surface.vertices, surface.normals, int(v)) for v in vertices]
    slopes = np.stack([m.slopes for m in models])
    basis = np.stack([m.basis for m in models])
    lift = np.einsum("ikc,ic->ik", basis, here - surface.vertices[vertices])
    wished = np.einsum("ikc,ic->ik", basis, _positions(evidence) - here)
    second = distances[:, vertices].T + np.einsum("ijk,ik->ij", np.nan_to_num(slopes), lift)
    places = _positions(network.places)
    spread = np.hypot(
        residual_sigma(first, ISOMETRY_STRETCH, ISOMETRY_FLOOR_M), network.joints.spread_m(places, places)
    )
    shifts, sigma = solve_shifts(first, second, slopes, prior_m, spread, wished)
    placed = surface.nearest(here + np.einsum("ik,ikc->ic", shifts, basis))
    points = dict(zip(network.points, placed, strict=True))
    fields = FIELDS.fields(surface, points, KIND)
    return AnchorNetwork(
        network.first,
        network.places,
        points,
        _skin_field(fields, surface, network.field.areas, points, network.joints),
        np.maximum(sigma, LEAST_SIGMA_M),
        network.joints,
    )


def _positions(points: Mapping[str, SurfacePoint]) -> FloatArray:
    return np.array([p.position_m for p in points.values()]).reshape(-1, 3)


def _skin_field(
    fields: GeodesicFields,
    surface: BodySurface,
    areas: FloatArray,
    points: Mapping[str, SurfacePoint],
    joints: Articulation,
) -> SkinField:
    """Fields of the follow-up for trilateration; shortcuts are unknown distances there."""
    distances = fields.distances.astype(np.float32)
    short = is_shortcut(moved(joints.bones), _positions(points), surface.vertices, distances)
    distances[short] = np.nan
    return SkinField(distances, surface.vertices, areas, surface.boundary)


def _without_shortcuts(
    fields: GeodesicFields, places: Mapping[str, SurfacePoint], joints: Articulation
) -> GeodesicFields:
    """Fields of the first visit in which a shortcut counts as not connected."""
    short = is_shortcut(joints.bones, _positions(places), fields.vertices, fields.distances)
    distances = np.where(short, np.inf, fields.distances)
    return GeodesicFields(fields.names, distances, fields.vertices, fields.triangles, fields.method)


def _joined(a: GeodesicFields, b: GeodesicFields) -> GeodesicFields:
    return GeodesicFields(
        a.names + b.names, np.vstack([a.distances, b.distances]), a.vertices, a.triangles, a.method
    )
