"""Accuracy ladder on simulated patients of the test split, errors in millimetres to the truth.

Two captures of one person, 30 noisy frames each, sway, breath, sliding skin, 2560 x 1920 colour, clicks with
1.5 px of error; joints by the application's own tracker, and in rows labelled so the simulator's. Geometry
only. Bodies are re-sampled for the interval. The sensor floor is the error of the true pixel's own place in
the follow-up. Simulated bodies are not patients: these figures order methods and are no clinical accuracy.
"""

from __future__ import annotations

from typing import Any

from app.cli.simulated_cases import TEST_PAIRS, SimulatedCases
from core.evaluation import run_ladder


def run(quick: bool = False) -> list[dict[str, Any]]:
    """Rows of the ladder: tracked joints and true joints, same and other stance."""
    pairs = (TEST_PAIRS[0], TEST_PAIRS[4]) if quick else TEST_PAIRS
    source = SimulatedCases(pairs, frames=5 if quick else 30, joints=("tracked", "true"))
    rows = []
    for row in run_ladder(source):
        s = row.summary
        rows.append(
            {
                "figure": f"{row.method}, {row.group}, {row.joints} joints: mean error",
                "value": s.mean_mm,
                "unit": "mm",
                "interval": f"{s.mean_low_mm:.1f}-{s.mean_high_mm:.1f}",
                "median": s.median_mm,
                "P95": s.p95_mm,
                "within 10 mm": s.within_10mm,
                "beyond 100 mm": s.beyond_100mm,
                "within radius": s.within_radius,
                "answered": f"{s.answered}/{s.lesions}",
                "hidden said": f"{s.hidden_said}/{s.hidden}",
                "seconds": row.seconds,
            }
        )
    return rows


if __name__ == "__main__":
    for line in run():
        print(line)
