"""Finding the known lesions on the captures of a visit: from the plan to observations to be stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.workflows.plan import KnownPlace, OutOfView, RelocationPlan, Search
from core.errors import WorkError
from core.progress import Progress, ScaledProgress, no_progress
from core.records import CandidatePlace, ObservationDraft

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from core.anchors import AnalysedCapture
    from core.relocation import RelocatedLesion, RelocationResult

EXPLAINED = ("voting-dijkstra", "voting-fmm", "trilateration")
"""Methods with distances of their own to show; the last one stands for the others."""

_TITLES = {
    "1-paths-first": "Paths, previous visit",
    "2-bands": "Bands",
    "3-votes": "Votes",
    "4-cluster": "Biggest cluster",
    "5-paths-followup": "Paths, this visit",
}

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
    numbers: Mapping[int, int],
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
    numbers : mapping of int to int
        Lesion id to the number by which the doctor knows it, for warnings.
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
            [LesionQuery(str(numbers[p.lesion_id]), pixel=p.pixel) for p in search.places],
            method=method or DEFAULT_METHOD,
            progress=ScaledProgress(share, 0.6, 1.0),
        )
        drafts += [
            _draft(place.lesion_id, result[str(numbers[place.lesion_id])], visit_id, search, result)
            for place in search.places
        ]
        warnings += result.warnings
        seconds += float(result.seconds.get("total", 0.0))
    drafts += [_unseen(o, visit_id, some_capture_id) for o in plan.out_of_view]
    return SearchOutcome(tuple(drafts), tuple(dict.fromkeys(warnings)), seconds)


def _draft(
    lesion_id: int, lesion: RelocatedLesion, visit_id: int, search: Search, result: RelocationResult
) -> ObservationDraft:
    return ObservationDraft(
        lesion_id=lesion_id,
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


def explanation_pictures(
    place: KnownPlace,
    search: Search,
    analyse: Analyse,
    *,
    number: str,
    method: str,
    answer_m: tuple[float, float, float] | None,
    progress: Progress = no_progress,
) -> dict[str, NDArray[np.uint8]]:
    """Bands, votes, biggest cluster and geodesic paths of one lesion as RGB pictures, by title.

    Parameters
    ----------
    place : KnownPlace
        Of the earlier visit.
    search : Search
        The pair of captures.
    analyse : callable
    number : str
        The lesion's number, written on the pictures.
    method : str
        Which method's distances are shown.
    answer_m : tuple of float or None
        The place that was proposed.
    progress : Progress
    """
    from core.relocation import LesionQuery
    from core.relocation.explain import explain_lesion
    from core.relocation.explain_draw import draw_explanation

    first = analyse(search.reference_capture_id, ScaledProgress(progress, 0.0, 0.3))
    followup = analyse(search.target_capture_id, ScaledProgress(progress, 0.3, 0.6))
    progress(0.6, "Tracing the paths")
    explanation = explain_lesion(
        first,
        followup,
        LesionQuery(number, pixel=place.pixel),
        method=method if method in EXPLAINED else EXPLAINED[-1],
        answer_m=None if answer_m is None else np.asarray(answer_m),
    )
    if explanation is None:
        raise WorkError(
            "There is nothing to show for this lesion.",
            "No anchor reaches its place on both visits; place it by hand.",
        )
    progress(0.9, "Drawing")
    pictures = draw_explanation(explanation, first, followup)
    return {_TITLES.get(name, name): picture for name, picture in pictures.items()}
