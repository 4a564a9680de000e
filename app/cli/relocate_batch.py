"""``geoderm relocate-batch``: the lesions of many first visits in their follow-ups."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from app.batch.runners import Runner

STOPPED = 130
TERMINATED = 143


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("relocate-batch")(relocate_batch)


def relocate_batch(
    manifest: Path = typer.Argument(..., help="CSV with the columns case, first, followup, lesions."),
    out: Path = typer.Option(..., "--out", help="Folder for results; a run that was ended goes on there."),
    method: str = typer.Option("", "--method", help="Relocation method (default: the best shipped)."),
    no_appearance: bool = typer.Option(False, "--no-appearance", help="Geometry alone: never match colour."),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of every random draw."),
    workers: int | None = typer.Option(
        None, "--workers", min=0, max=1024, help="Worker processes (default: all cores); 0: in this process."
    ),
    scheduler: str = typer.Option("", "--scheduler", help="Address of a Dask scheduler, tcp://HOST:8786."),
    fresh: bool = typer.Option(False, "--fresh", help="Compute again what earlier runs finished."),
) -> int:
    """Relocate every pair of MANIFEST; a pair that cannot be relocated is a row with the reason."""
    from app.batch.manifest import read_manifest
    from app.batch.progress_line import ProgressLine
    from app.batch.run import run_batch
    from app.logs import start_logging
    from core.relocation import DEFAULT_METHOD, relocation_method

    if scheduler and workers is not None:
        raise InputError("--workers and --scheduler exclude each other.", "A cluster has its own workers.")
    method = method or DEFAULT_METHOD
    relocation_method(method)
    cases = read_manifest(manifest, method=method, appearance=not no_appearance, seed=seed)
    _prepare_folder(out, manifest)
    start_logging()

    def start_runner() -> Runner:
        return _start_runner(workers, scheduler)

    line = ProgressLine()
    with _stoppable() as (stop, signals):
        try:
            progress = run_batch(cases, out, start_runner, fresh=fresh, stop=stop, report=line)
        finally:
            line.close()
    missing = progress.total - progress.finished
    sys.stdout.write(
        f"{progress.total} pairs: {progress.done} done, {progress.failed} failed, "
        f"{progress.kept} kept from earlier{f', {missing} left' if missing else ''}\n"
    )
    if signals:
        sys.stderr.write("geoderm: stopped; the same command goes on where it stopped\n")
        return TERMINATED if signals[0] == signal.SIGTERM else STOPPED
    return 0


def _start_runner(workers: int | None, scheduler: str) -> Runner:
    if workers == 0:
        from app.batch.runners import InProcess

        return InProcess()
    from app.batch.dask_runner import DaskRunner, default_workers

    if scheduler:
        return DaskRunner.on_cluster(scheduler)
    return DaskRunner.on_this_machine(workers or default_workers())


def _prepare_folder(out: Path, manifest: Path) -> None:
    from app.batch.tables import CASES, RESULTS

    try:
        out.mkdir(exist_ok=True)
    except FileExistsError as error:
        raise InputError(f"{out}: is a file, not a folder.", "Choose another name.") from error
    except OSError as error:
        raise InputError(
            f"{out}: the folder cannot be made ({error.strerror}).", "Create the folder that should hold it."
        ) from error
    if manifest.resolve() in {(out / name).resolve() for name in (RESULTS, CASES)}:
        raise InputError(
            f"{manifest}: would be overwritten by the table of that name.", "Choose another --out."
        )


@contextlib.contextmanager
def _stoppable() -> Iterator[tuple[Event, list[int]]]:
    """Turn the first Ctrl+C (or request to end) into an orderly stop; the second ends the process at once."""
    stop, signals = Event(), list[int]()
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def ask(number: int, _: object) -> None:
        signals.append(number)
        stop.set()
        for each, handler in kept.items():
            signal.signal(each, handler)

    for number in kept:
        signal.signal(number, ask)
    try:
        yield stop, signals
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
