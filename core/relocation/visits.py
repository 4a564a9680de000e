"""Lesions of a visit of several captures in another visit: what is searched, which answer counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from core.anchors import AnalysedCapture
from core.errors import InputError
from core.progress import Progress, ScaledProgress, no_progress
from core.relocation.clock import PhaseClock
from core.relocation.registry import DEFAULT_METHOD, relocation_method
from core.relocation.relocate import relocate
from core.relocation.types import (
    LesionQuery,
    LesionStatus,
    RelocatedLesion,
    RelocationOptions,
    RelocationResult,
)


def relocate_visit(
    first: Mapping[str, AnalysedCapture],
    followup: Mapping[str, AnalysedCapture],
    queries: Sequence[LesionQuery],
    *,
    method: str = DEFAULT_METHOD,
    appearance: bool = True,
    seed: int = 0,
    options: RelocationOptions | None = None,
    progress: Progress = no_progress,
) -> RelocationResult:
    """Find lesions of a visit of several captures again in another visit.

    Every lesion is searched in the follow-up's captures, its own view first; the surest answer counts.

    Raises
    ------
    InputError
        If a query names no capture of the first visit, or none although there are several.
    """
    clock = PhaseClock()
    owners = {query.id: _owner(first, query) for query in queries}
    seconds: dict[str, float] = {}
    warnings: list[str] = []
    best: dict[str, RelocatedLesion] = {}
    turns = [(a, b) for a in first for b in _by_view(first[a], followup) if a in owners.values()]
    for turn, (a, b) in enumerate(turns):
        wanted = [q for q in queries if owners[q.id] == a and not _settled(best.get(q.id))]
        if not wanted:
            continue
        part = ScaledProgress(progress, turn / len(turns), (turn + 1) / len(turns))
        result = relocate(
            first[a],
            followup[b],
            wanted,
            method=method,
            appearance=appearance,
            seed=seed,
            options=options,
            progress=part,
        )
        warnings.extend(result.warnings)
        for name, value in result.seconds.items():
            seconds[name] = seconds.get(name, 0.0) + value
        for lesion in result.lesions:
            if lesion.id not in best or _rank(lesion) > _rank(best[lesion.id]):
                best[lesion.id] = replace(lesion, capture=b)
    seconds["total"] = clock.seconds()["total"]
    relocation_method(method)
    return RelocationResult(
        method, tuple(best[q.id] for q in queries), seconds, tuple(dict.fromkeys(warnings))
    )


def _owner(first: Mapping[str, AnalysedCapture], query: LesionQuery) -> str:
    if query.capture is None and len(first) == 1:
        return next(iter(first))
    if query.capture is None:
        raise InputError(
            f'Lesion "{query.id}": the first visit has several captures; field "capture" must name one.',
            f"Choose one of: {', '.join(first)}.",
        )
    if query.capture not in first:
        raise InputError(
            f'Lesion "{query.id}": field "capture" names "{query.capture}", not in the first visit.',
            f"Choose one of: {', '.join(first)}.",
        )
    return query.capture


def _by_view(own: AnalysedCapture, followup: Mapping[str, AnalysedCapture]) -> list[str]:
    return sorted(followup, key=lambda name: followup[name].capture.view != own.capture.view)


def _settled(lesion: RelocatedLesion | None) -> bool:
    return lesion is not None and lesion.status in ("found", "predicted")


_STATUS_RANK: dict[LesionStatus, int] = {
    "found": 4,
    "predicted": 3,
    "ambiguous": 2,
    "not_visible": 1,
    "refused": 0,
}


def _rank(lesion: RelocatedLesion) -> tuple[int, float]:
    return _STATUS_RANK[lesion.status], lesion.confidence
