"""``geoderm run`` and ``geoderm demo``: the application itself, and its demonstration."""

from __future__ import annotations

from pathlib import Path

import typer


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("run")(run)
    app.command("demo")(demo)


def run(
    data: Path | None = typer.Option(
        None, "--data", help="Folder of the clinic's records. Default: the user's data folder."
    ),
) -> None:
    """Open the application."""
    from app.gui import run_gui

    raise typer.Exit(run_gui(data))


def demo(
    unattended: bool = typer.Option(
        False, "--unattended", help="Drive the windows through a first visit and a follow-up, then leave."
    ),
    out: Path = typer.Option(
        Path("demo-output"), "--out", help="Folder for pictures, report and error table (unattended)."
    ),
    data: Path | None = typer.Option(
        None, "--data", help="Folder of the demonstration clinic. Default: a temporary one."
    ),
    guide: Path | None = typer.Option(
        None, "--guide", help="Also write the pictures of the user guide here (unattended)."
    ),
    moles: int = typer.Option(8, "--moles", min=1, max=40, help="Lesions marked in the first visit."),
) -> None:
    """Show GeoDerm on a simulated patient. The joints come from the skeleton tracker."""
    if unattended:
        from app.demo.unattended import run_unattended

        raise typer.Exit(run_unattended(out, guide=guide, lesions=moles, data=data))
    from app.demo.attended import run_attended

    raise typer.Exit(run_attended(data))
