"""``geoderm play``: what is in a recording, frame by frame."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from devices.live import LiveFrame


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("play")(play)


def play(
    path: Path = typer.Argument(help=".oni file, capture folder, or folder of capture folders."),
    real_time: bool = typer.Option(
        False, "--real-time", help="At the pace it was recorded; pauses above 1 s are shortened."
    ),
    frames: int | None = typer.Option(None, "--frames", min=1, help="Only the first frames."),
    out: Path | None = typer.Option(None, "--out", help="New folder that gets the frames as captures."),
    as_json: bool = typer.Option(False, "--json", help="Print JSON, with every frame."),
) -> None:
    """Show the frames of a recording: time, depth coverage, distance, colour, rate."""
    from core.errors import InputError, WorkError
    from devices.recordings.sources import open_source

    if out is not None and (out.exists() or out.is_symlink()):
        raise InputError(f"{out}: exists already.", "Choose another name.")
    if out is not None and not out.parent.is_dir():
        raise InputError(f"{out}: the folder it would be in does not exist.")
    source = open_source(path)
    try:
        facts = source.facts()
        if not as_json:
            typer.echo(_heading(path, facts))
        shown: list[dict[str, Any]] = []
        paced = _paced(source.frames()) if real_time else source.frames()
        begun_s = time.monotonic()
        for frame in paced:
            shown.append(_facts_of(frame, shown))
            if not as_json:
                typer.echo(_line(shown[-1]))
            if frames is not None and len(shown) >= frames:
                break
        took_s = time.monotonic() - begun_s
        if not shown:
            raise WorkError(f"{path}: the recording has no frames.", "Choose another recording.")
        summary = _summary(shown, took_s)
        if as_json:
            typer.echo(json.dumps({"recording": _facts_json(facts), **summary, "each": shown}, indent=1))
        else:
            typer.echo(
                f"{summary['frames']} frames over {summary['seconds']:.2f} s ({summary['rate_hz']:.1f}/s "
                f"as recorded), played in {took_s:.2f} s"
            )
        if out is not None:
            _write_captures(source, out, len(shown), quiet=as_json)
    finally:
        source.close()


def _paced(frames: Iterator[LiveFrame]) -> Iterator[LiveFrame]:
    """The frames at the pace they were recorded at; a pause between two bursts is shortened."""
    from devices.recordings.played import LONGEST_GAP_S

    due_s, last_s = time.monotonic(), None
    for frame in frames:
        gap_s = 0.0 if last_s is None else frame.time_s - last_s
        due_s, last_s = due_s + min(max(gap_s, 0.0), LONGEST_GAP_S), frame.time_s
        time.sleep(max(due_s - time.monotonic(), 0.0))
        yield frame


def _facts_of(frame: LiveFrame, before: list[dict[str, Any]]) -> dict[str, Any]:
    import numpy as np

    told: dict[str, Any] = {"number": len(before) + 1, "time_s": round(frame.time_s, 6)}
    if before:
        told["since_last_s"] = round(frame.time_s - before[-1]["time_s"], 6)
    if frame.depth is not None:
        measured = frame.depth[frame.depth > 0]
        told["depth"] = {
            "width": frame.depth.shape[1],
            "height": frame.depth.shape[0],
            "coverage": round(measured.size / frame.depth.size, 4),
            "median_m": round(float(np.median(measured)) * frame.depth_unit_m, 4) if measured.size else None,
        }
    if frame.rgb is not None:
        told["color"] = {"width": frame.rgb.shape[1], "height": frame.rgb.shape[0]}
        told["color_time_s"] = round(frame.color_time_s, 6)
    if frame.infrared is not None:
        told["infrared"] = {"width": frame.infrared.shape[1], "height": frame.infrared.shape[0]}
    return told


def _line(told: dict[str, Any]) -> str:
    parts = [f"{told['number']:5d}  {told['time_s']:9.3f} s"]
    if "depth" in told:
        depth = told["depth"]
        distance = "no depth" if depth["median_m"] is None else f"{depth['median_m']:.3f} m"
        parts.append(f"depth {100 * depth['coverage']:5.1f} % of {depth['width']} x {depth['height']}")
        parts.append(distance)
    for name, word in (("color", "colour"), ("infrared", "infrared")):
        if name in told:
            parts.append(f"{word} {told[name]['width']} x {told[name]['height']}")
    return "  ".join(parts)


def _summary(shown: list[dict[str, Any]], took_s: float) -> dict[str, Any]:
    seconds = shown[-1]["time_s"] - shown[0]["time_s"]
    rate = (len(shown) - 1) / seconds if seconds > 0 else 0.0
    return {
        "frames": len(shown),
        "seconds": round(seconds, 6),
        "rate_hz": round(rate, 3),
        "played_in_s": round(took_s, 3),
    }


def _heading(path: Path, facts: Any) -> str:
    calibration = facts.calibration
    state = "calibration " + calibration["id"] if calibration else "no calibration profile"
    return (
        f"{path}: {facts.frames or 'unknown number of'} frames, {facts.sensor or 'unknown sensor'}, {state}"
    )


def _facts_json(facts: Any) -> dict[str, Any]:
    return {
        "name": facts.name,
        "sensor": facts.sensor,
        "calibration": None if facts.calibration is None else facts.calibration["id"],
        "warnings": list(facts.warnings),
    }


def _write_captures(source: Any, out: Path, frames: int, *, quiet: bool) -> None:
    import threading

    from devices.recordings.recorder import Limits, record

    report = record(source, out, Limits(None, frames, threading.Event()), burst=min(frames, 30))
    if not quiet:
        typer.echo(f"{report.path}: {report.frames} frames in capture folders")
