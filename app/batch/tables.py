"""results.csv, a row for each lesion, and cases.csv, a row for each pair: written whole, case by case."""

from __future__ import annotations

import csv
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.batch.case import Case
from app.batch.journal import Finished, Journal
from core.errors import WorkError

RESULTS, CASES = "results.csv", "cases.csv"

STATUSES = ("found", "predicted", "ambiguous", "not_visible", "refused")
COUNTS = ("lesions", *STATUSES, "new_spots", "vanished_spots", "warnings")
RESULT_COLUMNS = (
    "case", "lesion", "status", "capture", "x_m", "y_m", "z_m", "u", "v", "depth_u", "depth_v", "radius95_m",
    "region_a_m", "region_b_m", "confidence", "appearance_matched", "agreement_m", "candidates", "method",
    "reason",
)  # fmt: skip
CASE_COLUMNS = (
    "case", "status", "reason", "seconds", "peak_memory_mb", *COUNTS, "method", "appearance", "seed"
)  # fmt: skip


def counts_of(document: Mapping[str, Any]) -> dict[str, int]:
    """Lesions, lesions by status, spots and warnings of a result."""
    statuses = [lesion["status"] for lesion in document["lesions"]]
    return {
        "lesions": len(statuses),
        **{status: statuses.count(status) for status in STATUSES},
        **{name: len(document.get(name, ())) for name in ("new_spots", "vanished_spots", "warnings")},
    }


def write_tables(folder: Path, cases: Sequence[Case], journal: Journal) -> None:
    """Write both tables of the pairs that are finished, in the order of the manifest.

    Results are read back one at a time, so that the size of the cohort does not matter.

    Raises
    ------
    WorkError
        If they cannot be written, or a result cannot be read back.
    """
    finished = [(case, entry) for case in cases if (entry := journal.get(case.name)) is not None]
    _write(folder / CASES, CASE_COLUMNS, (_case_row(case, entry) for case, entry in finished))
    done = (case.name for case, entry in finished if entry.done)
    _write(folder / RESULTS, RESULT_COLUMNS, (row for name in done for row in _lesion_rows(folder, name)))


def _case_row(case: Case, entry: Finished) -> list[object]:
    return [
        case.name,
        "done" if entry.done else "failed",
        entry.reason,
        entry.seconds,
        entry.peak_memory_mb,
        *(entry.counts.get(name, "") for name in COUNTS),
        case.method,
        _truth(case.appearance),
        case.seed,
    ]


def _lesion_rows(folder: Path, name: str) -> Iterator[list[object]]:
    path = folder / f"{name}.json"
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise WorkError(f"{path}: the result cannot be read back ({error}).", "Run it again.") from error
    for lesion in document["lesions"]:
        region = lesion.get("region") or {}
        yield [
            name,
            lesion["id"],
            lesion["status"],
            lesion.get("capture", ""),
            *_numbers(lesion.get("point_m"), 3),
            *_numbers(lesion.get("pixel"), 2),
            *_numbers(lesion.get("depth_pixel"), 2),
            _number(lesion.get("radius95_m")),
            *_numbers(region.get("axes_m"), 2),
            _number(lesion.get("confidence")),
            _truth(bool(lesion.get("appearance_matched"))),
            _number(lesion.get("agreement_m")),
            len(lesion.get("candidates") or ()),
            document["method"],
            lesion.get("reason", ""),
        ]


def _numbers(values: Sequence[float] | None, length: int) -> list[object]:
    return [""] * length if values is None else list(values)


def _number(value: float | None) -> object:
    return "" if value is None else value


def _truth(value: bool) -> str:
    return "true" if value else "false"


def _write(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    temporary: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", newline="", dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as handle:
            temporary = Path(handle.name)
            writer = csv.writer(handle, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(rows)
            handle.flush()
            os.fsync(handle.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        raise WorkError(
            f"{path}: cannot be written ({error.strerror or error}).",
            "Make room, close it in other programs, and run the command again; what is finished is kept.",
        ) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
