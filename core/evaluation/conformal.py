"""How much wider or narrower stated regions must be to hold 95 % (split conformal calibration).

Made from the residuals of pairs that appear in no accuracy table. For every way an answer was found, stance
class and body part, the quantile of error over stated radius says by what the factor in force
(`core.relocation.calibration95`) has to be multiplied.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError

SHARE = 0.95
LEAST = 40
"""With fewer answers a part shares the quantile of its group."""

_PART = {"hand": "forearm", "foot": "lower leg"}
_GROUP = {
    "head": "trunk and head",
    "trunk": "trunk and head",
    "upper arm": "arm",
    "forearm": "arm",
    "thigh": "leg",
    "lower leg": "leg",
}
_NEEDED = (
    "method",
    "stance_class",
    "part",
    "visible",
    "appearance",
    "appearance_matched",
    "error_m",
    "radius95_m",
)


@dataclass(frozen=True)
class RegionFactor:
    """By what a stated radius has to be multiplied.

    Attributes
    ----------
    kind : str
        "seen", "matched" or "geometry": how the answers were found.
    stance_class, part : str
    answers : int
        Of this part.
    held : float
        Share of them whose stated radius held; NaN without any.
    factor : float
    shared : bool
        Whether the part had too few answers and shares its group's factor.
    """

    kind: str
    stance_class: str
    part: str
    answers: int
    held: float
    factor: float
    shared: bool


def read_residuals(path: Path) -> list[dict[str, str]]:
    """The rows that `core.evaluation.write_residuals` wrote.

    Raises
    ------
    InputError
        Naming the file and the missing column.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file)
            rows = list(reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table of residuals ({error}).") from error
    missing = [name for name in _NEEDED if name not in (reader.fieldnames or ())]
    if missing:
        raise InputError(
            f'{path}: column "{missing[0]}" is missing.', "Write it with: geoderm evaluate residuals."
        )
    return rows


def region_factors(rows: Iterable[Mapping[str, str]], method: str) -> list[RegionFactor]:
    """Factors of one method, for every kind, stance class and part that occurs.

    Raises
    ------
    InputError
        If a row's error or radius is no number.
    """
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        if row["method"] != method or row["visible"] != "1" or not row["error_m"] or not row["radius95_m"]:
            continue
        part = _PART.get(row["part"], row["part"])
        try:
            ratio = float(row["error_m"]) / float(row["radius95_m"])
        except (ValueError, ZeroDivisionError) as error:
            raise InputError(
                f'An error or radius of the residuals is no number ("{row["error_m"]}").'
            ) from error
        ratios.setdefault((_kind(row), row["stance_class"], part), []).append(ratio)
    out = []
    for (kind, stance, part), own in sorted(ratios.items()):
        group = _GROUP.get(part, part)
        pooled = [
            r
            for (k, s, p), v in ratios.items()
            if (k, s, _GROUP.get(p, p)) == (kind, stance, group)
            for r in v
        ]
        shared = len(own) < LEAST
        held = float(np.mean(np.array(own) <= 1.0))
        out.append(
            RegionFactor(
                kind, stance, part, len(own), held, conformal_quantile(pooled if shared else own), shared
            )
        )
    return out


def conformal_quantile(ratios: Iterable[float], share: float = SHARE) -> float:
    """The quantile that holds a new ratio with probability ``share``, whatever their law (finite sample).

    The ``ceil((n + 1) share)``-th smallest; the largest where there are too few.
    """
    values: NDArray[np.float64] = np.sort(np.array(list(ratios), float))
    if len(values) == 0:
        raise InputError("A quantile needs at least one ratio.")
    rank = int(np.ceil((len(values) + 1) * share))
    return float(values[min(rank, len(values)) - 1])


def _kind(row: Mapping[str, str]) -> str:
    if row["appearance"] != "1":
        return "geometry"
    return "seen" if row["appearance_matched"] == "1" else "matched"
