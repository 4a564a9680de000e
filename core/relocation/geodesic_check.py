"""Trilateration of geodesics beside the registration: an answer by other evidence."""

from __future__ import annotations

from collections.abc import Sequence

from core.relocation.bones import carry, nearest_bone
from core.relocation.network import plain_network
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.registry import MethodContext
from core.relocation.signatures import LEAST_ANCHORS, lesion_signatures
from core.relocation.trilateration import Fix, neighbourhood_cost, trilaterate
from core.relocation.trilateration_method import NEIGHBOURHOOD_M


def geodesic_fixes(
    pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
) -> tuple[Fix | None, ...]:
    """Where the distances to the joints, and to confirmed lesions, put each lesion; None where too few
    reach it.

    The anchors stand where the tracker saw them: refining them costs a hundred more geodesics a visit, and
    the check needs to tell a wrong limb, not millimetres.
    """
    network = plain_network(pair, context, pair.joint_names)
    out: list[Fix | None] = []
    with context.clock.phase("trilateration"):
        for signature in lesion_signatures(network.first, lesions, network.distance_spread_m):
            if signature.reached < LEAST_ANCHORS:
                out.append(None)
                continue
            expected, skeleton = None, network.joints.bones
            if skeleton:
                place = carry(signature.position_m, nearest_bone(signature.position_m, skeleton))
                expected = neighbourhood_cost(network.field.vertices, place, NEIGHBOURHOOD_M)
            fix = trilaterate(network.field, signature.distances_m, signature.sigma_m, extra_cost=expected)
            out.append(None if fix is None or fix.used < LEAST_ANCHORS else fix)
    return tuple(out)
