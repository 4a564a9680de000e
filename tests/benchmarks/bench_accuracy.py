"""Accuracy on the frozen simulated test pairs: the claims, each with what was measured for it.

Every method runs on all test pairs under the conditions of the headline: the application's own tracker, 30
frames, geometry only and with appearance. True joints, and a single frame, are measured on the first eight
pairs, without the slow yardstick CPD. About 40 minutes in all on two idle cores, a third of it for rendering.
GEODERM_SIMULATED_CAPTURES names a folder that keeps captures (50 MB a pair) and measurements: a run that was
stopped then goes on. The ladder, body parts, stances, pictures and definitions are in accuracy/report.md.
Simulated bodies are no patients: these figures order methods and are no clinical accuracy.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

from app.cli.evaluate import (
    CACHE_VARIABLE,
    best_method,
    measured_code,
    simulated_pairs,
    tell,
    what_was_run,
    write_all,
)
from app.cli.simulated_cases import SimulatedCases, simulator_code
from core.evaluation import Journal, ladder_methods, ladder_rungs, make_report, run_ladder

OUT = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "accuracy"
SIDE_PAIRS = 8
QUICK_PAIRS = 3


def run(quick: bool = False) -> list[dict[str, Any]]:
    """The claims, then the headline's rows of the ladder."""
    pairs = simulated_pairs("test")
    fast = tuple(name for name in ladder_methods() if name != "cpd")
    headline = ladder_rungs(fast if quick else ladder_methods())
    side = (
        *ladder_rungs(fast, joints=("true",)),
        *ladder_rungs(fast, frames=(1,)),
    )
    kept = os.environ.get(CACHE_VARIABLE)
    cache = Path(kept) if kept else None
    source = SimulatedCases(pairs[: QUICK_PAIRS if quick else None], cache=cache)
    journal = Journal(
        None if cache is None else cache / "bench_accuracy.jsonl", f"{measured_code()} {simulator_code()}"
    )
    started = time.perf_counter()
    records = run_ladder(source, headline, journal, progress=tell)
    rungs = headline
    if not quick:
        rungs = (*headline, *side)
        records += run_ladder(SimulatedCases(pairs[:SIDE_PAIRS], cache=cache), side, journal, progress=tell)
    about = {
        "captures": f"simulated, test split, {len(source)} pairs; the side conditions on {SIDE_PAIRS}",
        **what_was_run(rungs, started),
    }
    if not quick:
        OUT.mkdir(parents=True, exist_ok=True)
        write_all(records, rungs, about, OUT)
    report = make_report(records, rungs, about=about, method=best_method(rungs))
    rows: list[dict[str, Any]] = [
        {
            "figure": t.figure,
            "value": t.measured,
            "unit": "",
            "to reach": t.to_reach,
            "dream": t.dream,
            "reached": "-" if t.reached is None else "yes" if t.reached else "no",
        }
        for t in report.targets
    ]
    for row in report.rows:
        s = row.summary.mean_mm
        rows.append(
            {
                "figure": f"{row.rung.label}, {row.rung.conditions}, {row.group}: mean error",
                "value": s.value,
                "unit": "mm",
                "interval": f"{s.low:.1f}-{s.high:.1f}",
                "P95": row.summary.p95_mm.value,
                "seconds": row.seconds,
            }
        )
    return rows


if __name__ == "__main__":
    for line in run():
        print(line)
