"""Whether two captures can be compared at all: the same side of the same person, with enough anchors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.geodesics import GeodesicFields
from core.relocation.bones import torso_rotation
from core.relocation.field_store import FIELDS
from core.relocation.pair import VisitPair, anchor_points
from core.relocation.signatures import LEAST_ANCHORS
from core.relocation.views import opposite

FloatArray = NDArray[np.float64]

OPPOSITE_DEG = 110.0
"""A trunk turned farther shows other skin."""
WHOLE_BODY_PAIRS = 66
"""Pairs of anchors (twelve anchors) from which on a whole body was compared."""
SIZE_DIFFERENCE, PART_SIZE_DIFFERENCE = 0.10, 0.25
"""Median relative difference of inter-anchor geodesics beyond which it is another person: of whole bodies,
and of parts. The same person stayed below 0.04 on simulated whole bodies, below 0.21 on single noisy frames
of upper bodies."""
SHAPE_DIFFERENCE = 0.20
"""Median absolute deviation from that median: the same, for people of one size.

The same person stayed below 0.06 and 0.13."""
PAIR_LEAST_M = 0.15


def why_not(pair: VisitPair) -> str:
    """Why these captures carry no answer for any lesion; empty when they do."""
    if opposite(pair.first, pair.followup):
        return "The two captures show different sides of the body, as their views say."
    rotation = torso_rotation(pair)
    if rotation is not None:
        angle = np.degrees(np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0)))
        if angle > OPPOSITE_DEG:
            return f"The two captures show different sides of the body (turned by {angle:.0f} degrees)."
    count = len(pair.joint_names)
    if count < LEAST_ANCHORS:
        return f"Only {count} anchors were found in both captures; {LEAST_ANCHORS} are needed."
    names = pair.joint_names
    first = FIELDS.fields(pair.first.scan.surface, anchor_points(pair.first, names), "virtual-source")
    second = FIELDS.fields(pair.followup.scan.surface, anchor_points(pair.followup, names), "virtual-source")
    size, shape, pairs = proportions(pair, first, second)
    limit = SIZE_DIFFERENCE if pairs >= WHOLE_BODY_PAIRS else PART_SIZE_DIFFERENCE
    if pairs >= 6 and abs(size) > limit:
        word = "larger" if size > 0 else "smaller"
        return f"The follow-up shows another person: its body distances are {abs(size):.0%} {word}."
    if pairs >= 15 and shape > SHAPE_DIFFERENCE:
        return "The follow-up shows another person: the body's proportions disagree with the first visit."
    return ""


def proportions(pair: VisitPair, first: GeodesicFields, second: GeodesicFields) -> tuple[float, float, int]:
    """Median relative difference of inter-anchor geodesics, its absolute deviation, number of pairs."""
    one = first.at([pair.first.anchors[n].point for n in first.names])
    two = second.at([pair.followup.anchors[n].point for n in second.names])
    upper = np.triu_indices(len(one), 1)
    a, b = one[upper], two[upper]
    use = np.isfinite(a) & np.isfinite(b) & (a > PAIR_LEAST_M) & (b > PAIR_LEAST_M)
    if not use.any():
        return 0.0, 0.0, 0
    ratio = np.log(b[use] / a[use])
    middle = float(np.median(ratio))
    return float(np.expm1(middle)), float(np.median(np.abs(ratio - middle))), int(use.sum())
