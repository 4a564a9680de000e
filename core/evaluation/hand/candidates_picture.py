"""How a point is found: votes of the anchors, candidates on the skin, the answer (thesis figure 15)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.evaluation.hand.frames import HandSets
from core.evaluation.thesis.canvas import new_figure
from core.hand.anchors import AnchorFinder
from core.hand.fields import measure_fields
from core.hand.hand_model import HandModel
from core.hand.model import OWN_FIELDS
from core.hand.names import BONES, FINGER_OF, POINT_INDEX, spoken
from core.hand.sequential import BAND_M
from core.hand.surface import cut_hand
from core.hand.tracker import HandTracker, TrackingOptions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

CONFIGURATION, POINT = "open", "middle_pip"
_SKIN, _TRUE = "#d9d9d9", "black"


def candidates_figure(sets: HandSets, model: HandModel, finder: AnchorFinder) -> Figure | None:
    """Votes of one point in the first open hand of the test, and where all points were put."""
    frame = next((f for f in sets.test[0] if f.labels.configuration == CONFIGURATION), None)
    if frame is None or CONFIGURATION not in model.configurations:
        return None
    rig, depth_m = frame.capture.rig, frame.depth_m
    anchors = finder.find(frame.capture.color, depth_m, rig)
    if not anchors.seen:
        return None
    fields = measure_fields(cut_hand(depth_m, rig.depth, anchors.places_m), anchors.places_m)
    learned = model.configurations[CONFIGURATION]
    row = POINT_INDEX[POINT]
    expected, _ = learned.expected(np.zeros(len(learned.modes_m)))
    away = np.abs(fields.values_m[:-OWN_FIELDS] - expected[row, :-OWN_FIELDS, None])
    votes = (away < BAND_M + learned.anchor_sigma_m[row, :-OWN_FIELDS, None]).sum(axis=0)
    options = TrackingOptions(configuration=CONFIGURATION)
    answer = HandTracker(model, rig, finder, options).track(depth_m, frame.capture.color)
    vertices = fields.surface.vertices
    figure = new_figure(10.0, 3.6)
    histogram, voted, result = figure.subplots(1, 3, width_ratios=(0.8, 1, 1))
    counts = np.bincount(votes, minlength=len(away) + 1)
    bars = histogram.bar(np.arange(len(counts)), counts, color="#1f7a8c")
    histogram.bar_label(bars, fontsize=7)
    histogram.set_yscale("log")
    histogram.set_xlabel(f"votes (anchors within {1e3 * BAND_M:.0f} mm and the learned deviation)")
    histogram.set_ylabel("vertices")
    histogram.set_title(f"candidates of the {spoken(POINT)}", fontsize=9)
    order = np.argsort(votes, kind="stable")
    x, y = 1e3 * vertices[order, 0], -1e3 * vertices[order, 1]
    shown = voted.scatter(x, y, c=votes[order], s=3, cmap="viridis", vmin=0, vmax=len(away))
    figure.colorbar(shown, ax=voted, shrink=0.7, label="votes")
    _cross(voted, frame.points_m[row])
    _cross(voted, answer.points_m[row], "#d1362f", "o")
    voted.set_title("votes; true place (x) and answer (o)", fontsize=9)
    result.scatter(x, y, s=2, color=_SKIN)
    from core.evaluation.hand.pictures import FINGER_COLORS

    for a, b in BONES:
        ends = 1e3 * answer.points_m[[a, b]]
        result.plot(ends[:, 0], -ends[:, 1], color=FINGER_COLORS[FINGER_OF[a]], lw=1.8)
    for p, place in enumerate(answer.points_m):
        _cross(result, place, FINGER_COLORS[FINGER_OF[p]], "o")
        _cross(result, frame.points_m[p])
    _cross(result, answer.anchors_m, "#24323f", "s")
    result.set_title("all points, anchors (squares) and truth (x)", fontsize=9)
    for ax in (voted, result):
        ax.set_aspect("equal")
        ax.set_xlabel("mm")
    return figure


def _cross(ax: Axes, places_m: FloatArray, color: str = _TRUE, mark: str = "x") -> None:
    places = 1e3 * np.atleast_2d(places_m)
    ax.plot(places[:, 0], -places[:, 1], mark, color=color, ms=5, mfc="none" if mark == "s" else color)
