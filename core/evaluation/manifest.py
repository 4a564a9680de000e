"""A researcher's own pairs of captures: a CSV file with one pair per row, and the clicked truth of each."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.errors import InputError
from core.relocation import LesionQuery, read_lesions
from core.relocation.result_json import read_entries

COLUMNS = ("case", "first", "followup", "lesions", "truth")
MAX_ROWS = 100_000

Pixel = tuple[float, float]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class TruePlace:
    """Where a lesion is in the follow-up, by a person's click or by measurement.

    Attributes
    ----------
    pixel : (u, v) or None
        In the follow-up's stored picture.
    point_m : (x, y, z) or None
        In its depth-camera frame; goes before the pixel.
    visible : bool
        A place that is not visible needs neither.
    """

    pixel: Pixel | None
    point_m: Point | None
    visible: bool


@dataclass(frozen=True)
class ManifestPair:
    """One row, its files read.

    Attributes
    ----------
    case, body : str
        The body is the column "body", or the case itself.
    first, followup : Path
        Capture folders.
    lesions_file, truth_file : Path
    lesions : tuple of LesionQuery
    truth : dict of str to TruePlace
        For every lesion.
    """

    case: str
    body: str
    first: Path
    followup: Path
    lesions_file: Path
    truth_file: Path
    lesions: tuple[LesionQuery, ...]
    truth: dict[str, TruePlace]


def read_manifest(path: Path) -> tuple[ManifestPair, ...]:
    """Read a manifest and everything it names but the captures themselves.

    Columns: case, first, followup (capture folders), lesions (lesions.json of the first capture), truth
    (JSON with the same lesions in the follow-up: ``{"lesions": [{"id", "pixel": [u, v]} or {"id", "point_m":
    [x, y, z]} or {"id", "visible": false}]}``), and optionally body, which tells whose captures belong
    together. Paths count from the manifest's folder.

    Raises
    ------
    InputError
        Naming the file, the row and the column.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, strict=True)
            missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise InputError(f'{path}: row 1: column "{missing[0]}" is missing.')
            pairs = [_pair(path, reader.line_num, row) for row in reader]
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is not a CSV file in UTF-8 ({error}).") from error
    if not pairs:
        raise InputError(f"{path}: names no pair of captures.")
    if len(pairs) > MAX_ROWS:
        raise InputError(f"{path}: more than {MAX_ROWS} rows.")
    seen: set[str] = set()
    for number, pair in enumerate(pairs, 1):
        if pair.case in seen:
            raise InputError(f'{path}: pair {number}: column "case": "{pair.case}" occurs twice.')
        seen.add(pair.case)
    return tuple(pairs)


def _pair(path: Path, line: int, row: dict[str | None, Any]) -> ManifestPair:
    where = f"{path}: row {line}"
    if None in row:
        raise InputError(f"{where}: more cells than columns.")
    cells: dict[str, str] = {}
    for name in COLUMNS:
        value = (row.get(name) or "").strip()
        if not value:
            raise InputError(f'{where}: column "{name}" is empty.')
        cells[name] = value
    paths = {name: path.parent / cells[name] for name in COLUMNS[1:]}
    for name in ("first", "followup"):
        if not (paths[name] / "capture.json").is_file():
            raise InputError(f'{where}: column "{name}": {paths[name]} is no capture folder.')
    try:
        lesions = read_lesions(paths["lesions"])
    except InputError as error:
        raise InputError(f'{where}: column "lesions": {error.message}', error.advice) from error
    try:
        truth = read_truth(paths["truth"])
    except InputError as error:
        raise InputError(f'{where}: column "truth": {error.message}', error.advice) from error
    for lesion in lesions:
        if lesion.id not in truth:
            raise InputError(
                f'{where}: column "truth": {paths["truth"]} does not say where lesion "{lesion.id}" is.'
            )
    body = (row.get("body") or "").strip() or cells["case"]
    return ManifestPair(
        cells["case"],
        body,
        paths["first"],
        paths["followup"],
        paths["lesions"],
        paths["truth"],
        lesions,
        truth,
    )


def read_truth(path: Path) -> dict[str, TruePlace]:
    """True places in a follow-up by lesion.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    entries = read_entries(path)
    out: dict[str, TruePlace] = {}
    for i, entry in enumerate(entries):
        where = f'{path}: field "lesions[{i}]'
        if not isinstance(entry, dict):
            raise InputError(f'{where}" must be an object.')
        name = entry.get("id")
        name = str(name) if isinstance(name, int) and not isinstance(name, bool) else name
        if not isinstance(name, str) or not name:
            raise InputError(f'{where}.id" must be a text.')
        if name in out:
            raise InputError(f'{where}.id": "{name}" occurs twice.')
        visible = entry.get("visible", True)
        if not isinstance(visible, bool):
            raise InputError(f'{where}.visible" must be true or false.')
        pixel = _numbers(where, entry, "pixel", 2)
        point = _numbers(where, entry, "point_m", 3)
        if visible and pixel is None and point is None:
            raise InputError(f'{where}" needs "pixel" or "point_m", or "visible": false.')
        out[name] = TruePlace(
            None if pixel is None else (pixel[0], pixel[1]),
            None if point is None else (point[0], point[1], point[2]),
            visible,
        )
    return out


def _numbers(where: str, entry: dict[str, Any], key: str, count: int) -> list[float] | None:
    value = entry.get(key)
    if value is None:
        return None
    if (
        isinstance(value, list)
        and len(value) == count
        and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
        and all(abs(x) < 1e9 and math.isfinite(x) for x in value)
    ):
        return [float(x) for x in value]
    raise InputError(f'{where}.{key}" must be {count} finite numbers.')
