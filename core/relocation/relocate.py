"""Finding the lesions of a first visit again in a follow-up: the way of the data from captures to answers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.anchors import AnalysedCapture
from core.errors import InputError
from core.progress import Progress, ScaledProgress, no_progress
from core.relocation.bones import Bone, bones
from core.relocation.clock import PhaseClock
from core.relocation.compatibility import why_not
from core.relocation.depth_floor import widened
from core.relocation.pair import KnownPlace, PickedLesion, VisitPair
from core.relocation.registry import DEFAULT_METHOD, MethodContext, MethodOutcome, relocation_method
from core.relocation.sides import with_sides_settled
from core.relocation.types import (
    Candidate,
    ConfirmedLesion,
    Estimate,
    LesionQuery,
    LesionStatus,
    RelocatedLesion,
    RelocationOptions,
    RelocationResult,
)
from core.relocation.visibility import turned_away
from core.surface import SkinPick, pick_skin, pick_skin_depth


def relocate(
    first: AnalysedCapture,
    followup: AnalysedCapture,
    queries: Sequence[LesionQuery],
    *,
    method: str = DEFAULT_METHOD,
    appearance: bool = True,
    seed: int = 0,
    options: RelocationOptions | None = None,
    confirmed: Sequence[ConfirmedLesion] = (),
    progress: Progress = no_progress,
) -> RelocationResult:
    """Find lesions of one capture again in another.

    Parameters
    ----------
    first, followup : AnalysedCapture
    queries : sequence of LesionQuery
        With pixels of ``first``'s picture.
    method : str
        A key of `core.relocation.RELOCATION_METHODS`.
    appearance : bool
        Whether colour may be used for matching.
    seed : int
        Of every random draw, so that a result can be repeated.
    confirmed : sequence of ConfirmedLesion
        Lesions whose place in both captures is certain: anchors beside the skeleton's.

    Returns
    -------
    RelocationResult
        One answer per query, in their order.

    Raises
    ------
    InputError
        Unknown method, or a pixel outside the picture.
    Cancelled
        Through ``progress``.
    """
    chosen = relocation_method(method)
    options = options or RelocationOptions()
    clock = PhaseClock()
    progress(0.0, "Placing the lesions on the skin")
    with clock.phase("lesions"):
        picks = [pick_query(first, query) for query in queries]
    placed = [
        PickedLesion(q, p.point, p.normal)
        for q, p in zip(queries, picks, strict=True)
        if p.point is not None and p.normal is not None
    ]
    pair, remarks = VisitPair(first, followup), tuple[str, ...]()
    outcome, obstacle = MethodOutcome(()), ""
    if placed:
        progress(0.05, "Comparing the captures")
        with clock.phase("sides"):
            pair, remarks = with_sides_settled(pair)
        with clock.phase("geodesics"):
            obstacle = why_not(pair)
        if not obstacle:
            context = MethodContext(
                options,
                appearance,
                seed,
                clock,
                ScaledProgress(progress, 0.1, 0.95),
                _certain(first, followup, confirmed),
            )
            outcome = chosen.estimate(pair, placed, context)
    with clock.phase("visibility"):
        by_skeleton = options.check_visibility and not outcome.sight_judged and placed and not obstacle
        skeleton = bones(pair) if by_skeleton else ()
        told = tuple(widened(estimate, pair.depth_excess_m2) for estimate in outcome.estimates)
        estimates = dict(zip((id(p.query) for p in placed), zip(placed, told, strict=False), strict=False))
        lesions = tuple(
            _refused(query, pick.reason or "The click is not on the skin.")
            if pick.point is None
            else _refused(query, obstacle)
            if obstacle
            else _answer(pair, *estimates[id(query)], skeleton, options, outcome.sight_judged)
            for query, pick in zip(queries, picks, strict=True)
        )
    progress(1.0, "Done")
    warnings = tuple(
        dict.fromkeys(
            (
                *(f"First visit: {w}" for w in first.warnings),
                *(f"Follow-up: {w}" for w in followup.warnings),
                *(f"Lesion {q.id}: {w}" for q, p in zip(queries, picks, strict=True) for w in p.warnings),
                *remarks,
                *outcome.warnings,
            )
        )
    )
    return RelocationResult(
        chosen.name, lesions, clock.seconds(), warnings, outcome.new_spots, outcome.vanished_spots
    )


def _certain(
    first: AnalysedCapture, followup: AnalysedCapture, confirmed: Sequence[ConfirmedLesion]
) -> tuple[KnownPlace, ...]:
    """Confirmed lesions on both skins; those whose pixel is not on the skin are left out."""
    out = []
    for lesion in confirmed:
        here = pick_query(first, lesion.first)
        there = pick_skin(followup.scan, lesion.followup_pixel)
        if here.point is not None and there.point is not None:
            out.append(KnownPlace(lesion.first.id, here.point, there.point))
    return tuple(out)


def pick_query(first: AnalysedCapture, query: LesionQuery) -> SkinPick:
    """The skin under a query's pixel.

    Raises
    ------
    InputError
        If the pixel is outside the image.
    """
    head = first.skeleton.joints.get("head")
    head_m = None if head is None else head.point_m
    rig = first.capture.rig
    pixel, camera, field = (
        (query.pixel, rig.picture_camera, "pixel")
        if query.pixel is not None
        else (query.depth_pixel, rig.depth, "depth_pixel")
    )
    assert pixel is not None
    if not np.isfinite(pixel).all() or not camera.contains(pixel)[0]:
        raise InputError(
            f'Lesion "{query.id}": {field} [{pixel[0]:g}, {pixel[1]:g}] is outside the first visit\'s image '
            f"({camera.width} x {camera.height})."
        )
    pick = pick_skin if query.pixel is not None else pick_skin_depth
    return pick(first.scan, pixel, head_m=head_m)


def _refused(query: LesionQuery, reason: str) -> RelocatedLesion:
    return RelocatedLesion(query.id, "refused", reason)


LEAST_CONFIDENCE = 0.1
"""An answer below is no answer."""


def _answer(
    pair: VisitPair,
    lesion: PickedLesion,
    estimate: Estimate,
    skeleton: tuple[Bone, ...],
    options: RelocationOptions,
    sight_judged: bool,
) -> RelocatedLesion:
    query = lesion.query
    if estimate.point_m is None:
        if options.check_visibility and estimate.hidden:
            return RelocatedLesion(query.id, "not_visible", estimate.hidden)
        return _refused(query, estimate.reason or "The evidence carries no answer.")
    if options.check_visibility and not estimate.appearance_matched:
        hidden = estimate.hidden or turned_away(lesion, skeleton)
        if hidden:
            return RelocatedLesion(query.id, "not_visible", hidden)
        if not sight_judged and estimate.confidence < LEAST_CONFIDENCE:
            return _refused(query, "The anchors disagree about the place.")
    rig = pair.followup.capture.rig
    status: LesionStatus = "predicted"
    reason = estimate.reason or "Computed from distances along the skin; not compared with the picture."
    if estimate.appearance_matched:
        status, reason = "found", estimate.reason or "Seen again in the picture."
    elif estimate.candidates:
        status = "ambiguous"
        reason = f"{1 + len(estimate.candidates)} places explain the distances almost equally well."
    return RelocatedLesion(
        id=query.id,
        status=status,
        reason=reason,
        point_m=estimate.point_m,
        pixel=estimate.pixel or _pair_of(rig.project_to_picture(estimate.point_m)[0]),
        depth_pixel=_pair_of(rig.depth.project(estimate.point_m)[0]),
        radius95_m=estimate.radius95_m,
        confidence=estimate.confidence,
        appearance_matched=estimate.appearance_matched,
        candidates=tuple(
            Candidate(
                c.point_m,
                c.confidence,
                _pair_of(rig.project_to_picture(c.point_m)[0]),
                _pair_of(rig.depth.project(c.point_m)[0]),
            )
            for c in estimate.candidates
        ),
        region=estimate.region,
        agreement_m=estimate.agreement_m,
        picture="color" if rig.has_color else "depth",
    )


def _pair_of(pixel: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> tuple[float, float]:
    return float(pixel[0]), float(pixel[1])
