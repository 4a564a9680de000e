"""The accuracy ladder: every method on the same cases, from stiff alignment to the best."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from core.evaluation.baselines import register_baselines
from core.evaluation.cases import CaseSource, EvaluationCase
from core.evaluation.scores import LesionScore, Summary, score_lesions, sensor_floor, summarise
from core.progress import Progress, no_progress
from core.relocation import LesionQuery, RelocationOptions, relocate

LADDER = ("rigid-alignment", "nearest-bone", "voting-dijkstra", "voting-fmm", "trilateration")
FLOOR = "sensor floor"


@dataclass(frozen=True)
class LadderRow:
    """Figures of one method in one group of cases.

    Attributes
    ----------
    method : str
        A relocation method, or `FLOOR`.
    group, joints : str
        See `EvaluationCase`.
    cases : int
    seconds : float
        Median time of a relocation; 0 for the floor.
    summary : Summary
    """

    method: str
    group: str
    joints: str
    cases: int
    seconds: float
    summary: Summary

    def flat(self) -> dict[str, object]:
        """One dictionary for tables and JSON."""
        head = {"method": self.method, "group": self.group, "joints": self.joints, "cases": self.cases}
        return {**head, "seconds": self.seconds, **asdict(self.summary)}


def run_ladder(
    source: CaseSource,
    *,
    methods: Sequence[str] = LADDER,
    options: RelocationOptions | None = None,
    appearance: bool = False,
    seed: int = 0,
    progress: Progress = no_progress,
) -> list[LadderRow]:
    """Score methods on all cases of a source.

    Parameters
    ----------
    options : RelocationOptions, optional
        For every method alike.
    appearance : bool
        Whether colour may be matched; off in the ladder of geometry.
    seed : int
        Of the methods and of the bootstrap.

    Returns
    -------
    list of LadderRow
        One per method, group and kind of joints that occurred, in the order of the ladder.
    """
    register_baselines()
    scores: dict[tuple[str, str, str], list[LesionScore]] = {}
    seconds: dict[tuple[str, str, str], list[float]] = {}
    for number, case in enumerate(source.cases()):
        progress(min(0.99, number / (number + 4.0)), case.name)
        queries = [LesionQuery(lesion.id, lesion.pixel) for lesion in case.lesions]
        for method in methods:
            start = time.perf_counter()
            result = relocate(
                case.first,
                case.followup,
                queries,
                method=method,
                appearance=appearance,
                seed=seed,
                options=options,
            )
            _add(scores, seconds, case, method, score_lesions(case, result), time.perf_counter() - start)
        _add(scores, seconds, case, FLOOR, sensor_floor(case), 0.0)
    order = {name: i for i, name in enumerate((*methods, FLOOR))}
    keys = sorted(scores, key=lambda k: (k[2], k[1] != "same stance", k[1], order[k[0]]))
    progress(1.0, "Done")
    return [
        LadderRow(
            method=k[0],
            group=k[1],
            joints=k[2],
            cases=len(seconds[k]),
            seconds=sorted(seconds[k])[len(seconds[k]) // 2],
            summary=summarise(scores[k], seed=seed),
        )
        for k in keys
    ]


def _add(
    scores: dict[tuple[str, str, str], list[LesionScore]],
    seconds: dict[tuple[str, str, str], list[float]],
    case: EvaluationCase,
    method: str,
    new: list[LesionScore],
    duration: float,
) -> None:
    key = (method, case.group, case.joints)
    scores.setdefault(key, []).extend(new)
    seconds.setdefault(key, []).append(duration)
