"""``geoderm evaluate``: accuracy on simulated patients, by the application's own tracker."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from core.evaluation import LadderRow


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="Measure accuracy.", no_args_is_help=True, pretty_exceptions_enable=False)
    group.callback()(_group)
    group.command("ladder")(ladder)
    app.add_typer(group, name="evaluate")


def _group() -> None:
    """Measure accuracy."""


def ladder(
    pairs: int = typer.Option(0, min=0, help="Pairs of captures; 0 for all of the split."),
    split: str = typer.Option("test", help="test, or tuning: the bodies that parameters were chosen on."),
    frames: int = typer.Option(30, min=1, max=300, help="Depth frames of each capture."),
    joints: str = typer.Option("tracked", help="tracked, true or both; true ones are labelled so."),
    methods: str = typer.Option("", help="Methods separated by commas; the whole ladder by default."),
    delta_m: float | None = typer.Option(
        None, "--delta-m", help="Half width of a voting band in metres. Default: 0.03 (docs/method.md)."
    ),
    seed: int = typer.Option(0, min=0, help="Seed of methods and bootstrap."),
    out: Path | None = typer.Option(None, "--out", help="JSON file to write as well."),
) -> None:
    """Print the accuracy ladder: every method on the same simulated pairs of visits."""
    from app.cli.simulated_cases import TEST_PAIRS, TUNING_PAIRS, Joints, SimulatedCases
    from core.evaluation import BASELINES, LADDER, run_ladder
    from core.relocation import DEFAULT_DELTA_M, RELOCATION_METHODS, RelocationOptions, write_json

    kinds: dict[str, tuple[Joints, ...]] = {
        "tracked": ("tracked",),
        "true": ("true",),
        "both": ("tracked", "true"),
    }
    if joints not in kinds:
        raise InputError(f"There are no '{joints}' joints.", f"Choose one of: {', '.join(kinds)}.")
    chosen = tuple(name.strip() for name in methods.split(",") if name.strip()) or LADDER
    known = {**RELOCATION_METHODS, **BASELINES}
    for name in chosen:
        if name not in known:
            raise InputError(f"There is no method '{name}'.", f"Choose from: {', '.join(known)}.")
    splits = {"test": TEST_PAIRS, "tuning": TUNING_PAIRS}
    if split not in splits:
        raise InputError(f"There is no split '{split}'.", f"Choose one of: {', '.join(splits)}.")
    if out is not None and not out.parent.is_dir():
        raise InputError(f"{out}: the folder does not exist.", "Create it or choose another.")
    options = RelocationOptions(delta_m=DEFAULT_DELTA_M if delta_m is None else delta_m)
    source = SimulatedCases(splits[split][: pairs or None], frames=frames, joints=kinds[joints])
    rows = run_ladder(source, methods=chosen, options=options, seed=seed, progress=_tell)
    typer.echo(ladder_table(rows))
    if out is not None:
        write_json(out, {"format": "geoderm-ladder/1", "rows": [row.flat() for row in rows]})


def _tell(fraction: float, message: str = "") -> None:
    sys.stderr.write(f"{message}\n")


def ladder_table(rows: Sequence[LadderRow]) -> str:
    """The ladder as text, errors in millimetres."""
    head = (
        "Joints   Group         Method             mean   95 % interval  median    P95  <10mm  >100mm"
        "  in radius  answered     hidden said"
    )
    lines = [head]
    for row in rows:
        s = row.summary
        radius = f"{100 * s.within_radius:8.0f} %" if s.within_radius == s.within_radius else "         -"
        interval = f"{s.mean_low_mm:.1f}-{s.mean_high_mm:.1f}"
        lines.append(
            f"{row.joints:8} {row.group:13} {row.method:16} {s.mean_mm:6.1f}  {interval:>14}"
            f" {s.median_mm:6.1f} {s.p95_mm:6.1f}  {100 * s.within_10mm:3.0f} %  {s.beyond_100mm:6d} {radius}"
            f"  {s.answered:4d} of {s.lesions:<4d} {s.hidden_said:3d} of {s.hidden}"
        )
    return "\n".join(lines)
