"""The thesis's own experiments: table 2 by its protocol, and CPU time at 60,000 points, beside its figures.

One simulated person holds two stances; 30 captures of each with one raw depth frame, joints by the
application's own tracker. Lesions are clicked in the first capture and judged in the next 29 against
re-clicked truth (clicks with 1 px of error on a 1280 x 960 picture). The interval re-samples captures.
CPU time is that of one field from one source on one thread. Simulated captures order methods; they are no
accuracy on people, and the thesis's poses are not these stances.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from app.cli.evaluate_thesis import simulate_stances
from core.evaluation.thesis import Protocol, run_thesis
from core.progress import no_progress
from devices.trackers import default_tracker

BODY, SEED = "m_tall_thin", 0
STANCES = ("psi", "A")


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Rows of table 2 and of the CPU times; ``quick`` takes four captures of each stance."""
    with tempfile.TemporaryDirectory() as folder:
        sequences = simulate_stances(
            Path(folder) / "captures", STANCES, 4 if quick else 30, BODY, SEED, progress=no_progress
        )
        numbers = run_thesis(
            sequences,
            default_tracker(),
            None,
            Path(folder) / "out",
            figures=("table2", "10", "cpu"),
            protocol=Protocol(),
            cpu_rounds=3 if quick else 9,
        ).numbers
    return table_2_rows(numbers) + variance_rows(numbers) + cpu_rows(numbers)


def table_2_rows(numbers: dict[str, Any]) -> list[dict[str, Any]]:
    """Mean errors, the thesis's two methods and those beside."""
    return [
        {
            "figure": f"table 2, {row['stance']}, {row['method']}: mean error",
            "value": 1e3 * row["mean_m"],
            "unit": "mm",
            "interval": f"{1e3 * row['low_m']:.1f}-{1e3 * row['high_m']:.1f}",
            "median": 1e3 * row["median_m"],
            "P95": 1e3 * row["p95_m"],
            "answered": f"{row['answered']}/{row['judged']}",
            "thesis": "" if row["thesis_m"] is None else 1e3 * row["thesis_m"],
        }
        for row in numbers["table_2"]
    ]


def variance_rows(numbers: dict[str, Any]) -> list[dict[str, Any]]:
    """Figure 10 in one figure per method and stance."""
    return [
        {
            "figure": f"figure 10, {stance}, {label}: mean variance of joint-joint distances",
            "value": 1e4 * m["mean_m2"],
            "unit": "cm2",
        }
        for stance, methods in numbers["figure_10"].items()
        if stance != "joints"
        for label, m in methods.items()
    ]


def cpu_rows(numbers: dict[str, Any]) -> list[dict[str, Any]]:
    """CPU time of one field, and of building its graph or mesh."""
    points = f"{numbers['cpu']['points']:,} points"
    return [
        {
            "figure": f"CPU time, {points}, {m['method']}{what}",
            "value": 1e3 * m[key],
            "unit": "ms",
            "thesis": 1e3 * m["thesis_s"] if key == "one_source_s" and m["thesis_s"] else "",
        }
        for m in numbers["cpu"]["methods"]
        for key, what in (("one_source_s", ""), ("build_s", ": building"))
    ]


if __name__ == "__main__":
    for line in run():
        print(line)
