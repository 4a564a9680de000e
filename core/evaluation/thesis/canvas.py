"""What all pictures share: colours of the methods, fonts, and writing a figure whole or not at all."""

from __future__ import annotations

import io
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from core.errors import WorkError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METHOD_COLOR: Final[dict[str, str]] = {"DM": "#d62728", "FMM": "#2ca02c"}
"""The thesis draws Dijkstra red and fast marching green."""

OTHER_COLORS: Final = ("#1f77b4", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f")

METHOD_WORD: Final[dict[str, str]] = {
    "voting-dijkstra": "DM (Dijkstra, voting)",
    "voting-fmm": "FMM (fast marching, voting)",
}

GRADE_COLOR: Final[dict[str, str]] = {"good": "#1b7837", "reasonable": "#b8860b", "bad": "#b2182b"}

_STYLE: Final[dict[Any, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def styled() -> AbstractContextManager[None]:
    """Context in which figures and axes take the pictures' style."""
    import matplotlib

    return matplotlib.rc_context(_STYLE)


def color_of(method: str) -> str:
    """Colour of a method's label or registry name, the same in every picture."""
    short = {"voting-dijkstra": "DM", "voting-fmm": "FMM"}.get(method, method)
    if short in METHOD_COLOR:
        return METHOD_COLOR[short]
    known = ("trilateration", "registration", "fused", "virtual source")
    return OTHER_COLORS[known.index(method) if method in known else len(OTHER_COLORS) - 1]


def word_of(method: str) -> str:
    """A method's name in a legend."""
    return METHOD_WORD.get(method, method)


def quiet(axes: Axes) -> None:
    """Leave out ticks and frame: the axes hold a picture."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)


def save(figure: Figure, path: Path, dpi: int = 110) -> Path:
    """Write a PNG of at most 256 colours, whole or not at all."""
    from PIL import Image

    full = io.BytesIO()
    figure.savefig(full, format="png", dpi=dpi, facecolor="white")
    partial = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.open(full).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
            partial, format="PNG", optimize=True
        )
        partial.replace(path)
    except OSError as error:
        raise WorkError(f"{path}: cannot be written ({error.strerror or error}).") from error
    return path
