"""The figures that the application claims to reach, and what was measured for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from core.evaluation.cases import OTHER, SAME
from core.evaluation.tables import LadderRow, PartRow


@dataclass(frozen=True)
class Target:
    """One claimed figure.

    Attributes
    ----------
    figure : str
    measured : str
        With its interval over bodies where there is one; "not measured" otherwise.
    to_reach, dream : str
    reached : bool or None
        None where nothing was measured.
    """

    figure: str
    measured: str
    to_reach: str
    dream: str
    reached: bool | None


_ERRORS = (
    (SAME, False, (6.0, 12.0), "3 / 6 mm"),
    (OTHER, False, (10.0, 25.0), "5 / 12 mm"),
    (SAME, True, (2.5, 4.5), "1.5 / 3 mm"),
    (OTHER, True, (3.5, 8.0), "2 / 4 mm"),
)
_LEAST_LESIONS = 10
"""A body part with fewer answers says nothing about a share of 95 %."""


def targets(rows: Sequence[LadderRow], parts: Sequence[PartRow]) -> list[Target]:
    """The accuracy table of the claims, from the rows of one method under the headline's conditions."""
    by = {(row.group, row.rung.appearance): row for row in rows}
    out = [_errors(by.get((group, color)), group, color, bar, dream) for group, color, bar, dream in _ERRORS]
    best = [row for row in rows if row.rung.appearance] or list(rows)
    other = next((row for row in best if row.group == OTHER), None)
    if other is None:
        out.append(Target("within 10 mm, other stance", "not measured", "96 %", "99 %", None))
    else:
        near = other.summary.within_10mm
        measured = f"{percent(near.value)} ({percent(near.low)} to {percent(near.high)})"
        out.append(Target("within 10 mm, other stance", measured, "96 %", "99 %", near.value >= 0.96))
    out += [*_mistakes(best), _coverage(parts)]
    limbs = sum(row.summary.wrong_limb for row in best)
    measured = str(limbs) if best else "not measured"
    return [*out, Target("wrong limb or side", measured, "0", "0", limbs == 0 if best else None)]


def _errors(row: LadderRow | None, group: str, color: bool, bar: tuple[float, float], dream: str) -> Target:
    figure = f"{group}, {'with appearance' if color else 'geometry only'}: mean / P95"
    to_reach = f"{bar[0]:g} / {bar[1]:g} mm"
    if row is None or math.isnan(row.summary.mean_mm.value):
        return Target(figure, "not measured", to_reach, dream, None)
    mean, tail = row.summary.mean_mm, row.summary.p95_mm
    measured = (
        f"{mean.value:.1f} ({mean.low:.1f} to {mean.high:.1f}) / "
        f"{tail.value:.1f} ({tail.low:.1f} to {tail.high:.1f}) mm"
    )
    return Target(figure, measured, to_reach, dream, mean.value <= bar[0] and tail.value <= bar[1])


def _mistakes(rows: Sequence[LadderRow]) -> list[Target]:
    """Wrong lesions, hidden lesions and false alarms, over both stance classes."""
    answered = sum(row.summary.answered * row.summary.lesions for row in rows if row.summary.lesions)
    known = [row for row in rows if not math.isnan(row.summary.wrong_lesion)]
    wrong = sum(row.summary.wrong_lesion * row.summary.answered * row.summary.lesions for row in known)
    others = round(sum(row.others for row in rows) / len(rows)) if rows else 0
    hidden = sum(row.summary.hidden for row in rows)
    said = sum(row.summary.hidden_said * row.summary.hidden for row in rows if row.summary.hidden)
    lesions = sum(row.summary.lesions for row in rows)
    alarms = sum(row.summary.false_alarms * row.summary.lesions for row in rows if row.summary.lesions)
    share = wrong / answered if known and answered else math.nan
    told, false = (said / hidden if hidden else math.nan), (alarms / lesions if lesions else math.nan)
    return [
        Target(
            f"wrong lesion chosen among {others} others",
            percent(share),
            "3 %",
            "1 %",
            None if math.isnan(share) else share <= 0.03,
        ),
        Target(
            "lesion not visible: said so / false alarm",
            f"{percent(told)} of {hidden} / {percent(false)} of {lesions}",
            "90 % / 3 %",
            "97 % / 1 %",
            None if math.isnan(told) or math.isnan(false) else told >= 0.90 and false <= 0.03,
        ),
    ]


def _coverage(parts: Sequence[PartRow]) -> Target:
    """The worst and the best share over all stance classes and body parts with enough answers."""
    figure, to_reach = "stated 95 % radius holds, per stance class and body part", "93-97 %"
    shares = {
        f"{row.part}, {row.group}": row.summary.in_radius.value
        for row in parts
        if row.part != "all"
        and row.summary.lesions * row.summary.answered >= _LEAST_LESIONS
        and not math.isnan(row.summary.in_radius.value)
    }
    if not shares:
        return Target(figure, "not measured", to_reach, "same, radius halved", None)
    low, high = min(shares, key=shares.__getitem__), max(shares, key=shares.__getitem__)
    measured = f"{percent(shares[low])} ({low}) to {percent(shares[high])} ({high})"
    good = all(0.93 <= share <= 0.97 for share in shares.values())
    return Target(figure, measured, to_reach, "same, radius halved", good)


def percent(share: float) -> str:
    """A share as a figure; a dash where there is none."""
    return "-" if math.isnan(share) else f"{100 * share:.1f} %"
