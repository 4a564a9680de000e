"""Spots seen in one visit only, over all views: which remain when every view has had its say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from core.anchors import AnalysedCapture
from core.relocation.types import Spot
from core.relocation.views import BoneBridge

SAME_SPOT_M = 0.03
"""Two views' spots this near after carrying by the skeleton, each the other's nearest, are taken for one.

Carrying is sharp to some centimetres: of a dense cluster seen in two views, a spot may be listed twice, or
two neighbours once."""

SAME_PIXEL = 0.5


@dataclass(frozen=True, eq=False)
class CapturedSpot(Spot):
    """A spot with the name of the capture its pixel counts in."""

    capture: str = ""


@dataclass(frozen=True, eq=False)
class PairSpots:
    """What one pair of captures found in one visit only."""

    first: str
    followup: str
    new: tuple[Spot, ...]
    vanished: tuple[Spot, ...]


class SpotsOfVisits:
    """Merges the lists of all pairs that were compared.

    A spot of one capture may be missing from a view that does not show its skin. So it stays on the list only
    if every compared capture of the other visit that shows the skin there misses it, too.
    """

    def __init__(
        self,
        first: Mapping[str, AnalysedCapture],
        followup: Mapping[str, AnalysedCapture],
        pairs: Sequence[PairSpots],
    ) -> None:
        self._first, self._followup, self._pairs = first, followup, pairs
        self._bridges: dict[tuple[int, int], BoneBridge] = {}

    def only_in_one_visit(self) -> tuple[tuple[CapturedSpot, ...], tuple[CapturedSpot, ...]]:
        """New and vanished spots, the surest first."""
        new = self._remaining(
            [(p.followup, p.first, p.new) for p in self._pairs], self._followup, self._first
        )
        gone = self._remaining(
            [(p.first, p.followup, p.vanished) for p in self._pairs], self._first, self._followup
        )
        return self._once(new, self._followup), self._once(gone, self._first)

    def _bridge(self, source: AnalysedCapture, target: AnalysedCapture) -> BoneBridge:
        key = (id(source), id(target))
        if key not in self._bridges:
            self._bridges[key] = BoneBridge(source, target)
        return self._bridges[key]

    def _remaining(
        self,
        lists: Sequence[tuple[str, str, tuple[Spot, ...]]],
        own: Mapping[str, AnalysedCapture],
        other: Mapping[str, AnalysedCapture],
    ) -> list[CapturedSpot]:
        """Spots of (capture, compared with, list) that no compared capture contradicts, each once."""
        out: list[CapturedSpot] = []
        for capture, against, spots in lists:
            rest = [(b, listed) for a, b, listed in lists if a == capture and b != against]
            for spot in spots:
                if any(o.capture == capture and _same_pixel(o, spot) for o in out):
                    continue
                if not any(
                    not any(_same_pixel(o, spot) for o in listed)
                    and self._shows(own[capture], other[name], spot)
                    for name, listed in rest
                ):
                    out.append(CapturedSpot(spot.pixel, spot.point_m, spot.confidence, capture))
        return out

    def _shows(self, own: AnalysedCapture, other: AnalysedCapture, spot: Spot) -> bool:
        carried = self._bridge(own, other).carry(spot.point_m)
        return carried is not None and carried.seen

    def _once(
        self, spots: Sequence[CapturedSpot], captures: Mapping[str, AnalysedCapture]
    ) -> tuple[CapturedSpot, ...]:
        """One entry per spot that two views of a visit show; the surer one stays."""
        kept: list[CapturedSpot] = []
        for spot in sorted(spots, key=lambda s: -s.confidence):
            if not any(self._same(spot, other, spots, captures) for other in kept):
                kept.append(spot)
        return tuple(kept)

    def _same(
        self,
        spot: CapturedSpot,
        other: CapturedSpot,
        spots: Sequence[CapturedSpot],
        captures: Mapping[str, AnalysedCapture],
    ) -> bool:
        if spot.capture == other.capture:
            return False
        return (
            self._nearest(spot, other.capture, spots, captures) is other
            and self._nearest(other, spot.capture, spots, captures) is spot
        )

    def _nearest(
        self,
        spot: CapturedSpot,
        capture: str,
        spots: Sequence[CapturedSpot],
        captures: Mapping[str, AnalysedCapture],
    ) -> CapturedSpot | None:
        carried = self._bridge(captures[spot.capture], captures[capture]).carry(spot.point_m)
        there = [s for s in spots if s.capture == capture]
        if carried is None or not there:
            return None
        away = [float(np.linalg.norm(s.point_m - carried.point_m)) for s in there]
        best = int(np.argmin(away))
        return there[best] if away[best] <= SAME_SPOT_M else None


def _same_pixel(a: Spot, b: Spot) -> bool:
    return abs(a.pixel[0] - b.pixel[0]) < SAME_PIXEL and abs(a.pixel[1] - b.pixel[1]) < SAME_PIXEL
