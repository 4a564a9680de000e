"""Pictures of a ladder: error against time, errors in full, stances ranked, coverage of stated radii."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.errors import WorkError
from core.evaluation.cases import OTHER, SAME
from core.evaluation.parts import PARTS
from core.evaluation.records import FLOOR, Record, Rung
from core.evaluation.summaries import scored
from core.evaluation.tables import LadderRow, detailed_rungs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from core.evaluation.report import LadderReport

_INK, _FAINT = "#24323f", "#d5dde3"
_COLORS = {SAME: "#1f7a8c", OTHER: "#d1603d"}
_MARKS = {SAME: "o", OTHER: "s"}
_LINES = (
    "#1f7a8c",
    "#d1603d",
    "#6a4c93",
    "#5b8c3a",
    "#c9a227",
    "#3b5b92",
    "#9a3b5b",
    "#7c7c7c",
    "#2ca6a4",
    "#b5651d",
)
_DPI = 120
_LEAST_LESIONS = 5


def draw_plots(
    report: LadderReport, records: Sequence[Record], rungs: Sequence[Rung], method: str, folder: Path
) -> list[str]:
    """Write the pictures and return their file names; those with nothing to show are left out.

    Raises
    ------
    WorkError
        If they cannot be written.
    """
    details = detailed_rungs(rungs, method)
    if not details:
        return []
    shown = [rung for rung in rungs if (rung.joints, rung.frames) == (details[0].joints, details[0].frames)]
    chosen = details[-1]
    rows = [row for row in report.rows if row.rung in shown]
    drawn = {
        "error_against_time.png": _error_against_time(rows),
        "errors.png": _cumulative([r for r in records if r.rung in shown], shown),
        "stances.png": _stances(report, chosen),
        "coverage.png": _coverage(report, chosen),
    }
    names = []
    for name, figure in drawn.items():
        if figure is None:
            continue
        try:
            figure.savefig(folder / name, dpi=_DPI)
        except OSError as error:
            raise WorkError(f"{folder / name}: cannot be written ({error.strerror or error}).") from error
        names.append(name)
    return names


def _figure(width: float, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure of its own, independent of any window."""
    from matplotlib.figure import Figure as NewFigure

    figure = NewFigure(figsize=(width, height), layout="constrained", facecolor="white")
    axes = [figure.add_subplot(1, columns, k + 1) for k in range(columns)]
    for ax in axes:
        ax.grid(True, color=_FAINT, linewidth=0.7)
        ax.set_axisbelow(True)
        ax.tick_params(colors=_INK, labelsize=9)
        for side, spine in ax.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color(_INK)
    return figure, axes


