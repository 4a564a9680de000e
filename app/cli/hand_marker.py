"""``geoderm hand marker``: a marker to print."""

from __future__ import annotations

from pathlib import Path

import typer


def register(group: typer.Typer) -> None:
    """Add the command to the group ``geoderm hand``."""
    group.command("marker")(marker)


def marker(
    out: Path = typer.Argument(help="PDF file, A4."),
    marker_m: float = typer.Option(0.036, "--marker-m", help="Side of the black square in metres."),
    dictionary: str = typer.Option("DICT_4X4_50", "--dictionary", help="ArUco dictionary."),
    number: int = typer.Option(0, "--number", min=0, help="Which marker of the dictionary."),
) -> None:
    """Write a marker to be printed and stuck on the back of the hand, with a ruler to check its size."""
    import cv2

    from core.errors import InputError
    from core.exchange.marker_sheet import MOST_SIDE_M, marker_sheet
    from core.hand.documents import write_file
    from core.hand.model_file import check_marker

    check_marker(marker_m, dictionary)
    if marker_m > MOST_SIDE_M:
        raise InputError(f"A marker of {1000 * marker_m:g} mm does not fit on A4.", "Choose at most 0.15 m.")
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    if number >= len(known.bytesList):
        raise InputError(f"{dictionary} has markers 0 to {len(known.bytesList) - 1}, not {number}.")
    write_file(out, marker_sheet(dictionary, number, marker_m))
    typer.echo(f"{out}: marker {number} of {dictionary}, {1000 * marker_m:g} mm. Print it at 100 %.")
