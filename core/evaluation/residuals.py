"""One row per lesion and method: raw material for calibrating stated regions."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from core.errors import WorkError
from core.evaluation.records import FLOOR, Record

COLUMNS = (
    "case",
    "body",
    "stance_class",
    "stances",
    "method",
    "joints",
    "frames",
    "appearance",
    "lesion",
    "part",
    "limb",
    "visible",
    "healed",
    "status",
    "error_m",
    "floor_m",
    "beside_floor_m",
    "radius95_m",
    "region_a_m",
    "region_b_m",
    "in_region",
    "confidence",
    "appearance_matched",
    "agreement_m",
    "wrong_lesion",
    "wrong_limb",
    "seconds",
)


def residual_rows(records: Sequence[Record]) -> list[dict[str, object]]:
    """Rows with the keys of `COLUMNS`; None where there is no figure."""
    out: list[dict[str, object]] = []
    for record in records:
        if record.rung.method == FLOOR:
            continue
        shared = {
            "case": record.name.case,
            "body": record.name.body,
            "stance_class": record.name.group,
            "stances": record.name.stances,
            "method": record.rung.method,
            "joints": record.rung.joints,
            "frames": record.rung.frames,
            "appearance": record.rung.appearance,
            "seconds": round(record.seconds, 4),
        }
        out += [{**shared, **score.to_json()} for score in record.lesions]
    return out


def write_residuals(records: Sequence[Record], path: Path) -> int:
    """Write a CSV file and return the number of its rows. Yes and no are 1 and 0, no figure is an empty cell.

    Raises
    ------
    WorkError
        If it cannot be written.
    """
    rows = residual_rows(records)
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            for row in rows:
                writer.writerow({k: int(v) if isinstance(v, bool) else v for k, v in row.items()})
    except OSError as error:
        raise WorkError(f"{path}: cannot be written ({error.strerror or error}).") from error
    return len(rows)
