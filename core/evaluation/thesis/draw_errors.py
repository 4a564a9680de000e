"""Figure 11, the ranking of stances, and error against time, as pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from core.evaluation.thesis.canvas import color_of, new_figure, save, styled, word_of
from core.evaluation.thesis.statistics import ErrorSeries

StanceErrors = Mapping[str, Sequence[ErrorSeries]]
"""By stance, one series per method, the thesis's two first."""


def draw_error_per_image(errors: StanceErrors, path: Path) -> Path:
    """Figure 11: Euclidean error of every capture, mean over the lesions, fast marching against Dijkstra."""
    from matplotlib.ticker import MaxNLocator

    with styled():
        figure = new_figure(10.0, 1.0 + 2.7 * len(errors))
        rows = figure.subplots(len(errors), 1, squeeze=False, sharey=True)[:, 0]
        for axes, (stance, series) in zip(rows, errors.items(), strict=True):
            for s in series[:2]:
                number = np.arange(2, len(s.captures) + 2)
                color = color_of(s.method)
                axes.plot(
                    number,
                    1000 * s.per_capture_m,
                    "o-",
                    color=color,
                    ms=3.5,
                    lw=1.3,
                    label=f"{word_of(s.method)}, mean {1000 * s.mean_m:.1f} mm",
                )
                axes.axhline(1000 * s.mean_m, color=color, lw=0.9, ls="--")
            lesions = series[0].errors_m.shape[1] if series else 0
            axes.set_title(
                f"Stance {stance}, {lesions} lesions clicked in capture 1: their mean error", loc="left"
            )
            axes.set_ylabel("error (mm)")
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.grid(axis="y", color="0.9")
            axes.legend(loc="upper right", ncols=2, fontsize=8)
        rows[-1].set_xlabel("capture (dashed: mean over all answers)")
        rows[0].set_ylim(0, 1.2 * rows[0].get_ylim()[1])
        figure.suptitle("Euclidean error per image against the re-clicked truth")
    return save(figure, path)


def draw_stances(errors: StanceErrors, order: Sequence[str], path: Path) -> Path:
    """Stances ranked by error, the best at the top, with 95 % intervals."""
    count = max(len(series) for series in errors.values())
    height = 0.8 / count
    with styled():
        figure = new_figure(8.6, 1.3 + 0.28 * count * len(order) + 0.3 * len(order))
        axes = figure.subplots()
        for row, stance in enumerate(order):
            for k, s in enumerate(errors[stance]):
                if not np.isfinite(s.mean_m):
                    continue
                y = row + (k - (count - 1) / 2) * height
                spread = [[1000 * (s.mean_m - s.low_m)], [1000 * (s.high_m - s.mean_m)]]
                axes.barh(
                    y,
                    1000 * s.mean_m,
                    height * 0.9,
                    color=color_of(s.method),
                    alpha=0.75,
                    label=word_of(s.method) if row == 0 else None,
                )
                axes.errorbar(1000 * s.mean_m, y, xerr=spread, color="0.2", capsize=2, lw=1)
                axes.annotate(
                    f"{1000 * s.mean_m:.1f}",
                    (1000 * s.high_m, y),
                    xytext=(5, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=8,
                )
        axes.set_yticks(range(len(order)), list(order))
        axes.invert_yaxis()
        axes.set_xlabel("mean error (mm), 95 % interval over captures")
        axes.set_title("Stances ranked by the error of the better of DM and FMM", loc="left")
        axes.margins(x=0.12)
        figure.legend(loc="outside lower center", ncols=count, fontsize=8)
    return save(figure, path)


def draw_error_against_time(errors: StanceErrors, path: Path) -> Path:
    """Mean error against CPU time of one relocation, a point per method and stance."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    markers = "osD^vP*X"
    with styled():
        figure = new_figure(8.2, 4.8)
        axes = figure.subplots()
        named: set[str] = set()
        for k, (stance, series) in enumerate(errors.items()):
            for s in series:
                if not (np.isfinite(s.mean_m) and np.isfinite(s.cpu_s)):
                    continue
                axes.errorbar(
                    s.cpu_s,
                    1000 * s.mean_m,
                    yerr=[[1000 * (s.mean_m - s.low_m)], [1000 * (s.high_m - s.mean_m)]],
                    fmt=markers[k % len(markers)],
                    color=color_of(s.method),
                    ms=8,
                    capsize=2,
                    lw=1,
                    label=word_of(s.method) if s.method not in named else None,
                )
                named.add(s.method)
            axes.plot([], [], markers[k % len(markers)], color="0.5", label=f"stance {stance}")
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_ylim(bottom=0)
        axes.grid(color="0.92")
        axes.set_xlabel("CPU time of one relocation, all lesions (s, logarithmic)")
        axes.set_ylabel("mean error (mm), 95 % interval")
        axes.set_title("Error against time", loc="left")
        figure.legend(loc="outside right upper", fontsize=8)
    return save(figure, path)
