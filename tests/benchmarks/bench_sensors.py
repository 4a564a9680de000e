"""Accuracy by depth sensor: the same simulated people, stances, lesions and clicks before each.

The first eight pairs of the frozen test split with a Kinect v1 (structured light), a Kinect v2 (time of
flight) and a RealSense D435 (active stereo), all with the same auxiliary colour camera: geodesics alone
(trilateration), the default by geometry only and with appearance; beside them the sensor floor, and the error
of shortest paths on the measured skin. About 25 minutes on two idle cores, a third of it for rendering.
GEODERM_SIMULATED_CAPTURES names a folder that keeps captures: a run that was stopped then goes on. The whole
tables are in sensors/sensors.md. None of these sensors was at hand: frames are drawn from resources/sensors.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.cli.evaluate import CACHE_VARIABLE, chosen_rungs, simulated_pairs
from app.cli.evaluate_sensors import METHODS, measure_sensors
from core.capture.sensors import sensor_names
from core.evaluation import FLOOR
from core.evaluation.sensor_table import path_errors, write_sensors

OUT = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "sensors"
PAIRS = 8
QUICK_PAIRS = 1


def run(quick: bool = False) -> list[dict[str, Any]]:
    """A row for each sensor, stance class and method."""
    kept = os.environ.get(CACHE_VARIABLE)
    cache = Path(kept) if kept else None
    journals = None if cache is None else cache / "bench_sensors"
    if journals is not None:
        journals.mkdir(parents=True, exist_ok=True)
    pairs = simulated_pairs("test")[: QUICK_PAIRS if quick else PAIRS]
    rungs = chosen_rungs(METHODS, "tracked", "30", "both")
    document, text = measure_sensors(sensor_names(), pairs, rungs, cache, journals)
    if not quick:
        OUT.mkdir(parents=True, exist_ok=True)
        write_sensors(document, text, OUT)
    return rows_of(document)


def rows_of(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The figures of a document ``geoderm-sensors/1``."""
    out: list[dict[str, Any]] = []
    for sensor in document["sensors"]:
        paths = path_errors(document["skin"], sensor["name"])
        if paths is not None:
            out.append(
                {
                    "figure": "shortest paths on the skin, mean error",
                    "sensor": sensor["name"],
                    "value": paths.mean_mm,
                    "unit": "mm",
                    "P95": paths.p95_mm,
                    "lesions": paths.paths,
                }
            )
    for row in document["rows"]:
        if row["mean_mm"] is None:
            continue
        low, high = row["mean_mm_interval"]
        floor = row["method"] == FLOOR
        name = row["method"] + (" + appearance" if row["appearance"] else "")
        out.append(
            {
                "figure": f"{name}, {row['group']}: mean error",
                "sensor": row["sensor"],
                "value": row["mean_mm"],
                "unit": "mm",
                "P95": row["p95_mm"],
                "lesions": row["lesions"],
                "interval": f"{low:.1f}-{high:.1f}",
                "median": row["median_mm"],
                "answered": row["answered"],
                "in 95 % region": "" if floor else row["in_radius"],
                "radius": "" if floor else row["radius_mm"],
            }
        )
    return out


if __name__ == "__main__":
    for line in run():
        print(line)
