"""The report of a ladder: JSON for programs, Markdown for people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from core.errors import WorkError
from core.evaluation.records import FLOOR, Record, Rung
from core.evaluation.summaries import SpotSummary, Summary
from core.evaluation.tables import (
    LadderRow,
    PartRow,
    StanceRow,
    detailed_rungs,
    ladder_rows,
    part_rows,
    stance_rows,
)
from core.evaluation.targets import Target, percent, targets
from core.relocation import DEFAULT_METHOD, write_json

FORMAT = "geoderm-ladder/2"

DEFINITIONS = """\
* Errors are distances in space from the answer to the true place, over the lesions that the follow-up shows
  and that got an answer; intervals (95 %) re-sample bodies, not lesions.
* Sensor floor: error of the place that the sensor itself gives for the true pixel. Beside the floor:
  distance of the answer to that place.
* Wrong lesion: the answer is nearer to another true mole of the body than to its own, and farther than 5 mm
  from its own.
* Wrong limb: the answer is 50 mm or more from the true place and on another limb (head, trunk, arms, legs,
  by the true skeleton), or on the other side of the trunk, both more than 30 mm from the median plane.
* Hidden: the follow-up's two cameras do not both see the lesion. Said so: answered `not_visible`. False
  alarm: a lesion that is seen, answered `not_visible`.
* In radius: the true place lies within the stated 95 % radius. In ellipse: projected onto the tangent plane
  of the answer, it lies in the stated ellipse. The yardsticks state no radius of their own (200 mm for
  all).
* Healed sites: moles that the second visit no longer shows, asked for as healed.
* New and vanished spots: listed ones within 8 mm of a mole that truly came or went, on skin that both
  visits show.
