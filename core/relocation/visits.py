"""Lesions of a visit of several captures in another visit: what is searched, which answer counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from core.anchors import AnalysedCapture
from core.errors import InputError
from core.progress import Progress, ScaledProgress, no_progress
from core.relocation.bones import Bone, bones
from core.relocation.clock import PhaseClock
from core.relocation.compatibility import OPPOSITE_DEG
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.registry import DEFAULT_METHOD, relocation_method
from core.relocation.relocate import pick_query, relocate
from core.relocation.types import (
    ConfirmedLesion,
    LesionQuery,
    LesionStatus,
    RelocatedLesion,
    RelocationOptions,
    RelocationResult,
)
from core.relocation.view_choice import best_of_views, is_settled
from core.relocation.view_crossing import UNKNOWN, Crossing
from core.relocation.view_spots import PairSpots, SpotsOfVisits
from core.relocation.views import is_rigid, opposite, turn_deg
from core.relocation.visibility import turned_away

ConfirmedByPair = Mapping[tuple[str, str], Sequence[ConfirmedLesion]]
"""Confirmed lesions by (capture of the first visit, capture of the follow-up) in which they were seen."""


def relocate_visit(
    first: Mapping[str, AnalysedCapture],
    followup: Mapping[str, AnalysedCapture],
    queries: Sequence[LesionQuery],
    *,
    method: str = DEFAULT_METHOD,
    appearance: bool = True,
    seed: int = 0,
    options: RelocationOptions | None = None,
    confirmed: ConfirmedByPair | None = None,
    progress: Progress = no_progress,
) -> RelocationResult:
    """Find lesions of a visit of several captures again in another visit.

    Every lesion is searched in the follow-up's capture of its own view first. An answer that is sure and
    tight counts at once; otherwise the lesion is also searched in the other captures that may see its skin,
    and the best answer counts. Two views that answer with different skin contradict each other, and the
    result says so. `RelocationResult.new_spots` and ``vanished_spots`` are
    `core.relocation.view_spots.CapturedSpot`, which name their capture.

    Parameters
    ----------
    first, followup : mapping of str to AnalysedCapture
        Captures by name.
    queries : sequence of LesionQuery
        With `LesionQuery.capture` where ``first`` has several.
    confirmed : mapping, optional
        Lesions that are certain, for each pair of captures.

    Returns
    -------
    RelocationResult
        One answer per query, in their order; ``seconds`` are summed over the searches, "total" is the time
        that passed.

    Raises
    ------
    InputError
        If a query names no capture of the first visit, or none although there are several.
    """
    relocation_method(method)
    clock = PhaseClock()
    owners = {query.id: _owner(first, query) for query in queries}
    search = _Search(first, followup, queries, owners)
    turns = [(a, b) for a in first if a in owners.values() for b in by_view(first[a], followup)]
    for turn, (a, b) in enumerate(turns):
        part = ScaledProgress(progress, turn / len(turns), (turn + 1) / len(turns))
        wanted = search.wanted(a, b, options or RelocationOptions())
        if not wanted:
            part(1.0)
            continue
        result = relocate(
            first[a],
            followup[b],
            wanted,
            method=method,
            appearance=appearance,
            seed=seed,
            options=options,
            confirmed=(confirmed or {}).get((a, b), ()),
            progress=part,
        )
        search.add(a, b, result, appearance)
    progress(1.0, "Done")
    lesions, doubts = search.choose()
    new_spots, vanished_spots = SpotsOfVisits(first, followup, search.spots).only_in_one_visit()
    seconds = {**search.seconds, "total": clock.seconds()["total"]}
    warnings = tuple(dict.fromkeys((*search.warnings, *doubts)))
    return RelocationResult(method, lesions, seconds, warnings, new_spots, vanished_spots)


@dataclass
class _Search:
    """What was found so far."""

    first: Mapping[str, AnalysedCapture]
    followup: Mapping[str, AnalysedCapture]
    queries: Sequence[LesionQuery]
    owners: Mapping[str, str]
    answers: dict[str, list[RelocatedLesion]] = field(default_factory=dict)
    settled: set[str] = field(default_factory=set)
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    spots: list[PairSpots] = field(default_factory=list)
    crossings: dict[tuple[str, str], Crossing] = field(default_factory=dict)

    def wanted(self, a: str, b: str, options: RelocationOptions) -> list[LesionQuery]:
        """Lesions of ``a`` worth searching in ``b``; for those whose skin ``b`` cannot see, the answer."""
        waiting = [q for q in self.queries if self.owners[q.id] == a and q.id not in self.settled]
        if not waiting or not any(self.answers.get(q.id) for q in waiting):
            return waiting
        if self._crossing(a, b).is_blocked:
            for query in waiting:
                self.answers[query.id].append(
                    RelocatedLesion(query.id, "refused", UNKNOWN, capture=b, picture=self._picture(b))
                )
            return []
        pair = VisitPair(self.first[a], self.followup[b])
        angle = turn_deg(pair)
        skeleton = bones(pair) if options.check_visibility and is_rigid(pair) else ()
        out = []
        for query in waiting:
            status, reason = self._not_here(a, b, query, angle, skeleton)
            if not reason:
                out.append(query)
                continue
            self.answers[query.id].append(
                RelocatedLesion(query.id, status, reason, capture=b, picture=self._picture(b))
            )
        return out

    def _not_here(
        self, a: str, b: str, query: LesionQuery, angle: float | None, skeleton: tuple[Bone, ...]
    ) -> tuple[LesionStatus, str]:
        """Why a search would find nothing, as the search itself would put it; empty if it may."""
        if opposite(self.first[a], self.followup[b]):
            return "refused", "The two captures show opposite sides of the body."
        if angle is not None and angle > OPPOSITE_DEG:
            told = f"(turned by {angle:.0f} degrees)."
            return "refused", f"The two captures show different sides of the body {told}"
        pick = pick_query(self.first[a], query)
        if pick.point is None or pick.normal is None:
            return "refused", pick.reason or "The click is not on the skin."
        if all(answer.status == "refused" for answer in self.answers[query.id]):
            return "refused", ""  # what refused elsewhere, perhaps another person, is judged here, too
        return "not_visible", turned_away(PickedLesion(query, pick.point, pick.normal), skeleton)

    def _crossing(self, a: str, b: str) -> Crossing:
        if (a, b) not in self.crossings:
            self.crossings[a, b] = Crossing(self.first[a], self.followup[b])
        return self.crossings[a, b]

    def _picture(self, b: str) -> Literal["color", "depth"]:
        return "color" if self.followup[b].capture.rig.has_color else "depth"

    def add(self, a: str, b: str, result: RelocationResult, appearance: bool) -> None:
        """Take in the answers of one pair of captures."""
        for name, value in result.seconds.items():
            self.seconds[name] = self.seconds.get(name, 0.0) + value
        self.warnings += [self._told(a, b, warning) for warning in result.warnings]
        if not self._crossing(a, b).is_blocked:
            self.spots.append(PairSpots(a, b, result.new_spots, result.vanished_spots))
        crossing = self._crossing(a, b)
        queries = {q.id: q for q in self.queries}
        for lesion in result.lesions:
            answer = crossing.judged(queries[lesion.id], replace(lesion, capture=b))
            self.answers.setdefault(lesion.id, []).append(answer)
            if is_settled(answer, self.followup[b], appearance=appearance):
                self.settled.add(lesion.id)

    def _told(self, a: str, b: str, warning: str) -> str:
        """A warning with the name of the capture it speaks of, where a visit has several."""
        several_first, several_later = len(self.first) > 1, len(self.followup) > 1
        for prefix, name, several in (
            ("First visit: ", a, several_first),
            ("Follow-up: ", b, several_later),
        ):
            if warning.startswith(prefix):
                return f"{prefix[:-2]}, {name}: {warning[len(prefix) :]}" if several else warning
        return f"{a} to {b}: {warning}" if several_first or several_later else warning

    def choose(self) -> tuple[tuple[RelocatedLesion, ...], list[str]]:
        """One answer per query, and what was in doubt."""
        lesions, doubts = [], []
        for query in self.queries:
            lesion, doubt = best_of_views(self.answers[query.id], self.followup)
            lesions.append(lesion)
            doubts += [doubt] if doubt else []
        return tuple(lesions), doubts


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


def by_view(own: AnalysedCapture, followup: Mapping[str, AnalysedCapture]) -> list[str]:
    """Captures of the follow-up, the own view first, then by how far the trunk is turned between them."""

    def key(name: str) -> tuple[bool, bool, float]:
        other = followup[name]
        angle = turn_deg(VisitPair(own, other))
        return other.capture.view != own.capture.view, opposite(own, other), 90.0 if angle is None else angle

    return sorted(followup, key=key)
