"""The decision tree of a hand's configurations as a picture (thesis figure 14)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.errors import InputError
from core.evaluation.thesis.canvas import new_figure, quiet, styled
from core.hand.documents import write_file
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.tree import ConfigurationTree

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg")

_DEEPEST = 4
_COLORS = ("#1f77b4", "#d95f02", "#1b7837", "#7b3294", "#b8860b", "#c51b7d", "#4d4d4d", "#2c7fb8")
_LEAF_IN, _LEVEL_IN = 1.75, 1.15
_WIDEST_IN, _HIGHEST_IN = 120.0, 40.0


def question(tree: ConfigurationTree, node: int) -> str:
    """What is asked at a node, for people; "yes" goes left."""
    first, second = (POINT_NAMES[p] for p in PAIRS[tree.feature[node]])
    threshold_m = float(tree.threshold_m[node])
    if not np.isfinite(threshold_m):
        return f"{first} - {second}\nmeasured?"
    return f"{first} - {second}\n≤ {1000 * threshold_m:.0f} mm?"


def tree_figure(tree: ConfigurationTree) -> Figure:
    """The tree from its root down: questions with thresholds, leaves with configuration and training frames.

    Below the fifth level only what lies there most is told.
    """
    places = {placed.node: placed for placed in _placed(tree)}
    across = 1.0 + max(placed.x for placed in places.values())
    down = 1 + max(placed.level for placed in places.values())
    size = min(_LEAF_IN * max(across, 2.0), _WIDEST_IN), min(_LEVEL_IN * down + 0.3, _HIGHEST_IN)
    with styled():
        figure = new_figure(*size)
        axes = figure.add_subplot()
        quiet(axes)
        axes.set_xlim(-0.6, across - 0.4)
        axes.set_ylim(-(down - 1) - 0.5, 0.5)
        for placed in places.values():
            _draw(axes, tree, placed, places)
    return figure


def write_tree_picture(path: Path, tree: ConfigurationTree, dpi: int = 110) -> None:
    """Write the picture as PNG or SVG, by the file's ending, whole or not at all.

    Raises
    ------
    InputError
        If the ending is another.
    WorkError
        If it cannot be written.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a tree is drawn as {' or '.join(SUFFIXES)}.")
    content = io.BytesIO()
    with styled():
        tree_figure(tree).savefig(content, format=path.suffix.lower()[1:], dpi=dpi, facecolor="white")
    write_file(path, content.getvalue())


@dataclass(frozen=True)
class _Placed:
    """A node that is drawn: leaves stand side by side, a question over the middle of its answers."""

    node: int
    x: float
    level: int
    cut: bool


def _placed(tree: ConfigurationTree) -> Iterator[_Placed]:
    """Nodes from the leaves up; children before their parent."""
    x_of: dict[int, float] = {}
    leaves = 0
    waiting = [(0, 0, False)]
    while waiting:
        node, level, answered = waiting.pop()
        inner = tree.left[node] >= 0
        if inner and level < _DEEPEST and not answered:
            waiting += [
                (node, level, True),
                (int(tree.right[node]), level + 1, False),
                (int(tree.left[node]), level + 1, False),
            ]
            continue
        if answered:
            x_of[node] = 0.5 * (x_of[int(tree.left[node])] + x_of[int(tree.right[node])])
        else:
            x_of[node] = float(leaves)
            leaves += 1
        yield _Placed(node, x_of[node], level, bool(inner and not answered))


def _draw(axes: Axes, tree: ConfigurationTree, placed: _Placed, places: dict[int, _Placed]) -> None:
    node, x, y = placed.node, placed.x, -placed.level
    best = int(np.argmax(tree.share[node]))
    color = _COLORS[best % len(_COLORS)]
    if tree.left[node] >= 0 and not placed.cut:
        for child, word in ((int(tree.left[node]), "yes"), (int(tree.right[node]), "no")):
            end = places[child]
            axes.plot([x, end.x], [y, -end.level], color="#9a9a9a", lw=1.0, zorder=1)
            axes.text(
                0.5 * (x + end.x),
                y - 0.5,
                word,
                ha="center",
                va="center",
                fontsize=8,
                color="#555555",
                bbox={"boxstyle": "round,pad=0.1", "fc": "white", "ec": "none"},
                zorder=2,
            )
        text, face, edge, ink = question(tree, node), "white", "#555555", "#222222"
    else:
        frames = int(tree.frames[node])
        more = "mostly " if placed.cut or tree.share[node, best] < 1.0 else ""
        text = f"{more}{tree.classes[best]}\n{frames} frame{'s'[: frames != 1]}"
        face, edge, ink = color, color, "white"
    axes.text(
        x,
        y,
        text,
        ha="center",
        va="center",
        fontsize=8,
        color=ink,
        zorder=3,
        bbox={"boxstyle": "round,pad=0.35", "fc": face, "ec": edge},
    )
