"""Robust trilateration as a method of the registry: anchors refined, lesions placed, radii stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import carry, nearest_bone
from core.relocation.network import AnchorNetwork, build_network
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.posterior import confidence, radius95_m, skin_region
from core.relocation.registry import MethodContext, MethodOutcome
from core.relocation.rim import beyond_the_rim
from core.relocation.signatures import LEAST_ANCHORS, LesionSignature, lesion_signatures
from core.relocation.trilateration import neighbourhood_cost, trilaterate
from core.relocation.types import Candidate, Estimate

FloatArray = NDArray[np.float64]


NEIGHBOURHOOD_M = 0.10
"""How well the skeleton alone knows a place: enough to tell the left arm from the right."""


class TrilaterationMethod:
    """Student-t trilateration on virtual-source geodesics (METHOD section 3)."""

    name = "trilateration"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        network = build_network(pair, context)
        context.progress(0.85, "Trilaterating")
        with context.clock.phase("trilateration"):
            signatures = lesion_signatures(network.first, lesions, network.distance_spread_m)
            estimates = tuple(_estimate(pair, network, s) for s in signatures)
        return MethodOutcome(estimates)


def _estimate(pair: VisitPair, network: AnchorNetwork, signature: LesionSignature) -> Estimate:
    if signature.reached < LEAST_ANCHORS:
        return Estimate(
            None,
            reason=f"Only {signature.reached} anchors reach the lesion; {LEAST_ANCHORS} are needed.",
        )
    expected, skeleton = None, network.joints.bones
    if skeleton:
        place = carry(signature.position_m, nearest_bone(signature.position_m, skeleton))
        expected = neighbourhood_cost(network.field.vertices, place, NEIGHBOURHOOD_M)
    fix = trilaterate(network.field, signature.distances_m, signature.sigma_m, extra_cost=expected)
    if fix is None or fix.used < LEAST_ANCHORS:
        used = 0 if fix is None else fix.used
        return Estimate(
            None,
            reason=f"Only {used} of the lesion's anchors reach this skin; {LEAST_ANCHORS} are needed.",
        )
    surface = pair.followup.scan.surface
    point = surface.nearest(fix.point_m)[0]
    candidates = tuple(
        Candidate(surface.vertices[vertex], round(confidence(fix) * float(np.exp(-excess / 2)), 4))
        for vertex, excess in fix.others
    )
    return Estimate(
        point_m=point.position_m,
        radius95_m=radius95_m(fix),
        confidence=confidence(fix),
        vertex=fix.best_vertex,
        candidates=candidates,
        region=skin_region(fix, surface.normals[fix.best_vertex]),
        hidden=beyond_the_rim(surface, network.field, signature, fix, pair.followup.capture.rig),
    )
