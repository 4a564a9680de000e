"""``geoderm relocate``: the lesions of a first visit in the capture of a follow-up."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.stored_pixels import entry_as_stored, mirrored_captures, query_as_read
from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.capture import RgbdCapture
    from core.relocation import LesionQuery, RelocationOptions, RelocationResult, Spot


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("relocate")(relocate_command)


def relocate_command(
    first: Path = typer.Argument(..., help="Capture folder of the first visit, or a folder of them."),
    followup: Path = typer.Argument(..., help="Capture folder of the follow-up, or a folder of them."),
    lesions: Path = typer.Option(..., "--lesions", help="lesions.json: places in the first visit's picture."),
    out: Path = typer.Option(..., "--out", help="result.json to write."),
    method: str = typer.Option("", "--method", help="Relocation method (default: the best shipped)."),
    no_appearance: bool = typer.Option(False, "--no-appearance", help="Geometry alone: never match colour."),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of every random draw."),
    delta_m: float | None = typer.Option(
        None, "--delta-m", help="Half width of a voting band in metres. Default: 0.03 (docs/method.md)."
    ),
    explain: Path | None = typer.Option(
        None, "--explain", help="Folder for pictures explaining every lesion."
    ),
) -> None:
    """Find the lesions of FIRST again in FOLLOWUP."""
    from core.capture import read_visit
    from core.relocation import (
        DEFAULT_DELTA_M,
        DEFAULT_METHOD,
        RelocatedLesion,
        RelocationOptions,
        read_lesions,
        relocate_visit,
        relocation_method,
        write_json,
    )

    start = time.perf_counter()
    method = method or DEFAULT_METHOD
    relocation_method(method)
    options = RelocationOptions(delta_m=DEFAULT_DELTA_M if delta_m is None else delta_m)
    queries = read_lesions(lesions)
    if not out.parent.is_dir():
        raise InputError(f"{out}: the folder does not exist.", "Create it or choose another.")
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
        appearance=not no_appearance,
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
    write_json(out, document)
    if explain is not None:
        _explain(explain, analysed1, analysed2, queries, result, options)


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


def _explain(
    folder: Path,
    first: dict[str, AnalysedCapture],
    followup: dict[str, AnalysedCapture],
    queries: tuple[LesionQuery, ...],
    result: RelocationResult,
    options: RelocationOptions,
) -> None:
    """Pictures of every lesion against the capture its answer lies in, with the distances of the method."""
    from core.relocation.explain import KINDS, explain_lesion
    from core.relocation.explain_files import write_explanation

    for query, lesion in zip(queries, result.lesions, strict=True):
        source = first.get(query.capture if query.capture is not None else next(iter(first)))
        name = lesion.capture if lesion.capture is not None else next(iter(followup))
        if source is None:
            continue
        target = followup[name]
        method = result.method if result.method in KINDS else "trilateration"
        explanation = explain_lesion(
            source, target, query, method=method, options=options, answer_m=lesion.point_m
        )
        if explanation is not None:
            prefix = query.id if len(followup) == 1 else f"{query.id}-{name}"
            write_explanation(explanation, source, target, folder, prefix)
