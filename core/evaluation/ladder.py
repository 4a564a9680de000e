"""The accuracy ladder: every method on the same pairs of captures, from stiff alignment to the best."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import replace

from core.anchors import AnalysedCapture
from core.errors import WorkError
from core.evaluation.cases import CaseName, CaseSource, EvaluationCase, Joints, PendingCase
from core.evaluation.methods import GEOMETRIC, baselines_registered
from core.evaluation.records import FLOOR, Journal, Record, Rung
from core.evaluation.scores import score_lesions, score_spots, sensor_floor
from core.progress import Progress, no_progress
from core.relocation import LesionQuery, RelocationOptions, relocate


def ladder_rungs(
    methods: Iterable[str],
    *,
    joints: Sequence[Joints] = ("tracked",),
    frames: Sequence[int] = (30,),
    appearance: Sequence[bool] = (False, True),
) -> tuple[Rung, ...]:
    """The rungs of methods under all these conditions, each set of conditions with the sensor floor."""
    chosen = tuple(methods)
    out = []
    for kind in joints:
        for count in frames:
            out.append(Rung(FLOOR, kind, count))
            for method in chosen:
                colors = (False,) if method in GEOMETRIC else tuple(appearance)
                out += [Rung(method, kind, count, color) for color in colors]
    return tuple(dict.fromkeys(out))


def run_ladder(
    source: CaseSource,
    rungs: Sequence[Rung],
    journal: Journal,
    *,
    options: RelocationOptions | None = None,
    seed: int = 0,
    progress: Progress = no_progress,
) -> list[Record]:
    """Measure every rung on every pair of a source that the journal does not hold yet.

    Parameters
    ----------
    options : RelocationOptions, optional
        For every method alike.
    seed : int
        Of the methods.

    Returns
    -------
    list of Record
        Of all rungs and pairs, measured now or before.

    Raises
    ------
    Cancelled
        Through ``progress``; what was measured stays in the journal.
    InputError
        If a pair is contradictory; likewise.
    """
    names: list[CaseName] = []
    with baselines_registered():
        for number, pending in enumerate(source.cases()):
            names.append(pending.name)
            missing = [rung for rung in rungs if (rung, pending.name) not in journal]
            for joints, frames in dict.fromkeys((rung.joints, rung.frames) for rung in missing):
                progress(
                    number / max(1, len(source)), f"{pending.name.case}, {joints} joints, {frames} frames"
                )
                some = [rung for rung in missing if (rung.joints, rung.frames) == (joints, frames)]
                _measure(pending, some, journal, options, seed)
    progress(1.0, "Measured")
    return journal.records(rungs, names)


def _measure(
    pending: PendingCase,
    rungs: Sequence[Rung],
    journal: Journal,
    options: RelocationOptions | None,
    seed: int,
) -> None:
    """Rungs of the same joints and frames on one pair. Unusable captures are a record with a reason."""
    try:
        case = pending.load(rungs[0].joints, rungs[0].frames)
    except WorkError as error:
        for rung in rungs:
            journal.add(Record(rung, pending.name, journal.code, failure=error.message))
        return
    for rung in rungs:
        try:
            journal.add(_measure_rung(case, pending.name, rung, journal.code, options, seed))
        except WorkError as error:
            journal.add(Record(rung, pending.name, journal.code, failure=error.message))


def _measure_rung(
    case: EvaluationCase, name: CaseName, rung: Rung, code: str, options: RelocationOptions | None, seed: int
) -> Record:
    others = max(0, len(case.mole_ids) - 1)
    if rung.method == FLOOR:
        return Record(
            rung,
            name,
            code,
            analysis_seconds=case.analysis_seconds,
            others=others,
            lesions=tuple(sensor_floor(case)),
        )
    queries = [LesionQuery(lesion.id, lesion.pixel, healed=lesion.healed) for lesion in case.lesions]
    first, followup = _unprepared(case.first), _unprepared(case.followup)
    start = time.perf_counter()
    result = relocate(
        first,
        followup,
        queries,
        method=rung.method,
        appearance=rung.appearance,
        seed=seed,
        options=options,
    )
    seconds = time.perf_counter() - start
    looks = rung.appearance and case.spots is not None
    return Record(
        rung,
        name,
        code,
        seconds=seconds,
        analysis_seconds=case.analysis_seconds,
        others=others,
        lesions=tuple(score_lesions(case, result)),
        new_spots=score_spots(result.new_spots, case.spots.new_m) if looks and case.spots else None,
        vanished_spots=score_spots(result.vanished_spots, case.spots.vanished_m)
        if looks and case.spots
        else None,
    )


def _unprepared(analysed: AnalysedCapture) -> AnalysedCapture:
    """The same capture without what an earlier method computed on it: no method is timed short."""
    scan = replace(analysed.scan, surface=replace(analysed.scan.surface))
    scan.prepare_clicks()
    return replace(analysed, scan=scan)
