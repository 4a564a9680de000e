"""Figures 9 and 10 as pictures: how well the joints repeat over the captures of a stance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.anchors import JOINT_NAMES
from core.evaluation.thesis.canvas import GRADE_COLOR, METHOD_COLOR, new_figure, save, styled
from core.evaluation.thesis.statistics import JointSpread

FloatArray = NDArray[np.float64]

_BIN_MM = 5.0


def draw_histograms(
    spreads: Mapping[str, Sequence[JointSpread]], stance: str, captures: int, delta_m: float, path: Path
) -> Path:
    """Figure 9: fifteen histograms of e = d_i - mean d_i on one sheet, graded by the votes of fast marching.

    Parameters
    ----------
    spreads : mapping of "DM" and "FMM" to 15 rows
    captures : int
        How many captures the rows come from.
    """
    reach = _reach_mm(spreads)
    bins = np.arange(-reach, reach + 0.5 * _BIN_MM, _BIN_MM)
    with styled():
        figure = new_figure(11.0, 7.4)
        grid = figure.subplots(3, 5, sharex=True, sharey=True)
        for place, fmm, dm in zip(grid.ravel(), spreads["FMM"], spreads["DM"], strict=True):
            for row, style in ((fmm, "stepfilled"), (dm, "step")):
                label = "FMM" if row is fmm else "DM"
                if len(row.errors_m) == 0:
                    continue
                values = np.clip(1000.0 * row.errors_m, bins[0] + 0.01, bins[-1] - 0.01)
                place.hist(
                    values,
                    bins=bins.tolist(),
                    weights=np.full(len(values), 100.0 / len(values)),
                    histtype=style,
                    color=METHOD_COLOR[label],
                    alpha=0.55 if label == "FMM" else 1.0,
                    lw=1.2,
                    label=label,
                )
            place.axvspan(-1000 * delta_m, 1000 * delta_m, color="0.9", zorder=0, lw=0)
            place.set_title(
                f"{fmm.joint.replace('_', ' ')}: {fmm.grade}",
                color=GRADE_COLOR[fmm.grade],
                weight="bold",
                fontsize=8.5,
            )
            place.text(
                0.98, 0.95, _figures(fmm, dm), transform=place.transAxes, ha="right", va="top", fontsize=7
            )
        grid[0, 0].set_ylim(top=1.25 * grid[0, 0].get_ylim()[1])
        grid[0, 0].legend(loc="upper left", fontsize=7)
        figure.supxlabel(
            f"e = d - mean d (mm); grey: |e| below {1000 * delta_m:.0f} mm, where the joint votes rightly",
            fontsize=9,
        )
        figure.supylabel("share of captures and lesions (%)", fontsize=9)
        figure.suptitle(
            f"Distance from each joint to the clicked lesions over {captures} captures, stance {stance}"
        )
    return save(figure, path)


def _reach_mm(spreads: Mapping[str, Sequence[JointSpread]]) -> float:
    """Half width of the axis: nearly all errors, in whole bins; the rest is counted in the outermost bins."""
    errors = np.concatenate([s.errors_m for rows in spreads.values() for s in rows] or [np.zeros(1)])
    widest = 1000.0 * float(np.percentile(np.abs(errors), 98)) if len(errors) else 30.0
    return float(np.clip(_BIN_MM * np.ceil(widest / _BIN_MM), 30.0, 120.0))


def _figures(fmm: JointSpread, dm: JointSpread) -> str:
    if len(fmm.errors_m) == 0:
        return "not seen"
    lines = ["right votes", f"FMM {fmm.right:.0%}", f"DM {dm.right:.0%}"]
    if fmm.seen < 0.995:
        lines.append(f"(seen {fmm.seen:.0%})")
    return "\n".join(lines)


def draw_variances(matrices: Mapping[str, FloatArray], stance: str, captures: int, path: Path) -> Path:
    """Figure 10: variance of every joint-joint geodesic distance, Dijkstra and fast marching side by side."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FormatStrFormatter

    names = [name.replace("_", " ") for name in JOINT_NAMES]
    in_cm2 = {label: 1e4 * m for label, m in matrices.items()}
    finite = np.concatenate([m[np.isfinite(m) & (m > 0)] for m in in_cm2.values()])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.1, 1.0)
    norm = LogNorm(max(low, 1e-3), max(high, 2e-3))
    with styled():
        figure = new_figure(13.0, 6.6)
        panels = figure.subplots(1, 2, sharey=True)
        shown = None
        for place, (label, matrix) in zip(panels, in_cm2.items(), strict=True):
            shown = place.imshow(matrix, cmap="viridis", norm=norm)
            for i, j in np.argwhere(np.isfinite(matrix)):
                dark = norm(float(matrix[i, j])) < 0.6
                place.text(
                    j,
                    i,
                    _short(float(matrix[i, j])),
                    ha="center",
                    va="center",
                    fontsize=5.5,
                    color="white" if dark else "black",
                )
            place.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
            place.set_yticks(range(len(names)), names)
            mean = float(np.nanmean(matrix)) if np.isfinite(matrix).any() else float("nan")
            middle = float(np.nanmedian(matrix)) if np.isfinite(matrix).any() else float("nan")
            place.set_title(f"{label}: mean {mean:.1f} cm², median {middle:.1f} cm²")
            place.spines[:].set_visible(False)
        if shown is not None:
            figure.colorbar(
                shown, ax=list(panels), label="variance (cm²), logarithmic", shrink=0.85, format="%g"
            ).ax.yaxis.set_minor_formatter(FormatStrFormatter("%g"))
        figure.suptitle(
            f"Variance of the geodesic distance between joints over {captures} captures, stance {stance}"
        )
    return save(figure, path)


def _short(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
