"""One pair of visits from folders to the answer: what ``relocate`` and ``relocate-batch`` have in common."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.cli.stored_pixels import entry_as_stored, mirrored_captures, query_as_read
from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.capture import RgbdCapture
    from core.relocation import LesionQuery, RelocationOptions, RelocationResult, Spot


@dataclass(frozen=True, eq=False)
class RelocatedPair:
    """The answer for a pair of visits, and what it was found in.

    Attributes
    ----------
    document : dict
        The result as it is written, ``geoderm-relocation/1``: pixels count in the images as they are stored.
    first, followup : mapping of str to AnalysedCapture
        Captures by name; those that show no body are left out.
    queries : tuple of LesionQuery
        With pixels of the un-mirrored images, in the order of the answers.
    result : RelocationResult
        With pixels of the un-mirrored images.
    """

    document: dict[str, Any]
    first: Mapping[str, AnalysedCapture]
    followup: Mapping[str, AnalysedCapture]
    queries: tuple[LesionQuery, ...]
    result: RelocationResult


def relocate_folders(
    first: Path,
    followup: Path,
    lesions: Path,
    *,
    method: str,
    appearance: bool,
    seed: int,
    options: RelocationOptions | None = None,
) -> RelocatedPair:
    """Find the lesions of one visit again in another.

    Parameters
    ----------
    first, followup : Path
        Capture folders or visit folders.
    lesions : Path
        lesions.json with places in ``first``.
    method : str
        A key of `core.relocation.RELOCATION_METHODS`.
    appearance : bool
        Whether colour may be used for matching.
    seed : int
        Of every random draw.

    Raises
    ------
    InputError
        For a file, a field or an option that is wrong.
    WorkError
        If no capture of a visit shows a body.
    """
    from core.capture import read_visit
    from core.relocation import RelocatedLesion, read_lesions, relocate_visit

    start = time.perf_counter()
    queries = read_lesions(lesions)
    first_visit, followup_visit = read_visit(first), read_visit(followup)
    check_pixels(lesions, queries, dict(first_visit))
    first_mirrored = mirrored_captures(first, dict(first_visit))
    followup_mirrored = mirrored_captures(followup, dict(followup_visit))
    queries = tuple(query_as_read(query, dict(first_visit), first_mirrored) for query in queries)
    read = time.perf_counter()
    wanted = {q.capture for q in queries if q.capture is not None} or {name for name, _ in first_visit}
    analysed1, unusable = _analyse([(n, c) for n, c in first_visit if n in wanted] if queries else [])
    analysed2, bodiless = _analyse(followup_visit if queries else [])
    warnings = [f"{name}: {reason}" for name, reason in {**unusable, **bodiless}.items()]
    analysed = time.perf_counter()
    result = relocate_visit(
        analysed1,
        analysed2,
        [q for q in queries if q.capture not in unusable],
        method=method,
        appearance=appearance,
        seed=seed,
        options=options,
    )
    answers = {lesion.id: lesion for lesion in result.lesions}
    result = replace(
        result,
        lesions=tuple(
            answers.get(q.id) or RelocatedLesion(q.id, "refused", unusable[str(q.capture)]) for q in queries
        ),
    )
    document: dict[str, Any] = result.to_json()
    for entry in document["lesions"]:
        if entry.get("capture") in followup_mirrored:
            entry_as_stored(entry, analysed2[entry["capture"]].capture.rig)
    _spots_as_stored(document, "new_spots", result.new_spots, analysed2, followup_mirrored)
    _spots_as_stored(document, "vanished_spots", result.vanished_spots, analysed1, first_mirrored)
    if len(first_visit) == 1 and len(followup_visit) == 1 and not any(q.capture for q in queries):
        for key in ("lesions", "new_spots", "vanished_spots"):
            for entry in document.get(key, ()):
                entry.pop("capture", None)
    document["warnings"] = [*warnings, *result.warnings]
    document["seconds"] = {
        **{name: round(value, 4) for name, value in result.seconds.items() if name != "total"},
        "reading": round(read - start, 4),
        "analysis": round(analysed - read, 4),
        "total": round(time.perf_counter() - start, 4),
    }
    return RelocatedPair(document, analysed1, analysed2, queries, result)


def check_pixels(file: Path, queries: tuple[LesionQuery, ...], captures: dict[str, RgbdCapture]) -> None:
    """Every lesion names a capture and lies inside its image; otherwise the file and the field are named."""
    for i, query in enumerate(queries):
        if query.capture is not None and query.capture not in captures:
            raise InputError(
                f'{file}: field "lesions[{i}].capture": FIRST has no capture "{query.capture}".',
                f"Choose one of: {', '.join(captures)}.",
            )
        if query.capture is None and len(captures) > 1:
            raise InputError(
                f'{file}: field "lesions[{i}].capture" is missing although FIRST holds several captures.',
                f"Choose one of: {', '.join(captures)}.",
            )
        rig = captures[query.capture if query.capture is not None else next(iter(captures))].rig
        camera, key, pixel = (
            (rig.picture_camera, "pixel", query.pixel)
            if query.pixel is not None
            else (rig.depth, "depth_pixel", query.depth_pixel)
        )
        if not camera.contains(pixel)[0]:
            raise InputError(
                f'{file}: field "lesions[{i}].{key}": {list(pixel or ())} lies outside the '
                f"{camera.width} x {camera.height} image."
            )


def _spots_as_stored(
    document: dict[str, Any],
    key: str,
    spots: Sequence[Spot],
    captures: Mapping[str, AnalysedCapture],
    mirrored: frozenset[str],
) -> None:
    """Name the capture of every spot, and count its pixel in the image as it is stored."""
    for entry, spot in zip(document.get(key, ()), spots, strict=True):
        name = getattr(spot, "capture", None) or next(iter(captures))
        entry["capture"] = name
        if name in mirrored:
            entry_as_stored(entry, captures[name].capture.rig)


def _analyse(captures: list[tuple[str, RgbdCapture]]) -> tuple[dict[str, AnalysedCapture], dict[str, str]]:
    """Analysed captures by name; in a visit of several, those that show no body, with the reason."""
    from core.anchors import analyse_capture
    from devices.trackers import default_tracker

    out: dict[str, AnalysedCapture] = {}
    unusable: dict[str, str] = {}
    for name, capture in captures:
        try:
            out[name] = analyse_capture(capture, default_tracker())
        except WorkError as error:
            if len(captures) == 1:
                raise
            unusable[name] = error.message
    if captures and not out:
        raise WorkError("No body was found in any capture.", "Capture again with the whole body in view.")
    return out, unusable
