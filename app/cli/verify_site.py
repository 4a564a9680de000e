"""``geoderm verify-site``: whether a clicked site of the follow-up is that of a stored lesion."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.stored_pixels import mirrored_captures, query_as_read
from core.errors import InputError

if TYPE_CHECKING:
    from core.capture import RgbdCapture
    from core.relocation.site_check import SiteCheck
    from core.relocation.types import LesionQuery, RelocatedLesion

FORMAT = "geoderm-site-check/1"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("verify-site")(verify_site_command)


def verify_site_command(
    first: Path = typer.Argument(..., help="Capture folder of the first visit, or a folder of them."),
    followup: Path = typer.Argument(..., help="Capture folder of the follow-up, or a folder of them."),
    lesions: Path = typer.Option(..., "--lesions", help="lesions.json: places in the first visit's picture."),
    lesion_id: str = typer.Option(..., "--id", help="The stored lesion."),
    pixel: tuple[float, float] = typer.Option(
        ..., "--pixel", help="The site: U V in the follow-up's picture."
    ),
    capture: str = typer.Option("", "--capture", help="Capture of FOLLOWUP the pixel counts in, if several."),
    healed: bool = typer.Option(False, "--healed", help="The lesion is gone: never look for its own looks."),
    no_appearance: bool = typer.Option(False, "--no-appearance", help="Geometry alone: never match colour."),
    method: str = typer.Option("", "--method", help="Relocation method (default: the best shipped)."),
    seed: int = typer.Option(0, "--seed", min=0, help="Seed of every random draw."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Tell whether the site at a pixel of FOLLOWUP lies inside the region of a stored lesion of FIRST."""
    from core.anchors import analyse_capture
    from core.capture import read_visit
    from core.relocation import DEFAULT_METHOD, read_lesions, relocate, relocation_method
    from core.relocation.site_check import check_site
    from core.relocation.view_crossing import Crossing
    from devices.trackers import default_tracker

    method = method or DEFAULT_METHOD
    relocation_method(method)
    queries = read_lesions(lesions)
    if lesion_id not in {q.id for q in queries}:
        raise InputError(f'{lesions}: field "lesions": there is no lesion "{lesion_id}" (--id).')
    first_visit, followup_visit = dict(read_visit(first)), dict(read_visit(followup))
    target = _target(followup, followup_visit, capture)
    queries = _of_one_capture(lesions, queries, lesion_id, first_visit)
    source = next(q for q in queries if q.id == lesion_id).capture or next(iter(first_visit))
    mirrored = mirrored_captures(first, first_visit)
    queries = tuple(query_as_read(q, first_visit, mirrored) for q in queries)
    site = _site(followup, followup_visit, target, pixel)
    if healed:
        queries = tuple(replace(q, healed=True) if q.id == lesion_id else q for q in queries)
    analysed1 = analyse_capture(first_visit[source], default_tracker())
    analysed2 = analyse_capture(followup_visit[target], default_tracker())
    result = relocate(analysed1, analysed2, queries, method=method, appearance=not no_appearance, seed=seed)
    crossing = Crossing(analysed1, analysed2)
    answers = {q.id: crossing.judged(q, result[q.id]) for q in queries}
    lesion = answers[lesion_id]
    check = check_site(
        lesion,
        analysed2,
        site,
        others=[x for name, x in answers.items() if name != lesion_id],
        first=analysed1,
        query=next(q for q in queries if q.id == lesion_id),
    )
    if as_json:
        typer.echo(json.dumps(_document(check, lesion, pixel, result.warnings), ensure_ascii=False, indent=1))
    else:
        typer.echo("\n".join(_lines(check, lesion)))


def _target(folder: Path, captures: dict[str, RgbdCapture], wanted: str) -> str:
    """The capture of the follow-up in which the pixel counts."""
    if wanted and wanted not in captures:
        raise InputError(
            f'{folder}: there is no capture "{wanted}" (--capture).', f"Choose one of: {', '.join(captures)}."
        )
    if not wanted and len(captures) > 1:
        raise InputError(
            f"{folder}: holds several captures; --capture must say in which the pixel counts.",
            f"Choose one of: {', '.join(captures)}.",
        )
    return wanted or next(iter(captures))


def _of_one_capture(
    file: Path, queries: tuple[LesionQuery, ...], lesion_id: str, captures: dict[str, RgbdCapture]
) -> tuple[LesionQuery, ...]:
    """The lesions marked in the same capture as the asked one: its possible confusions. Checked."""
    from app.batch.one_pair import check_pixels

    check_pixels(file, queries, captures)
    own = next(q for q in queries if q.id == lesion_id).capture
    return tuple(q for q in queries if q.capture == own)


def _site(
    folder: Path, captures: dict[str, RgbdCapture], target: str, pixel: tuple[float, float]
) -> tuple[float, float]:
    """The pixel in the un-mirrored picture; refused outside it."""
    camera = captures[target].rig.picture_camera
    if not camera.contains(pixel)[0]:
        raise InputError(
            f"{folder}: --pixel {pixel[0]:g} {pixel[1]:g} lies outside the "
            f"{camera.width} x {camera.height} image."
        )
    mirrored = target in mirrored_captures(folder, captures)
    return (camera.width - 1 - pixel[0], pixel[1]) if mirrored else pixel


def _mm(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m * 1000, 1)


def _document(
    check: SiteCheck, lesion: RelocatedLesion, pixel: tuple[float, float], warnings: tuple[str, ...]
) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "id": lesion.id,
        "pixel": list(pixel),
        "verdict": check.verdict,
        "reason": check.reason,
        "distance_mm": _mm(check.distance_m),
        "border_mm": _mm(check.border_m),
        "region_mm": None if check.axes_m is None else [_mm(a) for a in check.axes_m],
        "also_inside": list(check.also_inside),
        "anchor_difference_mm": _mm(check.signature_m),
        "point_m": None if check.point_m is None else [round(float(x), 6) for x in check.point_m],
        "status": lesion.status,
        "confidence": round(lesion.confidence, 4),
        "warnings": list(warnings),
    }


def _lines(check: SiteCheck, lesion: RelocatedLesion) -> list[str]:
    """The verdict on a line of its own, then the figures and the reason."""
    lines = [check.verdict]
    if check.distance_m is not None and check.border_m is not None:
        side = "outside" if check.border_m > 0 else "inside"
        lines.append(
            f"{check.distance_m * 1000:.1f} mm from the centre of the region of {lesion.id}, along the skin; "
            f"{abs(check.border_m) * 1000:.1f} mm {side} its border"
        )
    if check.axes_m is not None:
        a, b = check.axes_m
        lines.append(f"region (95 %): half axes {a * 1000:.1f} and {b * 1000:.1f} mm ({lesion.status})")
    return [*lines, check.reason]
