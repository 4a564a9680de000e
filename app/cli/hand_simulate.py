"""``geoderm hand simulate``: simulated hands as datasets and sequences."""

from __future__ import annotations

import typer


def register(group: typer.Typer) -> None:
    """Add the commands to ``geoderm hand``."""
