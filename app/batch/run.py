"""The run of a cohort: what is still to be done goes to the workers, what comes back goes to disk at once."""

from __future__ import annotations

import json
import logging
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event

from app.batch.case import Case, CaseOutcome
from app.batch.fingerprint import fingerprint
from app.batch.journal import JOURNAL, Finished, Journal, alone_in, digest_of
from app.batch.runners import Runner
from app.batch.tables import CASES, RESULTS, counts_of, write_tables
from core.errors import InputError

_log = logging.getLogger("geoderm.batch")

_WAIT_S = 0.25
"""How long a request to stop may go unnoticed."""

_LEFTOVER = re.compile(r"\.(.+\.(json|csv)|relocate-batch\.jsonl)[._a-z0-9]{8,9}")


@dataclass
class Progress:
    """How far a run is.

    Attributes
    ----------
    total : int
        Pairs of the manifest.
    kept : int
        Finished by an earlier run, with nothing changed since.
    done, failed : int
        Finished by this run.
    workers : int
        Pairs that may be under way at once.
    seconds : float
        Since the first pair was handed out.
    """

    total: int
    kept: int = 0
    done: int = 0
    failed: int = 0
    workers: int = 0
    seconds: float = 0.0

    @property
    def finished(self) -> int:
        """Pairs that have a row, by this run or an earlier one."""
        return self.kept + self.done + self.failed

    @property
    def rate_hz(self) -> float:
        """Pairs finished by this run in a second."""
        return (self.done + self.failed) / self.seconds if self.seconds > 0 else 0.0


def run_batch(
    cases: Sequence[Case],
    folder: Path,
    start_runner: Callable[[], Runner],
    *,
    fresh: bool = False,
    stop: Event | None = None,
    report: Callable[[Progress], None] = lambda _: None,
) -> Progress:
    """Relocate every pair that is not finished yet, and write the tables.

    Parameters
    ----------
    cases : sequence of Case
    folder : Path
        Where results, tables and the journal are kept.
    start_runner : callable
        Called when the first pair must be computed, and not at all if none must.
    fresh : bool
        Compute again what earlier runs finished.
    stop : Event, optional
        Set it to end early: nothing further is computed, what is finished is in the tables.
    report : callable
        Told of every change, and a few times a second.

    Raises
    ------
    InputError
        If the folder holds files of another kind, or another run works in it.
    WorkError
        If nothing can be written, or no worker is left.
    """
    stop = stop or Event()
    with alone_in(folder):
        _refuse_foreign_tables(folder)
        _remove_leftovers(folder)
        with Journal(folder, fresh=fresh) as journal:
            progress = Progress(len(cases))
            try:
                _work(_Unfinished(cases, journal, progress, report, stop), start_runner, stop)
            finally:
                # whatever ends the run, the tables tell what is finished
                write_tables(folder, cases, journal)
    return progress


class _Unfinished(Iterator[Case]):
    """Pairs that must be computed, looked up one at a time; the others are counted as kept."""

    def __init__(
        self,
        cases: Sequence[Case],
        journal: Journal,
        progress: Progress,
        report: Callable[[Progress], None],
        stop: Event,
    ) -> None:
        self.journal, self.progress, self.report = journal, progress, report
        self._cases, self._stop = iter(cases), stop

    def __next__(self) -> Case:
        for case in self._cases:
            if self._stop.is_set():
                break
            if _is_finished(case, self.journal):
                self.progress.kept += 1
            elif _is_foreign(self.journal.folder / f"{case.name}.json"):
                told = f"{case.name}.json is in the way: it is no result, and was not overwritten."
                finish(CaseOutcome(case.name, reason=told), self.journal, self.progress)
            else:
                return case
            self.report(self.progress)
        raise StopIteration


def _work(cases: _Unfinished, start_runner: Callable[[], Runner], stop: Event) -> None:
    progress = cases.progress
    upcoming = next(cases, None)
    if upcoming is None:
        return
    runner = start_runner()
    try:
        under_way, started = 0, time.perf_counter()
        while (upcoming is not None or under_way) and not stop.is_set():
            progress.workers = runner.capacity()
            while upcoming is not None and under_way < progress.workers:
                runner.submit(upcoming)
                under_way += 1
                upcoming = next(cases, None)
            outcome = runner.collect(_WAIT_S)
            if outcome is not None:
                under_way -= 1
                finish(outcome, cases.journal, progress)
            progress.seconds = time.perf_counter() - started
            cases.report(progress)
    finally:
        runner.close()


def finish(outcome: CaseOutcome, journal: Journal, progress: Progress) -> None:
    """Write what became of a pair: first the result, then the line that says so."""
    from core.relocation import write_json

    path = journal.folder / f"{outcome.case}.json"
    sha256, counts = "", {}
    if outcome.document is not None:
        write_json(path, outcome.document)
        sha256, counts = digest_of(path), counts_of(outcome.document)
        progress.done += 1
    else:
        if not _is_foreign(path):
            path.unlink(missing_ok=True)  # of other inputs or options
        progress.failed += 1
    if outcome.trace:
        _log.error("bug in case %s\n%s", outcome.case, outcome.trace)
    journal.add(
        Finished(
            outcome.case,
            outcome.fingerprint,
            sha256,
            outcome.reason,
            round(outcome.seconds, 3),
            round(outcome.peak_memory_bytes / 1e6, 1),
            counts,
        )
    )


def _is_finished(case: Case, journal: Journal) -> bool:
    entry = journal.get(case.name)
    return (
        entry is not None
        and entry.fingerprint != ""
        and entry.fingerprint == fingerprint(case)
        and (not entry.done or journal.result_is_whole(entry))
    )


def _is_foreign(path: Path) -> bool:
    """Whether a file stands where a result belongs that this command cannot have written."""
    from core.relocation.result_json import FORMAT

    if not path.exists():
        return False
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return True
    return not isinstance(content, dict) or content.get("format") != FORMAT


def _refuse_foreign_tables(folder: Path) -> None:
    for name in (RESULTS, CASES):
        if (folder / name).exists() and not (folder / JOURNAL).exists():
            raise InputError(
                f"{folder / name}: is there already and not of this command.", "Choose an empty folder."
            )


def _remove_leftovers(folder: Path) -> None:
    """Files that a killed run was about to rename."""
    for path in folder.iterdir():
        if _LEFTOVER.fullmatch(path.name):
            with suppress(OSError):
                path.unlink()
