"""Several views, one lesion: which answer counts, and whether the answers speak of the same skin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.anchors import AnalysedCapture
from core.relocation.types import Candidate, LesionStatus, RelocatedLesion
from core.relocation.views import BoneBridge, frontality

TIGHT_M = 0.012
"""An answer seen again (status found) whose region is no longer than this needs no second view."""
TIGHT_GEOMETRY_M = 0.025
"""The same where colour is not used, so that no view can do more than compute the place."""
WELL_SEEN = 0.5
"""Cosine from which on another view would hardly show the place better (60 degrees)."""
SURE = 0.5
"""Confidence that such an answer needs."""

CARRY_ERROR_M = 0.08
"""What carrying a place from view to view by the skeleton may be wrong by, beside the answers' own regions.

Where the skeletons fit (`core.relocation.views.MISFIT_M`) it was 18 mm at most on simulated patients; a place
read into the wrong arm or onto the other flank is off by decimetres."""
CONTRADICTED = 0.5
"""An answer that another view contradicts keeps this share of its confidence."""

STATUS_RANK: dict[LesionStatus, int] = {
    "found": 4,
    "predicted": 3,
    "ambiguous": 2,
    "not_visible": 1,
    "refused": 0,
}


def region_size_m(lesion: RelocatedLesion) -> float:
    """Half length of the 95 % region; infinite without one."""
    if lesion.region is not None:
        return float(lesion.region.axes_m[0])
    return float("inf") if lesion.radius95_m is None else lesion.radius95_m


def is_settled(lesion: RelocatedLesion, followup: AnalysedCapture, *, appearance: bool) -> bool:
    """Whether no other view can be expected to answer better."""
    if lesion.point_m is None or lesion.confidence < SURE:
        return False
    size = region_size_m(lesion)
    if lesion.status == "found":
        return size <= TIGHT_M
    if lesion.status == "predicted" and not appearance:
        return size <= TIGHT_GEOMETRY_M and frontality(followup, lesion.point_m) >= WELL_SEEN
    return False


def best_of_views(
    answers: Sequence[RelocatedLesion], followup: Mapping[str, AnalysedCapture]
) -> tuple[RelocatedLesion, str]:
    """The answer that counts, and a warning where views contradict each other (else empty).

    Status counts first, then the size of the region, then how frontally the place is seen. A lesion is not
    visible only if no view sees it, and refused only if all views refuse.
    """
    placed = [a for a in answers if a.point_m is not None]
    if not placed:
        return _nowhere(answers), ""
    ranked = sorted(placed, key=lambda a: _rank(a, followup), reverse=True)
    best = ranked[0]
    for other in ranked[1:]:
        if best.status != "ambiguous" and other.status != "ambiguous":
            contradiction = _contradiction(best, other, followup)
            if contradiction is not None:
                return contradiction
    return best, ""


def _rank(lesion: RelocatedLesion, followup: Mapping[str, AnalysedCapture]) -> tuple[float, ...]:
    assert lesion.point_m is not None
    seen = 0.0 if lesion.capture is None else frontality(followup[lesion.capture], lesion.point_m)
    return STATUS_RANK[lesion.status], -round(region_size_m(lesion), 3), seen, lesion.confidence


def _nowhere(answers: Sequence[RelocatedLesion]) -> RelocatedLesion:
    best = max(answers, key=lambda a: STATUS_RANK[a.status])
    if len(answers) == 1:
        return best
    reasons: dict[str, list[str]] = {}
    for answer in answers:
        reasons.setdefault(answer.reason, []).append(str(answer.capture))
    if len(reasons) == 1:
        return replace(best, capture=None)
    told = " ".join(f"{', '.join(names)}: {reason}" for reason, names in reasons.items())
    return replace(best, reason=told, capture=None)


def _contradiction(
    best: RelocatedLesion, other: RelocatedLesion, followup: Mapping[str, AnalysedCapture]
) -> tuple[RelocatedLesion, str] | None:
    """The doubted answer and a warning, if the two places cannot be the same skin; None if they can.

    The other view's place is carried over by the skeleton, which is sharp to some centimetres: two moles side
    by side cannot be told apart in this way, an arm and a flank can.
    """
    assert best.point_m is not None
    assert other.point_m is not None
    if best.capture is None or other.capture is None:
        return None
    carried = BoneBridge(followup[other.capture], followup[best.capture]).carry(other.point_m)
    if carried is None:
        return None
    apart = float(np.linalg.norm(carried.point_m - best.point_m))
    allowed = CARRY_ERROR_M + min(region_size_m(best), 0.1) + min(region_size_m(other), 0.1)
    if apart <= allowed:
        return None
    analysed = followup[best.capture]
    place = analysed.scan.surface.nearest(carried.point_m)[0].position_m
    rig = analysed.capture.rig
    pixel, depth = rig.project_to_picture(place)[0], rig.depth.project(place)[0]
    candidates = best.candidates
    if carried.seen:
        u, v = float(pixel[0]), float(pixel[1])
        candidates = (
            *candidates,
            Candidate(place, other.confidence * CONTRADICTED, (u, v), (float(depth[0]), float(depth[1]))),
        )
    told = f"the views {best.capture} and {other.capture} answer with places {apart * 100:.0f} cm apart"
    doubted = replace(
        best,
        status="ambiguous",
        confidence=best.confidence * CONTRADICTED,
        candidates=candidates,
        reason=f"{told[0].upper()}{told[1:]} on the body. {best.reason}",
    )
    return doubted, f"Lesion {best.id}: {told}."