def _error_against_time(rows: Sequence[LadderRow]) -> Figure | None:
    """Mean error with its interval against the time of one relocation."""
    own = [row for row in rows if row.rung.method != FLOOR and row.summary.mean_mm.value > 0]
    if not own:
        return None
    figure, axes = _figure(11.0, 5.0, 2)
    for ax, group in zip(axes, (SAME, OTHER), strict=True):
        some = [row for row in own if row.group == group]
        for k, row in enumerate(some):
            s = row.summary.mean_mm
            spread = [[max(0.0, s.value - s.low)], [max(0.0, s.high - s.value)]]
            ax.errorbar(
                row.seconds,
                s.value,
                yerr=spread,
                fmt=_MARKS[group],
                color=_LINES[k % len(_LINES)],
                markersize=8,
                capsize=3,
                label=row.rung.label,
            )
        floors = [r for r in rows if r.rung.method == FLOOR and r.group == group]
        for row in floors:
            ax.axhline(
                row.summary.mean_mm.value, color=_INK, linewidth=1, linestyle=":", label="sensor floor"
            )
        ax.set_yscale("log")
        ax.set_xscale("log")
        _plain_ticks(ax)
        ax.set_title(group, loc="left", color=_INK, fontsize=11)
        ax.set_xlabel("time of one relocation, s", color=_INK)
        ax.set_ylabel("mean error, mm", color=_INK)
    handles = max((ax.get_legend_handles_labels() for ax in axes), key=lambda pair: len(pair[0]))
    figure.legend(*handles, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    figure.suptitle(f"Error against time: {own[0].rung.conditions}", color=_INK, fontsize=12)
    return figure


def _plain_ticks(ax: Axes) -> None:
    """Numbers as people write them on logarithmic axes, also between the powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axis.set_minor_formatter(FuncFormatter(lambda x, _: ""))


def _cumulative(records: Sequence[Record], rungs: Sequence[Rung]) -> Figure | None:
    """Share of lesions answered within each error: unanswered ones keep a line below 100 %."""
    figure, axes = _figure(11.0, 5.0, 2)
    any_line = False
    for ax, group in zip(axes, (SAME, OTHER), strict=True):
        for k, rung in enumerate(rungs):
            own = scored([r for r in records if r.rung == rung and r.name.group == group])
            seen = [s for _, s in own if s.visible]
            errors = np.sort([1000.0 * s.error_m for s in seen if s.error_m is not None])
            if not len(errors):
                continue
            any_line = True
            floor = rung.method == FLOOR
            ax.step(
                errors,
                100.0 * np.arange(1, len(errors) + 1) / len(seen),
                where="post",
                label=rung.label,
                color=_INK if floor else _LINES[(k - 1) % len(_LINES)],
                linestyle=":" if floor else "-",
                linewidth=1.8,
            )
        ax.axvline(10.0, color=_FAINT, linewidth=2)
        ax.set_xscale("log")
        _plain_ticks_x(ax)
        ax.set_xlim(0.5, 300.0)
        ax.set_ylim(0.0, 101.0)
        ax.set_title(group, loc="left", color=_INK, fontsize=11)
        ax.set_xlabel("error, mm", color=_INK)
        ax.set_ylabel("visible lesions found within it, %", color=_INK)
    if not any_line:
        return None
    handles = max((ax.get_legend_handles_labels() for ax in axes), key=lambda pair: len(pair[0]))
    figure.legend(*handles, loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    return figure


def _plain_ticks_x(ax: Axes) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ax.xaxis.set_major_locator(FixedLocator([1, 2, 5, 10, 20, 50, 100, 200]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))


def _stances(report: LadderReport, rung: Rung) -> Figure | None:
    """Mean error and P95 of every pair of stances, the easiest on top."""
    rows = [r for r in report.stances if r.rung == rung and r.summary.mean_mm.value >= 0]
    if not rows:
        return None
    figure, (ax,) = _figure(8.0, 1.2 + 0.34 * len(rows))
    for k, row in enumerate(rows):
        first, _, second = row.stances.partition(" to ")
        color = _COLORS[SAME if first == second else OTHER]
        ax.barh(k, row.summary.mean_mm.value, color=color, height=0.62)
        ax.plot(row.summary.p95_mm.value, k, marker="|", color=_INK, markersize=11, markeredgewidth=2)
    ax.set_yticks(range(len(rows)), [f"{row.stances} ({row.summary.lesions})" for row in rows])
    ax.invert_yaxis()
    ax.set_xlabel("mean error, mm (bar); P95 (stroke); lesions in brackets", color=_INK)
    ax.set_title(f"Stances ranked: {rung.label}, {rung.conditions}", loc="left", color=_INK, fontsize=11)
    return figure


def _coverage(report: LadderReport, rung: Rung) -> Figure | None:
    """Share of true places within the stated 95 % radius, by stance class and body part."""
    rows = [
        r
        for r in report.parts
        if r.rung == rung and r.summary.in_radius.value >= 0 and r.summary.lesions >= _LEAST_LESIONS
    ]
    if not rows:
        return None
    parts = list(dict.fromkeys(r.part for r in sorted(rows, key=lambda r: (*PARTS, "all").index(r.part))))
    figure, (ax,) = _figure(10.0, 4.8)
    ax.axhspan(93.0, 97.0, color="#cfe8d5", zorder=0)
    for k, group in enumerate((SAME, OTHER)):
        some = {r.part: r.summary for r in rows if r.group == group}
        shares = {part: s.in_radius for part, s in some.items()}
        if not shares:
            continue
        values = 100.0 * np.array([s.value for s in shares.values()])
        low = 100.0 * np.array([s.low for s in shares.values()])
        high = 100.0 * np.array([s.high for s in shares.values()])
        ax.errorbar(
            [parts.index(part) + 0.24 * (k - 0.5) for part in shares],
            values,
            yerr=[np.maximum(0.0, values - low), np.maximum(0.0, high - values)],
            fmt=_MARKS[group],
            color=_COLORS[group],
            capsize=3,
            label=group,
        )
    labels = []
    for part in parts:
        own = [next((r.summary for r in rows if (r.part, r.group) == (part, g)), None) for g in (SAME, OTHER)]
        radii = " | ".join("-" if s is None else f"{s.radius_mm:.0f} mm" for s in own)
        counts = " | ".join("-" if s is None else f"{s.lesions}" for s in own)
        labels.append(f"{part}\n{radii}\n{counts}")
    ax.set_xticks(range(len(parts)), labels)
    ax.set_xlim(-0.6, len(parts) - 0.4)
    ax.set_xlabel(f"median radius and lesions, {SAME} | {OTHER}; parts with 5 lesions or more", color=_INK)
    ax.set_ylabel("within the stated 95 % radius, %", color=_INK)
    ax.set_title(f"Coverage: {rung.label}, {rung.conditions}", loc="left", color=_INK, fontsize=11)
    ax.legend(fontsize=9, frameon=False, loc="lower left")
    return figure
