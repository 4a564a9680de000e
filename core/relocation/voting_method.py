"""The thesis's relocation as a method of the registry (METHOD section 1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.relocation.field_store import FIELDS, GeodesicKind
from core.relocation.pair import PickedLesion, VisitPair, anchor_points
from core.relocation.registry import MethodContext, MethodOutcome
from core.relocation.signatures import LEAST_ANCHORS, LesionSignature, lesion_signatures
from core.relocation.types import Estimate
from core.relocation.voting import VotingOutcome, grid_edges, triangle_edges, vote
from core.surface import BodySurface

RADIUS95_M = 0.075
"""95 % of votes lay within this of the truth on the tuning bodies (same and other stance pooled)."""

EDGE_JUMP_M = 0.05


class VotingMethod:
    """Bands, votes, biggest cluster, mean, nearest candidate, on one kind of distances.

    Parameters
    ----------
    name : str
    kind : GeodesicKind
        "grid-dijkstra" (the thesis's DM) or "delaunay-fast-marching" (its FMM).
    """

    def __init__(self, name: str, kind: GeodesicKind) -> None:
        self.name = name
        self.kind: GeodesicKind = kind

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        names = pair.joint_names
        with context.clock.phase("geodesics"):
            first = FIELDS.fields(pair.first.scan.surface, anchor_points(pair.first, names), self.kind)
            context.progress(0.4, "Geodesics of the follow-up")
            followup = FIELDS.fields(
                pair.followup.scan.surface, anchor_points(pair.followup, names), self.kind
            )
        context.progress(0.8, "Voting")
        with context.clock.phase("voting"):
            surface = pair.followup.scan.surface
            edges = self.edges(surface, followup.triangles)
            signatures = lesion_signatures(first, lesions, at_pixels_of=pair.first.scan.surface)
            estimates = [
                _estimate(
                    s,
                    vote(followup.distances, s.distances_m, surface.vertices, edges, context.options.delta_m),
                    surface,
                )
                if s.reached >= LEAST_ANCHORS
                else Estimate(
                    None,
                    reason=f"Only {s.reached} anchors reach the lesion; {LEAST_ANCHORS} are needed.",
                )
                for s in signatures
            ]
        return MethodOutcome(tuple(estimates))

    def edges(
        self, surface: BodySurface, triangles: np.ndarray[tuple[int, ...], np.dtype[np.int32]]
    ) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
        """Edges of the graph the distances live on: clusters are connected along them."""
        if self.kind == "grid-dijkstra":
            return grid_edges(surface.vertex_of_pixel, surface.vertices, EDGE_JUMP_M)
        return triangle_edges(triangles)


def _estimate(signature: LesionSignature, outcome: VotingOutcome | None, surface: BodySurface) -> Estimate:
    if outcome is None:
        return Estimate(None, reason="No place of the follow-up lies in any band of the lesion.")
    share = outcome.most_votes / signature.reached
    unity = len(outcome.cluster) / len(outcome.candidates)
    return Estimate(
        point_m=surface.vertices[outcome.vertex],
        radius95_m=RADIUS95_M,
        confidence=float(np.clip(share * unity, 0.0, 0.9)),
        vertex=outcome.vertex,
    )
