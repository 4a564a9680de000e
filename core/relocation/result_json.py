"""lesions.json in, result.json out (``geoderm-relocation/1``)."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, WorkError
from core.relocation.types import Candidate, LesionQuery, Region, RelocatedLesion, Spot

if TYPE_CHECKING:
    from core.relocation.types import RelocationResult

FORMAT = "geoderm-relocation/1"
MAX_LESIONS_BYTES = 50_000_000


def read_lesions(path: Path) -> tuple[LesionQuery, ...]:
    """The queries of a lesions.json.

    Raises
    ------
    InputError
        Naming the file and the field, for anything that is not the format.
    """
    entries = read_entries(path)
    queries = tuple(_query(path, i, entry) for i, entry in enumerate(entries))
    seen: set[str] = set()
    for i, query in enumerate(queries):
        if query.id in seen:
            raise InputError(f'{path}: field "lesions[{i}].id": "{query.id}" occurs twice.')
        seen.add(query.id)
    return queries


def read_entries(path: Path) -> list[object]:
    """The list "lesions" of a JSON file.

    Raises
    ------
    InputError
        Naming the file, if it cannot be read, is too large, or holds no such list.
    """
    try:
        if path.stat().st_size > MAX_LESIONS_BYTES:
            raise InputError(f"{path}: the file is too large for a list of lesions.")
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}).") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({error}).") from error
    entries = data.get("lesions") if isinstance(data, dict) else None
    if not isinstance(entries, list):
        raise InputError(f'{path}: field "lesions" must be a list.')
    return entries


def _query(path: Path, index: int, entry: object) -> LesionQuery:
    where = f"lesions[{index}]"
    if not isinstance(entry, dict):
        raise InputError(f'{path}: field "{where}" must be an object.')
    name = entry.get("id")
    if isinstance(name, int) and not isinstance(name, bool):
        name = str(name)
    if not isinstance(name, str) or not name:
        raise InputError(f'{path}: field "{where}.id" must be a text.')
    try:
        name.encode("utf-8")
    except UnicodeEncodeError as error:
        raise InputError(f'{path}: field "{where}.id" is not valid Unicode text.') from error
    capture = entry.get("capture")
    if capture is not None and not isinstance(capture, str):
        raise InputError(f'{path}: field "{where}.capture" must be the name of a capture.')
    pixel, depth_pixel = (_pair(path, where, key, entry.get(key)) for key in ("pixel", "depth_pixel"))
    if pixel is None and depth_pixel is None:
        raise InputError(f'{path}: field "{where}" needs "pixel" or "depth_pixel".')
    healed = entry.get("healed", False)
    if not isinstance(healed, bool):
        raise InputError(f'{path}: field "{where}.healed" must be true or false.')
    return LesionQuery(name, pixel, depth_pixel, capture, healed)


def _pair(path: Path, where: str, key: str, value: object) -> tuple[float, float] | None:
    if value is None:
        return None
    if (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(x, int | float) and not isinstance(x, bool) for x in value)
        and all(abs(x) < 1e9 and math.isfinite(x) for x in value)
    ):
        return float(value[0]), float(value[1])
    raise InputError(f'{path}: field "{where}.{key}" must be two finite numbers [u, v].')


def _point(point: NDArray[np.float64] | None) -> list[float] | None:
    return None if point is None else [round(float(x), 6) for x in point]


def _pixel(pixel: tuple[float, float] | None) -> list[float] | None:
    return None if pixel is None else [round(float(x), 3) for x in pixel]


def _candidate(candidate: Candidate, colored: bool) -> dict[str, object]:
    out: dict[str, object] = {"point_m": _point(candidate.point_m)}
    if colored:
        out["pixel"] = _pixel(candidate.pixel)
    if candidate.depth_pixel is not None:
        out["depth_pixel"] = _pixel(candidate.depth_pixel)
    out["confidence"] = round(candidate.confidence, 4)
    return out


def _region(region: Region) -> dict[str, object]:
    return {"axes_m": [round(float(a), 6) for a in region.axes_m], "direction": _point(region.direction)}


def _spot(spot: Spot) -> dict[str, object]:
    return {"pixel": _pixel(spot.pixel), "point_m": _point(spot.point_m), "confidence": spot.confidence}


def lesion_to_json(lesion: RelocatedLesion) -> dict[str, object]:
    """One entry of result.json; the keys of the place only with a point, ``pixel`` only with colour."""
    colored = lesion.picture == "color"
    out: dict[str, object] = {"id": lesion.id, "status": lesion.status}
    if lesion.capture is not None:
        out["capture"] = lesion.capture
    if lesion.point_m is not None:
        out["point_m"] = _point(lesion.point_m)
        if lesion.pixel is not None and colored:
            out["pixel"] = _pixel(lesion.pixel)
        if lesion.depth_pixel is not None:
            out["depth_pixel"] = _pixel(lesion.depth_pixel)
        out["radius95_m"] = None if lesion.radius95_m is None else round(lesion.radius95_m, 6)
    out["confidence"] = round(lesion.confidence, 4)
    out["appearance_matched"] = lesion.appearance_matched
    out["candidates"] = [_candidate(c, colored) for c in lesion.candidates]
    out["reason"] = lesion.reason
    if lesion.region is not None and lesion.point_m is not None:
        out["region"] = _region(lesion.region)
    if lesion.agreement_m is not None:
        out["agreement_m"] = round(lesion.agreement_m, 6)
    return out


def result_to_json(result: RelocationResult) -> dict[str, object]:
    """The dictionary of result.json."""
    out: dict[str, object] = {
        "format": FORMAT,
        "method": result.method,
        "seconds": {name: round(value, 4) for name, value in result.seconds.items()},
        "warnings": list(result.warnings),
        "lesions": [lesion_to_json(lesion) for lesion in result.lesions],
    }
    if result.new_spots:
        out["new_spots"] = [_spot(s) for s in result.new_spots]
    if result.vanished_spots:
        out["vanished_spots"] = [_spot(s) for s in result.vanished_spots]
    return out


def write_json(path: Path, content: Mapping[str, object]) -> None:
    """Write a JSON file whole or not at all.

    Raises
    ------
    WorkError
        If the folder is missing, read-only or full.
    """
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    temporary: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", dir=path.parent, prefix=f".{path.name}.", delete=False
        ) as handle:
            temporary = Path(handle.name)
            handle.write(text)
            handle.flush()
            os.fsync(handle.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise WorkError(
            f"{path}: cannot be written ({error.strerror or error}).",
            "Choose a folder that you may write to.",
        ) from error