* Time: one relocation after both captures were analysed, nothing prepared by an earlier method."""


@dataclass(frozen=True)
class LadderReport:
    """Everything that a ladder has to say."""

    about: Mapping[str, Any]
    targets: Sequence[Target]
    rows: Sequence[LadderRow]
    parts: Sequence[PartRow]
    stances: Sequence[StanceRow]
    failures: Sequence[str]

    def to_json(self) -> dict[str, Any]:
        """The document ``geoderm-ladder/2``."""
        return {
            "format": FORMAT,
            "about": dict(self.about),
            "targets": [asdict(t) for t in self.targets],
            "rows": [row.to_json() for row in self.rows],
            "parts": [row.to_json() for row in self.parts],
            "stances": [row.to_json() for row in self.stances],
            "failures": list(self.failures),
        }


def make_report(
    records: Sequence[Record],
    rungs: Sequence[Rung],
    *,
    about: Mapping[str, Any] | None = None,
    method: str = DEFAULT_METHOD,
    seed: int = 0,
) -> LadderReport:
    """Summarise records.

    Parameters
    ----------
    about : mapping, optional
        What was run, for the head of the report.
    method : str
        Whose body parts, stances and claims are shown; under the first conditions among its rungs.
    """
    rows = ladder_rows(records, rungs, seed=seed)
    details = detailed_rungs(rungs, method)
    parts = [row for rung in details for row in part_rows(records, rung, seed=seed)]
    stances = [row for rung in details for row in stance_rows(records, rung, seed=seed)]
    chosen = [r for r in details if r.appearance] or details
    return LadderReport(
        about=about or {},
        targets=targets([row for row in rows if row.rung in details], [p for p in parts if p.rung in chosen]),
        rows=rows,
        parts=parts,
        stances=stances,
        failures=[
            f"{r.name.case}, {r.rung.label}, {r.rung.conditions}: {r.failure}" for r in records if r.failure
        ],
    )


def write_report(report: LadderReport, folder: Path, *, pictures: Sequence[str] = ()) -> None:
    """Write ladder.json and report.md.

    Raises
    ------
    WorkError
        If they cannot be written.
    """
    write_json(folder / "ladder.json", report.to_json())
    try:
        (folder / "report.md").write_text(markdown(report, pictures), encoding="utf-8")
    except OSError as error:
        raise WorkError(f"{folder}: cannot be written ({error.strerror or error}).") from error


def markdown(report: LadderReport, pictures: Sequence[str] = ()) -> str:
    """The report for people."""
    lines = ["# Accuracy ladder", ""]
    lines += [f"* {name}: {value}" for name, value in report.about.items()]
    lines += ["", "## Claims", "", *claims_table(report.targets)]
    for name in pictures:
        lines += ["", f"![{Path(name).stem.replace('_', ' ')}]({name})"]
    for conditions in dict.fromkeys(row.rung.conditions for row in report.rows):
        for group in dict.fromkeys(row.group for row in report.rows):
            rows = [r for r in report.rows if (r.rung.conditions, r.group) == (conditions, group)]
            if rows:
                lines += ["", f"## {conditions}, {group}", "", *ladder_table(rows)]
    for title, some in (
        ("Body parts", [("parts", r.rung, (r.group, r.part), r.summary) for r in report.parts]),
        (
            "Stances, the easiest first",
            [("stances", r.rung, ("", r.stances), r.summary) for r in report.stances],
        ),
    ):
        for rung in dict.fromkeys(rung for _, rung, _, _ in some):
            lines += ["", f"## {title}: {rung.label}, {rung.conditions}", ""]
            lines += detail_table([(names, summary) for _, r, names, summary in some if r == rung])
    lines += _sites_and_spots(report.rows)
    if report.failures:
        lines += ["", "## Pairs that could not be measured", "", *(f"* {text}" for text in report.failures)]
    return "\n".join([*lines, "", "## What the words mean", "", DEFINITIONS, ""])


def claims_table(rows: Sequence[Target]) -> list[str]:
    """The claims as Markdown."""
    lines = ["| figure | measured | to reach | dream | reached |", "|---|---|---|---|---|"]
    for t in rows:
        reached = "-" if t.reached is None else "yes" if t.reached else "no"
        lines.append(f"| {t.figure} | {t.measured} | {t.to_reach} | {t.dream} | {reached} |")
    return lines


def ladder_table(rows: Sequence[LadderRow]) -> list[str]:
    """Rungs of the same conditions and stance class as Markdown."""
    head = (
        "method | mean mm (interval) | median | P95 (interval) | within 10 mm | beside floor | "
        "beyond 100 mm | wrong lesion | wrong limb | hidden said | false alarm | answered | refused | "
        "in radius | radius mm | in ellipse | seconds"
    )
    lines = [f"| {head} |", "|" + "---|" * (head.count("|") + 1)]
    for row in rows:
        s = row.summary
        floor = row.rung.method == FLOOR
        cells = [
            row.rung.label,
            _interval(s.mean_mm.value, s.mean_mm.low, s.mean_mm.high),
            number(s.median_mm),
            _interval(s.p95_mm.value, s.p95_mm.low, s.p95_mm.high),
            percent(s.within_10mm.value),
            number(s.beside_floor_mm),
            str(s.beyond_100mm),
            percent(s.wrong_lesion),
            "-" if floor else str(s.wrong_limb),
            "-" if floor else f"{percent(s.hidden_said)} of {s.hidden}",
            "-" if floor else percent(s.false_alarms),
            f"{percent(s.answered)} of {s.lesions}",
            percent(s.refused),
            percent(s.in_radius.value),
            number(s.radius_mm),
            percent(s.in_region),
            "-" if floor else f"{row.seconds:.2f}",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    last = rows[-1]
    lines += [
        "",
        f"{last.pairs} pairs, {last.summary.bodies} bodies, {last.others} other moles on a body; "
        f"both captures were analysed in {last.analysis_seconds:.1f} s (median).",
    ]
    return lines


def detail_table(rows: Sequence[tuple[tuple[str, str], Summary]]) -> list[str]:
    """Rows with one or two names before the figures, as Markdown."""
    head = (
        "lesions | mean mm | median | P95 | within 10 mm | in radius (interval) | radius mm | in ellipse | "
        "refused"
    )
    two = any(names[0] for names, _ in rows)
    lines = [f"| {'stance class | part' if two else 'stances'} | {head} |"]
    lines.append("|" + "---|" * (lines[0].count("|") - 1))
    for names, s in rows:
        cells = [
            *(names if two else names[1:]),
            str(s.lesions),
            number(s.mean_mm.value),
            number(s.median_mm),
            number(s.p95_mm.value),
            percent(s.within_10mm.value),
            f"{percent(s.in_radius.value)} ({percent(s.in_radius.low)} to {percent(s.in_radius.high)})",
            number(s.radius_mm),
            percent(s.in_region),
            percent(s.refused),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _sites_and_spots(rows: Sequence[LadderRow]) -> list[str]:
    lines: list[str] = []
    healed = [row for row in rows if row.healed.lesions]
    if healed:
        lines += ["", "## Sites of healed lesions", ""]
        lines.append(
            "| method | conditions | stance class | sites | answered | mean mm | P95 | in radius | radius |"
        )
        lines.append("|" + "---|" * 9)
    for row in healed:
        h = row.healed
        lines.append(
            f"| {row.rung.label} | {row.rung.conditions} | {row.group} | {h.lesions} | "
            f"{percent(h.answered)} | {number(h.mean_mm.value)} | {number(h.p95_mm.value)} | "
            f"{percent(h.in_radius.value)} | {number(h.radius_mm)} |"
        )
    spots = [
        (row, kind, summary)
        for row in rows
        for kind, summary in (("new", row.new_spots), ("vanished", row.vanished_spots))
        if summary is not None
    ]
    if spots:
        lines += ["", "## New and vanished spots", ""]
        lines.append("| method | conditions | stance class | spots | truly | listed | precision | recall |")
        lines.append("|" + "---|" * 8)
    lines += [_spot_line(row, kind, summary) for row, kind, summary in spots]
    return lines


def _spot_line(row: LadderRow, kind: str, s: SpotSummary) -> str:
    return (
        f"| {row.rung.label} | {row.rung.conditions} | {row.group} | {kind} | {s.true} | {s.listed} | "
        f"{percent(s.precision)} | {percent(s.recall)} |"
    )


def _interval(value: float, low: float, high: float) -> str:
    return "-" if math.isnan(value) else f"{value:.1f} ({low:.1f} to {high:.1f})"


def number(value: float) -> str:
    """A figure with one decimal; a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.1f}"
