"""The thesis's experiments, one after the other, on the captures they are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from core.anchors import JOINT_NAMES, SkeletonTracker
from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.evaluation.thesis.clicks import Clicks
from core.evaluation.thesis.draw_errors import draw_error_against_time, draw_error_per_image, draw_stances
from core.evaluation.thesis.draw_paths import draw_body, draw_planes
from core.evaluation.thesis.draw_spread import draw_histograms, draw_variances
from core.evaluation.thesis.frames import analyse_frame
from core.evaluation.thesis.measure import KINDS, VOTING, Protocol, measure_stance
from core.evaluation.thesis.records import CaptureRecord
from core.evaluation.thesis.sequences import StanceSequence, read_clicked
from core.evaluation.thesis.shortest_paths import PathScene, body_paths, synthetic_plane, wall_plane
from core.evaluation.thesis.statistics import ErrorSeries, error_series, joint_spreads, variance_matrix
from core.evaluation.thesis.timing import time_methods
from core.progress import Progress, ScaledProgress, no_progress

FIGURES: Final = ("8", "9", "10", "11", "table2", "cpu", "stances", "time")
"""What can be asked for; "stances" and "time" are the ranking and error against time."""

NEED_CLICKS: Final = frozenset({"9", "11", "table2", "stances", "time"})
NEED_STANCES: Final = NEED_CLICKS | {"10"}

THESIS_TABLE_2_M: Final[dict[str, tuple[float, float]]] = {"DM": (0.023, 0.036), "FMM": (0.019, 0.031)}
"""Mean errors the thesis reports for its pose 1 and pose 2: one person, 30 pairs of images."""


@dataclass(frozen=True, eq=False)
class Wall:
    """A depth capture of a wall and how to call it in pictures."""

    capture: RgbdCapture
    label: str


@dataclass(eq=False)
class ThesisResults:
    """Everything that was measured, ready for JSON, and the pictures that were written.

    Attributes
    ----------
    numbers : dict
        What results.json holds.
    pictures : dict of str to Path
        By a title.
    notes : list of str
        What was left out, and why.
    """

    numbers: dict[str, Any] = field(default_factory=dict)
    pictures: dict[str, Path] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def run_thesis(
    sequences: Sequence[StanceSequence],
    tracker: SkeletonTracker,
    wall: Wall | None,
    out: Path,
    *,
    figures: Sequence[str] | None = None,
    protocol: Protocol | None = None,
    cpu_rounds: int = 9,
    progress: Progress = no_progress,
) -> ThesisResults:
    """Run experiments and write their pictures into ``out``.

    Parameters
    ----------
    sequences : sequence of StanceSequence
        Stances; the first two are the poses of table 2.
    wall : Wall or None
        For figure 8 (b).
    figures : sequence of str, optional
        Names of `FIGURES`; all that the captures allow when not given.

    cpu_rounds : int
        How often every method is timed.

    Raises
    ------
    InputError
        For a figure that the captures cannot give although it was asked for.
    Cancelled
        Through ``progress``; pictures and records of what was finished stay.
    """
    protocol = protocol or Protocol()
    wanted = list(FIGURES if figures is None else figures)
    results = ThesisResults()
    first = read_clicked(sequences[0].folders[0]).clicks if sequences else Clicks()
    _drop_impossible(wanted, sequences, first, results, asked=figures is not None)
    results.numbers.update(
        {
            "format": "geoderm-thesis/1",
            "source": "simulated" if first.simulated else "recorded",
            "stances": {s.name: len(s.folders) for s in sequences},
            "protocol": {**asdict(protocol), "methods": list(protocol.methods)},
        }
    )
    if "8" in wanted:
        _figure_8(sequences, tracker, wall, out, protocol, results)
    if "cpu" in wanted:
        _cpu(results, cpu_rounds, ScaledProgress(progress, 0.02, 0.06))
    if NEED_STANCES & set(wanted):
        part = 0.92 / len(sequences)
        records = {
            s.name: measure_stance(
                s,
                tracker,
                protocol,
                keep=out / "records",
                progress=ScaledProgress(progress, 0.06 + k * part, 0.06 + (k + 1) * part),
            )
            for k, s in enumerate(sequences)
        }
        _stance_figures(records, wanted, protocol, out, results)
    progress(1.0, "Done")
    return results


def _drop_impossible(
    wanted: list[str],
    sequences: Sequence[StanceSequence],
    clicks: Clicks,
    results: ThesisResults,
    *,
    asked: bool,
) -> None:
    lacking: dict[str, str] = {}
    if not sequences:
        lacking = dict.fromkeys((*NEED_STANCES, "8"), "it needs captures")
    elif not clicks.lesions:
        place = sequences[0].folders[0] / "clicks.json"
        lacking = dict.fromkeys(NEED_CLICKS, f"it needs lesions clicked in {place}")
    for name in [n for n in wanted if n in lacking]:
        if asked:
            raise InputError(f"Figure {name} cannot be made: {lacking[name]}.")
        results.notes.append(f"{name} was left out: {lacking[name]}.")
        wanted.remove(name)


def _figure_8(
    sequences: Sequence[StanceSequence],
    tracker: SkeletonTracker,
    wall: Wall | None,
    out: Path,
    protocol: Protocol,
    results: ThesisResults,
) -> None:
    clicked = read_clicked(sequences[0].folders[0])
    body = body_paths(analyse_frame(clicked, tracker, protocol.surface))
    label = f"stance {sequences[0].name}, one {protocol.surface} depth frame"
    results.pictures["Figure 8 (c): shortest paths on a body"] = draw_body(
        body, label, out / "figure-08-body.png"
    )
    scenes = {"body": body}
    if wall is not None:
        scenes |= {"synthetic plane": synthetic_plane(), "Kinect plane": wall_plane(wall.capture)}
        results.pictures["Figure 8 (a, b): shortest paths on planes"] = draw_planes(
            scenes["synthetic plane"], scenes["Kinect plane"], wall.label, out / "figure-08-planes.png"
        )
    results.numbers["figure_8"] = {
        "wall": None if wall is None else wall.label,
        "paths": [row for name, scene in scenes.items() for row in _path_rows(name, scene)],
    }


def _path_rows(name: str, scene: PathScene) -> list[dict[str, Any]]:
    rows = []
    for pair in scene.paths:
        row: dict[str, Any] = {"surface": name, "path": pair.name}
        row |= {f"{label}_m": length for label, length in pair.lengths_m.items()}
        if name != "body":
            row["straight_m"] = pair.straight_m
            row |= {f"{k}_longer": v / pair.straight_m - 1.0 for k, v in pair.lengths_m.items()}
        rows.append(row)
    return rows


def _cpu(results: ThesisResults, rounds: int, progress: Progress) -> None:
    count, times = time_methods(rounds=rounds, progress=progress)
    results.numbers["cpu"] = {"points": count, "methods": [asdict(t) for t in times]}


def _stance_figures(
    records: Mapping[str, list[CaptureRecord]],
    wanted: Sequence[str],
    protocol: Protocol,
    out: Path,
    results: ThesisResults,
) -> None:
    for stance, rows in records.items():
        for record in rows:
            if record.unusable:
                results.notes.append(f"{stance}, capture {record.name} was left out: {record.unusable}")
    usable = {stance: [r for r in rows if not r.unusable] for stance, rows in records.items()}
    if "9" in wanted:
        _figure_9(usable, protocol, out, results)
    if "10" in wanted:
        _figure_10(usable, out, results)
    if {"11", "table2", "stances", "time"} & set(wanted):
        _errors(usable, wanted, protocol, out, results)


def _figure_9(
    records: Mapping[str, list[CaptureRecord]], protocol: Protocol, out: Path, results: ThesisResults
) -> None:
    numbers = results.numbers.setdefault("figure_9", {})
    delta = protocol.options.delta_m
    for stance, rows in records.items():
        spreads = {label: joint_spreads(rows, label, delta) for label in KINDS}
        if not spreads["FMM"]:
            continue
        path = out / f"figure-09-{stance}.png"
        results.pictures[f"Figure 9: repeatability of the joints, stance {stance}"] = draw_histograms(
            spreads, stance, len(rows), delta, path
        )
        numbers[stance] = {
            label: {
                s.joint: {
                    "grade": s.grade,
                    "right": s.right,
                    "p95_m": s.p95_m,
                    "std_m": float(s.errors_m.std()) if len(s.errors_m) else float("nan"),
                    "seen": s.seen,
                    "errors_m": s.errors_m.tolist(),
                }
                for s in spreads[label]
            }
            for label in KINDS
        }


def _figure_10(records: Mapping[str, list[CaptureRecord]], out: Path, results: ThesisResults) -> None:
    numbers = results.numbers.setdefault("figure_10", {"joints": list(JOINT_NAMES)})
    for stance, rows in records.items():
        matrices = {label: variance_matrix(rows, label) for label in KINDS}
        path = out / f"figure-10-{stance}.png"
        results.pictures[f"Figure 10: variance of joint-joint distances, stance {stance}"] = draw_variances(
            matrices, stance, len(rows), path
        )
        numbers[stance] = {
            label: {
                "variance_m2": m.tolist(),
                "mean_m2": float(np.nanmean(m)) if np.isfinite(m).any() else float("nan"),
                "median_m2": float(np.nanmedian(m)) if np.isfinite(m).any() else float("nan"),
                "pairs": int(np.isfinite(m).sum() // 2),
            }
            for label, m in matrices.items()
        }


def _errors(
    records: Mapping[str, list[CaptureRecord]],
    wanted: Sequence[str],
    protocol: Protocol,
    out: Path,
    results: ThesisResults,
) -> None:
    errors = {
        stance: [error_series(rows, method, seed=protocol.seed) for method in protocol.methods]
        for stance, rows in records.items()
        if len(rows) >= 2 and rows[0].lesions_m
    }
    numbers, pictures = results.numbers, results.pictures
    if not errors:
        results.notes.append("No stance has two usable captures with clicked lesions; no error was measured.")
        return
    order = rank_stances(errors)
    if "11" in wanted:
        pictures["Figure 11: Euclidean error per image"] = draw_error_per_image(errors, out / "figure-11.png")
        numbers["figure_11"] = {
            stance: {
                s.method: {
                    "captures": list(s.captures),
                    "mean_m": s.per_capture_m.tolist(),
                    "errors_m": s.errors_m.tolist(),
                }
                for s in series
            }
            for stance, series in errors.items()
        }
    if "table2" in wanted:
        numbers["table_2"] = [
            _table_row(number, stance, s)
            for number, (stance, series) in enumerate(errors.items())
            for s in series
        ]
    if "stances" in wanted:
        pictures["Stances ranked by error"] = draw_stances(errors, order, out / "stances.png")
        numbers["ranking"] = order
    if "time" in wanted:
        pictures["Error against time"] = draw_error_against_time(errors, out / "error-against-time.png")
        numbers["error_against_time"] = [
            {"stance": stance, "method": s.method, "cpu_s": s.cpu_s, "mean_m": s.mean_m}
            for stance, series in errors.items()
            for s in series
        ]


def rank_stances(errors: Mapping[str, Sequence[ErrorSeries]]) -> list[str]:
    """Stances by the mean error of the better of the thesis's methods, the best first."""

    def best(stance: str) -> float:
        means = [s.mean_m for s in errors[stance] if s.method in VOTING.values() and np.isfinite(s.mean_m)]
        return min(means, default=float("inf"))

    return sorted(errors, key=best)


def _table_row(number: int, stance: str, s: ErrorSeries) -> dict[str, Any]:
    label = next((k for k, method in VOTING.items() if method == s.method), s.method)
    thesis = THESIS_TABLE_2_M[label][number] if label in THESIS_TABLE_2_M and number < 2 else None
    return {
        "pose": number + 1,
        "stance": stance,
        "method": label,
        "mean_m": s.mean_m,
        "low_m": s.low_m,
        "high_m": s.high_m,
        "median_m": s.median_m,
        "p95_m": s.p95_m,
        "images": len(s.captures),
        "judged": s.judged,
        "answered": s.answered,
        "thesis_m": thesis,
    }
