"""``geoderm hand window``: the hand application's window."""

from __future__ import annotations

import typer


def register(group: typer.Typer) -> None:
    """Add the commands to ``geoderm hand``."""
