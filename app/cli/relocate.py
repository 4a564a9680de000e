"""``geoderm relocate``: the lesions of a first visit in the capture of a follow-up."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from app.batch.one_pair import RelocatedPair
    from core.relocation import RelocationOptions


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("relocate")(relocate_command)


def relocate_command(
    first: Path = typer.Argument(..., help="Capture folder of the first visit, or a folder of them."),
    followup: Path = typer.Argument(..., help="Capture folder of the follow-up, or a folder of them."),
    lesions: Path = typer.Option(..., "--lesions", help="lesions.json: places in the first visit's picture."),
    out: Path = typer.Option(..., "--out", help="result.json to write."),
    method: str = typer.Option("", "--method", help="Relocation method (default: the best shipped)."),
    no_appearance: bool = typer.Option(False, "--no-appearance", help="Geometry alone: never match colour."),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of every random draw."),
    delta_m: float | None = typer.Option(
        None, "--delta-m", help="Half width of a voting band in metres. Default: 0.03 (docs/method.md)."
    ),
    explain: Path | None = typer.Option(
        None, "--explain", help="Folder for pictures explaining every lesion."
    ),
) -> None:
    """Find the lesions of FIRST again in FOLLOWUP."""
    from app.batch.one_pair import relocate_folders
    from core.relocation import (
        DEFAULT_DELTA_M,
        DEFAULT_METHOD,
        RelocationOptions,
        relocation_method,
        write_json,
    )

    method = method or DEFAULT_METHOD
    relocation_method(method)
    options = RelocationOptions(delta_m=DEFAULT_DELTA_M if delta_m is None else delta_m)
    if not out.parent.is_dir():
        raise InputError(f"{out}: the folder does not exist.", "Create it or choose another.")
    pair = relocate_folders(
        first, followup, lesions, method=method, appearance=not no_appearance, seed=seed, options=options
    )
    write_json(out, pair.document)
    if explain is not None:
        _explain(explain, pair, options)


def _explain(folder: Path, pair: RelocatedPair, options: RelocationOptions) -> None:
    """Pictures of every lesion against the capture its answer lies in, with the distances of the method."""
    from core.relocation.explain import KINDS, explain_lesion
    from core.relocation.explain_files import write_explanation

    first, followup, result = pair.first, pair.followup, pair.result
    for query, lesion in zip(pair.queries, result.lesions, strict=True):
        source = first.get(query.capture if query.capture is not None else next(iter(first)))
        name = lesion.capture if lesion.capture is not None else next(iter(followup))
        if source is None:
            continue
        target = followup[name]
        method = result.method if result.method in KINDS else "trilateration"
        explanation = explain_lesion(
            source, target, query, method=method, options=options, answer_m=lesion.point_m
        )
        if explanation is not None:
            prefix = query.id if len(followup) == 1 else f"{query.id}-{name}"
            write_explanation(explanation, source, target, folder, prefix)
