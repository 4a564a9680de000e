"""Answers in another view than the lesion's own: believed only where the skeletons carry them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.anchors import AnalysedCapture
from core.relocation.pair import VisitPair
from core.relocation.relocate import pick_query
from core.relocation.types import LesionQuery, RelocatedLesion
from core.relocation.view_choice import CARRY_ERROR_M, CONTRADICTED, region_size_m
from core.relocation.views import OPPOSITE, BoneBridge, turn_deg

TURNED_DEG = 40.0
"""A trunk turned farther shows other skin at its sides: it is another view, whatever it is called."""

UNKNOWN = "It was marked in another view, whose joints do not fit this one: nothing carries the place over."
HIDDEN = "The skeleton says that this view does not show the place."
ELSEWHERE = "The skeleton places it elsewhere in this view."


class Crossing:
    """From a capture of the first visit to a capture of the follow-up.

    Distances to joints alone do not know the side of the skin: between a front and a side view they place a
    lesion decimetres away. On a simulated patient taken from four sides, at least 25 of 36 such answers were
    off by more than 5 cm, the worst by 1.2 m; of the four that pass here, the worst was off by 47 mm.
    Where guessed joints start the search, spots are matched to wrong ones, too: 7 of 7 such answers "seen
    again" were off by 6 to 41 cm.
    """

    def __init__(self, first: AnalysedCapture, followup: AnalysedCapture) -> None:
        self._first = first
        angle = turn_deg(VisitPair(first, followup))
        sides = {first.capture.view, followup.capture.view}
        other_name = len(sides) == 2 and sides <= set(OPPOSITE)
        self.is_crossing = other_name or (angle is not None and angle > TURNED_DEG)
        self._bridge = BoneBridge(first, followup) if self.is_crossing else None

    @property
    def is_blocked(self) -> bool:
        """Whether nothing can be carried over, so that a search would be in vain."""
        return self._bridge is not None and not self._bridge.carries

    def judged(self, query: LesionQuery, answer: RelocatedLesion) -> RelocatedLesion:
        """The answer as far as it can be believed: within one view unchanged."""
        if self._bridge is None or answer.point_m is None:
            return answer
        pick = pick_query(self._first, query)
        carried = None if pick.point is None else self._bridge.carry(np.asarray(pick.point.position_m))
        seen_again = answer.status == "found"
        if carried is None:
            return _withdrawn(answer, "refused", UNKNOWN)
        allowed = CARRY_ERROR_M + min(region_size_m(answer), 0.1)
        fits = float(np.linalg.norm(carried.point_m - answer.point_m)) <= allowed
        if seen_again and not fits:
            return replace(
                answer,
                status="ambiguous",
                confidence=answer.confidence * CONTRADICTED,
                reason=f"{answer.reason} {ELSEWHERE}",
            )
        if seen_again or (carried.seen and fits):
            return answer
        if not carried.seen:
            return _withdrawn(answer, "not_visible", HIDDEN)
        return _withdrawn(answer, "refused", ELSEWHERE)


def _withdrawn(answer: RelocatedLesion, status: str, reason: str) -> RelocatedLesion:
    assert status in ("refused", "not_visible")
    return RelocatedLesion(
        answer.id,
        "refused" if status == "refused" else "not_visible",
        reason,
        capture=answer.capture,
        picture=answer.picture,
    )
