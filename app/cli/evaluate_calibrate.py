"""``geoderm evaluate calibrate``: what the stated regions would have to be multiplied by."""

from __future__ import annotations

from pathlib import Path

import typer


def register(group: typer.Typer) -> None:
    """Add the command to ``geoderm evaluate``."""
    group.command("calibrate")(calibrate)


def calibrate(
    residuals: Path = typer.Argument(help="Table written by: geoderm evaluate residuals."),
    method: str = typer.Option("fused", help="Whose regions."),
) -> None:
    """Say how well stated 95 % regions held, and by what they would have to be multiplied."""
    from core.errors import InputError
    from core.evaluation.conformal import read_residuals, region_factors

    factors = region_factors(read_residuals(residuals), method)
    if not factors:
        raise InputError(f"{residuals}: holds no answer of the method '{method}'.")
    typer.echo(f"{'found by':9} {'stance':13} {'part':10} answers   held  multiply by")
    for f in factors:
        note = "  (shared with its limb or trunk)" if f.shared else ""
        line = f"{f.kind:9} {f.stance_class:13} {f.part:10} {f.answers:7d} {100 * f.held:5.1f} %"
        typer.echo(f"{line} {f.factor:12.2f}{note}")
