"""Finding the known lesions on the captures of a visit: from the plan to observations to be stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.workflows.evidence import Answer, SeenSpot
from app.workflows.plan import KnownPlace, OutOfView, RelocationPlan
from core.progress import Progress, ScaledProgress, no_progress
from core.records import CandidatePlace, ObservationDraft

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.relocation import ConfirmedLesion, LesionQuery, RelocatedLesion, Spot

Analyse = Callable[[int, Progress], "AnalysedCapture"]
Pixel = tuple[float, float]


@dataclass(frozen=True)
class SurePlace:
    """A lesion that the doctor has decided on in this visit: where it was, and where it is."""

    place: KnownPlace
    capture_id: int
    pixel: Pixel


@dataclass(frozen=True)
class SearchOutcome:
    """What was found, not stored yet.

    Attributes
    ----------
    drafts : tuple of ObservationDraft
        At least one per lesion of the plan.
    warnings : tuple of str
        For the doctor.
    seconds : float
        Time the relocation itself took.
    answers : tuple of Answer
        Everything the engine said.
    new_spots, vanished_spots : tuple of SeenSpot
    """

    drafts: tuple[ObservationDraft, ...]
    warnings: tuple[str, ...]
    seconds: float
    answers: tuple[Answer, ...] = ()
    new_spots: tuple[SeenSpot, ...] = ()
    vanished_spots: tuple[SeenSpot, ...] = ()


def run_plan(
    plan: RelocationPlan,
    visit_id: int,
    analyse: Analyse,
    *,
    views: Mapping[str, int],
    numbers: Mapping[int, int],
    method: str | None = None,
    sure: Sequence[SurePlace] = (),
    progress: Progress = no_progress,
) -> SearchOutcome:
    """Look for every lesion of ``plan``. Stores nothing: cancelling leaves no trace.

    Every lesion is looked for in the view that it was seen in first, then in the others that may show it.

    Parameters
    ----------
    plan : RelocationPlan
    visit_id : int
    analyse : callable
        Capture id and progress to `AnalysedCapture`.
    views : mapping of str to int
        View to capture of this visit that is in force.
    numbers : mapping of int to int
        Lesion id to the number by which the doctor knows it, for warnings.
    method : str or None
        Relocation method; None for the default.
    sure : sequence of SurePlace
        Lesions the doctor has decided on: they hold the search of the others.
    progress : Progress
    """
    from core.relocation import DEFAULT_METHOD, relocate_visit

    unseen = tuple(_unseen(o, visit_id, max(views.values())) for o in plan.out_of_view)
    if not plan.searches:
        return SearchOutcome(unseen, (), 0.0)
    names = {s.reference_capture_id: _name(s.places[0]) for s in plan.searches}
    wanted = _needed_views(plan, views)
    total = len(names) + len(wanted)
    captures: dict[int, AnalysedCapture] = {}
    for i, capture_id in enumerate((*names, *wanted.values())):
        captures[capture_id] = analyse(
            capture_id, ScaledProgress(progress, 0.6 * i / total, 0.6 * (i + 1) / total)
        )
    places = [p for s in plan.searches for p in s.places]
    result = relocate_visit(
        {name: captures[capture_id] for capture_id, name in names.items()},
        {view: captures[capture_id] for view, capture_id in wanted.items()},
        [_query(p, names, numbers) for p in places],
        method=method or DEFAULT_METHOD,
        confirmed=_confirmed(sure, names, numbers, {c: v for v, c in wanted.items()}),
        progress=ScaledProgress(progress, 0.6, 1.0),
    )
    targets = {p.lesion_id: s.target_capture_id for s in plan.searches for p in s.places}
    answers = [_answer(p.lesion_id, result[str(numbers[p.lesion_id])], targets, wanted) for p in places]
    drafts = [_draft(a, visit_id, result.method) for a in answers]
    drafts += [_elsewhere(a, visit_id, targets[a.lesion_id], wanted) for a in answers if _moved(a, targets)]
    references = {name: capture_id for capture_id, name in names.items()}
    return SearchOutcome(
        (*drafts, *unseen),
        tuple(dict.fromkeys(result.warnings)),
        float(result.seconds.get("total", 0.0)),
        tuple(answers),
        _spots(result.new_spots, wanted),
        _spots(result.vanished_spots, references),
    )


def _name(place: KnownPlace) -> str:
    return f"{place.view} view of visit {place.visit_number}, capture {place.capture_id}"


def _needed_views(plan: RelocationPlan, views: Mapping[str, int]) -> dict[str, int]:
    """Captures of this visit that may show a lesion of the plan: not those of the opposite side alone."""
    from core.relocation.views import OPPOSITE

    sides = {s.view for s in plan.searches}
    targets = {s.target_capture_id for s in plan.searches}
    return {
        view: capture_id
        for view, capture_id in views.items()
        if capture_id in targets or any(OPPOSITE.get(side) != view for side in sides)
    }


def _query(place: KnownPlace, names: Mapping[int, str], numbers: Mapping[int, int]) -> LesionQuery:
    from core.relocation import LesionQuery

    return LesionQuery(str(numbers[place.lesion_id]), pixel=place.pixel, capture=names[place.capture_id])


def _confirmed(
    sure: Sequence[SurePlace],
    names: Mapping[int, str],
    numbers: Mapping[int, int],
    view_of: Mapping[int, str],
) -> dict[tuple[str, str], list[ConfirmedLesion]]:
    from core.relocation import ConfirmedLesion

    out: dict[tuple[str, str], list[ConfirmedLesion]] = {}
    for s in sure:
        if s.place.capture_id in names and s.capture_id in view_of:
            key = names[s.place.capture_id], view_of[s.capture_id]
            out.setdefault(key, []).append(ConfirmedLesion(_query(s.place, names, numbers), s.pixel))
    return out


def _answer(
    lesion_id: int, lesion: RelocatedLesion, targets: Mapping[int, int], views: Mapping[str, int]
) -> Answer:
    capture_id = targets[lesion_id]
    if lesion.point_m is not None and lesion.capture is not None:
        capture_id = views[lesion.capture]
    return Answer(lesion_id, capture_id, lesion)


def _moved(answer: Answer, targets: Mapping[int, int]) -> bool:
    return answer.capture_id != targets[answer.lesion_id]


def _draft(answer: Answer, visit_id: int, method: str) -> ObservationDraft:
    lesion = answer.relocated
    return ObservationDraft(
        lesion_id=answer.lesion_id,
        visit_id=visit_id,
        capture_id=answer.capture_id,
        status=lesion.status,
        pixel=lesion.pixel,
        point_m=None if lesion.point_m is None else tuple(float(x) for x in lesion.point_m),
        radius95_m=lesion.radius95_m,
        confidence=lesion.confidence,
        method=method,
        reason=lesion.reason,
        appearance_matched=lesion.appearance_matched,
        candidates=tuple(
            CandidatePlace(
                c.pixel, (float(c.point_m[0]), float(c.point_m[1]), float(c.point_m[2])), c.confidence
            )
            for c in lesion.candidates
        ),
    )


def _elsewhere(answer: Answer, visit_id: int, target_id: int, views: Mapping[str, int]) -> ObservationDraft:
    """The note on the lesion's own view that another view shows it better."""
    view = next(name for name, capture_id in views.items() if capture_id == answer.capture_id)
    return ObservationDraft(
        answer.lesion_id, visit_id, target_id, "not_visible", reason=f"Found in the {view} view."
    )


def _unseen(lesion: OutOfView, visit_id: int, capture_id: int) -> ObservationDraft:
    return ObservationDraft(
        lesion_id=lesion.lesion_id,
        visit_id=visit_id,
        capture_id=capture_id,
        status="not_visible",
        reason=lesion.reason,
    )


def _spots(spots: Sequence[Spot], captures: Mapping[str, int]) -> tuple[SeenSpot, ...]:
    return tuple(
        SeenSpot(captures[getattr(s, "capture", "")], (float(s.pixel[0]), float(s.pixel[1])), s.confidence)
        for s in spots
    )
