"""Which board this workstation has and what was measured on it, kept beside the calibrations."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from core.calibration.board import BoardSpec

_FILE = Path("board") / "board.json"
TOLERANCE = 0.04
"""A print that differs by more from its nominal size was scaled by mistake."""


@dataclass(frozen=True)
class BoardChoice:
    """A printed board.

    Attributes
    ----------
    paper : str
        A4 or A3.
    width_m : float or None
        Measured width of all its squares; None if it was not measured yet.
    """

    paper: str = "A3"
    width_m: float | None = None

    @property
    def spec(self) -> BoardSpec:
        """The board as measured."""
        from core.calibration.board import BoardSpec

        nominal = BoardSpec.for_paper(self.paper)
        if self.width_m is None:
            return nominal
        return nominal.with_square(self.width_m / nominal.squares_x)

    @property
    def nominal_width_m(self) -> float:
        """Width of all squares if the printer keeps the scale exactly."""
        from core.calibration.board import BoardSpec

        return BoardSpec.for_paper(self.paper).size_m[0]


def read_width(text: str, nominal_m: float) -> float | str:
    """The width in metres that was typed in millimetres, or what is wrong with it."""
    try:
        millimetres = float(text.strip().replace(",", "."))
    except ValueError:
        return "Write the width in millimetres, for example " + f"{1000 * nominal_m:.1f}."
    if abs(millimetres / (1000 * nominal_m) - 1) > TOLERANCE:
        return (
            f"This board should be about {1000 * nominal_m:.0f} mm wide. Print it at 100 %, "
            "without fitting it to the page, and measure again."
        )
    return millimetres / 1000


def load_choice(folder: Path) -> BoardChoice:
    """The board used last on this workstation; the A3 board if none was."""
    try:
        stored = json.loads((folder / _FILE).read_text(encoding="utf-8"))
        paper, width = stored["paper"], stored["width_m"]
    except (OSError, ValueError, KeyError, TypeError):
        return BoardChoice()
    if paper not in ("A3", "A4"):
        return BoardChoice()
    nominal = BoardChoice(paper)
    if isinstance(width, float) and abs(width / nominal.nominal_width_m - 1) <= TOLERANCE:
        return BoardChoice(paper, width)
    return nominal


def store_choice(folder: Path, choice: BoardChoice) -> None:
    """Remember the board."""
    path = folder / _FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps({"paper": choice.paper, "width_m": choice.width_m}), encoding="utf-8")
    partial.replace(path)
