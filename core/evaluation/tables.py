"""From records to the rows of a report: per method, per body part, per pair of stances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from core.evaluation.cases import OTHER, SAME
from core.evaluation.parts import PARTS
from core.evaluation.records import FLOOR, Record, Rung
from core.evaluation.summaries import (
    SpotSummary,
    Summary,
    median_seconds,
    scored,
    summarise,
    summarise_spots,
)

GROUPS = (SAME, OTHER)


@dataclass(frozen=True)
class LadderRow:
    """One rung in one stance class.

    Attributes
    ----------
    rung : Rung
    group : str
    pairs, failures : int
        Pairs of captures measured, and pairs that could not be.
    others : int
        Mean number of other moles on the body.
    seconds, analysis_seconds : float
        Medians: of the relocation, and of finding surfaces and joints in both captures before it.
    summary, healed : Summary
        Of lesions that are still there; of sites of healed lesions.
    new_spots, vanished_spots : SpotSummary or None
    """

    rung: Rung
    group: str
    pairs: int
    failures: int
    others: int
    seconds: float
    analysis_seconds: float
    summary: Summary
    healed: Summary
    new_spots: SpotSummary | None
    vanished_spots: SpotSummary | None

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return {
            **asdict(self.rung),
            "group": self.group,
            "pairs": self.pairs,
            "failures": self.failures,
            "other_moles": self.others,
            "seconds": round(self.seconds, 4) if self.pairs > self.failures else None,
            "analysis_seconds": round(self.analysis_seconds, 4),
            **self.summary.to_json(),
            "healed": self.healed.to_json(),
            "new_spots": _spots(self.new_spots),
            "vanished_spots": _spots(self.vanished_spots),
        }


@dataclass(frozen=True)
class PartRow:
    """One rung, stance class and body part; "all" is every part."""

    rung: Rung
    group: str
    part: str
    summary: Summary

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return {**asdict(self.rung), "group": self.group, "part": self.part, **self.summary.to_json()}


@dataclass(frozen=True)
class StanceRow:
    """One rung on the pairs of one stance and another."""

    rung: Rung
    stances: str
    pairs: int
    summary: Summary

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return {
            **asdict(self.rung),
            "stances": self.stances,
            "pairs": self.pairs,
            **self.summary.to_json(),
        }


def ladder_rows(records: Sequence[Record], rungs: Sequence[Rung], *, seed: int = 0) -> list[LadderRow]:
    """One row per rung and stance class that was measured, in the order of the rungs."""
    out = []
    for rung in rungs:
        for group in GROUPS:
            some = [r for r in records if r.rung == rung and r.name.group == group]
            if not some:
                continue
            good = [r for r in some if not r.failure]
            out.append(
                LadderRow(
                    rung=rung,
                    group=group,
                    pairs=len(some),
                    failures=len(some) - len(good),
                    others=round(sum(r.others for r in good) / len(good)) if good else 0,
                    seconds=median_seconds(good),
                    analysis_seconds=sorted(r.analysis_seconds for r in good)[len(good) // 2]
                    if good
                    else 0.0,
                    summary=summarise(scored(good), seed=seed),
                    healed=summarise(scored(good, healed=True), seed=seed),
                    new_spots=summarise_spots(good, "new_spots"),
                    vanished_spots=summarise_spots(good, "vanished_spots"),
                )
            )
    return out


def part_rows(records: Sequence[Record], rung: Rung, *, seed: int = 0) -> list[PartRow]:
    """One row per stance class and body part with lesions."""
    out = []
    for group in GROUPS:
        scores = scored([r for r in records if r.rung == rung and r.name.group == group])
        for part in (*PARTS, "all"):
            some = [(b, s) for b, s in scores if part in (s.part, "all")]
            if some:
                out.append(PartRow(rung, group, part, summarise(some, seed=seed)))
    return out


def stance_rows(records: Sequence[Record], rung: Rung, *, seed: int = 0) -> list[StanceRow]:
    """One row per pair of stances, the smallest mean error first."""
    own = [r for r in records if r.rung == rung and not r.failure]
    out = []
    for stances in sorted({r.name.stances for r in own}):
        some = [r for r in own if r.name.stances == stances]
        out.append(StanceRow(rung, stances, len(some), summarise(scored(some), seed=seed)))
    return sorted(
        out,
        key=lambda row: (row.summary.mean_mm.value != row.summary.mean_mm.value, row.summary.mean_mm.value),
    )


def detailed_rungs(rungs: Sequence[Rung], method: str) -> list[Rung]:
    """The rungs whose parts and stances are worth a table: the method's, under the first conditions run."""
    own = [rung for rung in rungs if rung.method == method] or [r for r in rungs if r.method != FLOOR][-1:]
    return [r for r in own if (r.joints, r.frames) == (own[0].joints, own[0].frames)]


def _spots(summary: SpotSummary | None) -> dict[str, Any] | None:
    if summary is None:
        return None
    return {k: (None if v != v else v) for k, v in asdict(summary).items()}
