"""Finding the known lesions on the captures of a visit: from the plan to observations to be stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.workflows.plan import OutOfView, RelocationPlan, Search
from core.progress import Progress, ScaledProgress, no_progress
from core.records import CandidatePlace, ObservationDraft

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.relocation import RelocatedLesion, RelocationResult

Analyse = Callable[[int, Progress], "AnalysedCapture"]


@dataclass(frozen=True)
class SearchOutcome:
    """What was found, not stored yet.

    Attributes
    ----------
    drafts : tuple of ObservationDraft
        One per lesion of the plan.
    warnings : tuple of str
        For the doctor.
    seconds : float
        Time the relocation itself took.
    """

    drafts: tuple[ObservationDraft, ...]
    warnings: tuple[str, ...]
    seconds: float


def run_plan(
    plan: RelocationPlan,
    visit_id: int,
    analyse: Analyse,
    *,
    some_capture_id: int,
    method: str | None = None,
    progress: Progress = no_progress,
) -> SearchOutcome:
    """Look for every lesion of ``plan``. Stores nothing: cancelling leaves no trace.

    Parameters
    ----------
    plan : RelocationPlan
    visit_id : int
    analyse : callable
        Capture id and progress to `AnalysedCapture`.
    some_capture_id : int
        A capture in force, which carries the note that a lesion's side was not captured.
    method : str or None
        Relocation method; None for the default.
    progress : Progress
    """
    from core.relocation import DEFAULT_METHOD, LesionQuery, relocate

    drafts: list[ObservationDraft] = []
    warnings: list[str] = []
    seconds = 0.0
    for i, search in enumerate(plan.searches):
        share = ScaledProgress(progress, i / len(plan.searches), (i + 1) / len(plan.searches))
        first = analyse(search.reference_capture_id, ScaledProgress(share, 0.0, 0.3))
        followup = analyse(search.target_capture_id, ScaledProgress(share, 0.3, 0.6))
        result = relocate(
            first,
            followup,
            [LesionQuery(str(p.lesion_id), pixel=p.pixel) for p in search.places],
            method=method or DEFAULT_METHOD,
            progress=ScaledProgress(share, 0.6, 1.0),
        )
        drafts += [_draft(lesion, visit_id, search, result) for lesion in result.lesions]
        warnings += result.warnings
        seconds += float(result.seconds.get("total", 0.0))
    drafts += [_unseen(o, visit_id, some_capture_id) for o in plan.out_of_view]
    return SearchOutcome(tuple(drafts), tuple(dict.fromkeys(warnings)), seconds)


def _draft(
    lesion: RelocatedLesion, visit_id: int, search: Search, result: RelocationResult
) -> ObservationDraft:
    return ObservationDraft(
        lesion_id=int(lesion.id),
        visit_id=visit_id,
        capture_id=search.target_capture_id,
        status=lesion.status,
        pixel=lesion.pixel,
        point_m=None if lesion.point_m is None else tuple(float(x) for x in lesion.point_m),
        radius95_m=lesion.radius95_m,
        confidence=lesion.confidence,
        method=result.method,
        reason=lesion.reason,
        appearance_matched=lesion.appearance_matched,
        candidates=tuple(
            CandidatePlace(
                c.pixel, (float(c.point_m[0]), float(c.point_m[1]), float(c.point_m[2])), c.confidence
            )
            for c in lesion.candidates
        ),
    )


def _unseen(lesion: OutOfView, visit_id: int, capture_id: int) -> ObservationDraft:
    return ObservationDraft(
        lesion_id=lesion.lesion_id,
        visit_id=visit_id,
        capture_id=capture_id,
        status="not_visible",
        reason=lesion.reason,
    )
