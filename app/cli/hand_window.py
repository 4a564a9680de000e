"""``geoderm hand window``: the hand application's window."""

from __future__ import annotations

from pathlib import Path

import typer


def register(group: typer.Typer) -> None:
    """Add the command to the group ``geoderm hand``."""
    group.command("window")(window)


def window(
    source: str | None = typer.Argument(
        None, metavar="[SOURCE]", help="Folder of capture folders, .oni file, or id of a live camera."
    ),
    model: Path | None = typer.Option(None, "--model", help="Model made by geoderm hand train."),
) -> None:
    """Watch, train and export the joints of a hand."""
    from app.windows.hand.run import run_hand_window

    raise typer.Exit(run_hand_window(source, model))
