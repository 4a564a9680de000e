"""Looking for the lesions of a visit: all of them, the rest once some are certain, or the site of one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from app.workflows.capture_work import CaptureWork
from app.workflows.evidence import Answer, SeenSpot, VisitEvidence
from app.workflows.explaining import explanation_pictures
from app.workflows.plan import KnownPlace, RelocationPlan, Search
from app.workflows.search import SearchOutcome, SurePlace, run_plan
from app.workflows.snapshot import SURE, VisitSnapshot, has_place
from app.workflows.table import Refused
from core.progress import Progress, ScaledProgress, no_progress
from core.records import Observation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from core.relocation import LesionQuery, RelocatedLesion
    from core.relocation.site_check import SiteCheck

Pixel = tuple[float, float]

DECIDED_RADIUS_M = 0.005
"""A place that a person has decided on is taken to be exact to a mole's width."""


class LesionSearch:
    """Searches of one visit. Everything here is long work for a worker, and stores nothing.

    Parameters
    ----------
    snapshot : callable
        The records as they are now.
    captures : CaptureWork
    method : str or None
        Relocation method; None for the default.

    Attributes
    ----------
    evidence : VisitEvidence
    """

    def __init__(
        self, snapshot: Callable[[], VisitSnapshot], captures: CaptureWork, method: str | None
    ) -> None:
        self._snapshot, self._captures, self._method = snapshot, captures, method
        self.evidence = VisitEvidence()

    def find(self, progress: Progress = no_progress) -> SearchOutcome:
        """Look for every pending lesion."""
        snapshot = self._snapshot()
        if not snapshot.views:
            raise Refused("There is no body capture to look on.", "Take a capture of the body first.")
        return self._run(snapshot.pending(), (), progress)

    def refine(self, progress: Progress = no_progress) -> SearchOutcome:
        """Look again for the lesions that wait for the doctor, held by those that are decided."""
        snapshot = self._snapshot()
        sure = self.sure_places()
        waiting = {x.id for x in snapshot.lesions if _waits(snapshot.in_force(x.id))}
        searches = []
        for search in snapshot.plan().searches:
            places = tuple(p for p in search.places if p.lesion_id in waiting)
            if places:
                searches.append(
                    Search(search.reference_capture_id, search.target_capture_id, search.view, places)
                )
        if not sure or not searches:
            raise Refused(
                "There is nothing to refine.",
                "Confirm or correct some lesions first; the others are then looked for again.",
            )
        return self._run(RelocationPlan(tuple(searches)), tuple(sure), progress)

    def sure_places(self) -> list[SurePlace]:
        """Lesions known from an earlier visit on whose place in this one the doctor has decided."""
        snapshot = self._snapshot()
        known = {p.lesion_id: p for s in snapshot.plan().searches for p in s.places}
        out = []
        for lesion_id, place in known.items():
            o = snapshot.in_force(lesion_id)
            if o is not None and o.decision in SURE and o.pixel is not None:
                out.append(SurePlace(place, o.capture_id, o.pixel))
        return out

    def waiting_count(self) -> int:
        """Lesions that `refine` would look for again."""
        snapshot = self._snapshot()
        known = {p.lesion_id for s in snapshot.plan().searches for p in s.places}
        return sum(_waits(snapshot.in_force(lesion_id)) for lesion_id in known)

    def _run(self, plan: RelocationPlan, sure: tuple[SurePlace, ...], progress: Progress) -> SearchOutcome:
        snapshot = self._snapshot()
        return run_plan(
            plan,
            snapshot.visit.id,
            self._captures.prepare,
            views=snapshot.views,
            numbers={lesion.id: lesion.number for lesion in snapshot.lesions},
            method=self._method,
            sure=sure,
            progress=progress,
        )

    def keep(self, outcome: SearchOutcome) -> None:
        """Remember what a search told beyond the records; a search of some lesions keeps the spots."""
        self.evidence.keep(outcome.answers)
        if outcome.answers:
            self.evidence.keep_spots(outcome.new_spots, outcome.vanished_spots)

    def spots(self) -> tuple[tuple[SeenSpot, ...], tuple[SeenSpot, ...]]:
        """Spots of this visit only, and of an earlier visit only, without those that are lesions by now."""
        snapshot = self._snapshot()
        places: dict[int, list[Pixel]] = {}
        for observations in snapshot.observations.values():
            for o in observations:
                if has_place(o) and o.pixel is not None:
                    places.setdefault(o.capture_id, []).append(o.pixel)
        current = set(snapshot.views.values())

        def free(spots: tuple[SeenSpot, ...]) -> tuple[SeenSpot, ...]:
            return tuple(s for s in spots if not any(s.near(p) for p in places.get(s.capture_id, ())))

        new = tuple(s for s in self.evidence.new_spots if s.capture_id in current)
        return free(new), free(self.evidence.vanished_spots)

    def explain(
        self, lesion_id: int, progress: Progress = no_progress
    ) -> tuple[dict[str, NDArray[np.uint8]], tuple[tuple[str, float], ...]]:
        """Pictures of how the proposed place of a lesion came about, by title; anchors with spread in m."""
        snapshot = self._snapshot()
        for search in snapshot.plan().searches:
            place = next((p for p in search.places if p.lesion_id == lesion_id), None)
            if place is None:
                continue
            proposal = snapshot.in_force(lesion_id)
            if proposal is not None and has_place(proposal):
                search = Search(search.reference_capture_id, proposal.capture_id, search.view, search.places)
            return explanation_pictures(
                place,
                search,
                self._captures.prepare,
                number=str(next(x.number for x in snapshot.lesions if x.id == lesion_id)),
                method=proposal.method if proposal is not None else "",
                answer_m=proposal.proposed_point_m if proposal is not None else None,
                progress=progress,
            )
        raise Refused(
            "This lesion was not looked for in this visit, so there is nothing to explain.",
            "Explanations exist for lesions of earlier visits.",
        )

    # -- the site of one lesion ------------------------------------------------------------------------

    def check_site(
        self, lesion_id: int, capture_id: int, pixel: Pixel, progress: Progress = no_progress
    ) -> SiteCheck:
        """Check whether a clicked site of a capture of this visit is that of a lesion.

        A lesion whose place the doctor decided on is where the doctor put it. A lesion that was taken out,
        or that was never looked for on this capture, is looked for now: by geometry, if it is gone.
        """
        from core.relocation.site_check import check_site

        snapshot = self._snapshot()
        followup = self._captures.prepare(capture_id, ScaledProgress(progress, 0.0, 0.4))
        lesion = self._located(lesion_id, capture_id)
        if lesion is None:
            self._locate(lesion_id, capture_id, ScaledProgress(progress, 0.4, 0.95))
            lesion = self._located(lesion_id, capture_id)
        assert lesion is not None
        others = [
            found
            for x in snapshot.lesions
            if x.id != lesion_id and (found := self._located(x.id, capture_id)) is not None
        ]
        progress(0.95, "Measuring along the skin")
        return check_site(lesion, followup, pixel, others=others)

    def _located(self, lesion_id: int, capture_id: int) -> RelocatedLesion | None:
        """Where a lesion is on a capture as far as is known: the doctor's word, else the engine's."""
        from core.relocation import RelocatedLesion

        number = str(self._number(lesion_id))
        observation = self._snapshot().in_force(lesion_id)
        if observation is None or observation.capture_id != capture_id or not has_place(observation):
            return self.evidence.answer(lesion_id, capture_id)
        point = None if observation.point_m is None else np.asarray(observation.point_m)
        if observation.decision in SURE:
            return RelocatedLesion(
                number,
                "found",
                "Placed by the doctor in this visit.",
                point_m=point,
                pixel=observation.pixel,
                radius95_m=DECIDED_RADIUS_M,
                confidence=1.0,
                appearance_matched=True,
            )
        known = self.evidence.of(observation)
        if known is not None:
            return known
        return RelocatedLesion(
            number,
            observation.status if observation.status != "marked" else "found",
            observation.reason,
            point_m=point,
            pixel=observation.pixel,
            radius95_m=observation.radius95_m,
            confidence=observation.confidence or 0.0,
            appearance_matched=observation.appearance_matched,
        )

    def _locate(self, lesion_id: int, capture_id: int, progress: Progress) -> None:
        """Look for a lesion, and for its neighbours in the photo, on a capture; remember the answers."""
        from core.relocation import DEFAULT_METHOD, relocate
        from core.relocation.view_crossing import Crossing

        snapshot = self._snapshot()
        seen = snapshot.previous(lesion_id)
        if seen is None or seen.pixel is None:
            raise Refused(
                f"Lesion {self._number(lesion_id)} has no earlier place to compare with.",
                "Choose a lesion that was marked or confirmed at an earlier visit.",
            )
        first = self._captures.prepare(seen.capture_id, ScaledProgress(progress, 0.0, 0.4))
        followup = self._captures.prepare(capture_id)
        queries: dict[int, LesionQuery] = {}
        for lesion in snapshot.lesions:
            o = snapshot.previous(lesion.id)
            if o is not None and o.pixel is not None and o.capture_id == seen.capture_id:
                queries[lesion.id] = self._query(lesion.id, o.pixel)
        result = relocate(
            first,
            followup,
            list(queries.values()),
            method=self._method or DEFAULT_METHOD,
            progress=ScaledProgress(progress, 0.4, 1.0),
        )
        known = [i for i in queries if self.evidence.answer(i, capture_id) is None]
        crossing = Crossing(first, followup)
        self.evidence.keep(
            Answer(i, capture_id, crossing.judged(queries[i], result[queries[i].id])) for i in known
        )

    def _query(self, lesion_id: int, pixel: Pixel) -> LesionQuery:
        from core.relocation import LesionQuery

        lesion = next(x for x in self._snapshot().lesions if x.id == lesion_id)
        return LesionQuery(str(lesion.number), pixel=pixel, healed=lesion.state == "removed")

    def _number(self, lesion_id: int) -> int:
        return next(x.number for x in self._snapshot().lesions if x.id == lesion_id)


def _waits(observation: Observation | None) -> bool:
    return observation is not None and observation.decision == "proposed"


__all__ = ["DECIDED_RADIUS_M", "KnownPlace", "LesionSearch"]
