"""``geoderm capture-info``: checks a capture folder and says what is in it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from app.cli.stored_pixels import entry_as_stored, mirrored_captures

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture
    from core.calibration.profile import CalibrationProfile
    from core.capture import RgbdCapture


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("capture-info")(capture_info)


def capture_info(
    folder: Path = typer.Argument(..., help="A capture folder (geoderm-capture/1)."),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Check a capture folder: frames, coverage of the body, depth noise, joints with visibility, warnings."""
    from core.anchors import analyse_capture
    from core.capture import read_capture
    from devices.trackers import default_tracker

    capture = read_capture(folder)
    calibration = _calibration(folder, capture)
    analysed = analyse_capture(capture, default_tracker())
    if as_json:
        report = capture_report(analysed)
        if mirrored_captures(folder, [folder.name]):
            for joint in report["joints"].values():
                entry_as_stored(joint, capture.rig)
        typer.echo(json.dumps(report, indent=1))
    else:
        typer.echo(_table(folder, analysed, calibration))


def _calibration(folder: Path, capture: RgbdCapture) -> CalibrationProfile | None:
    """The profile the capture was taken with; `InputError` that names the file if it is damaged."""
    if capture.calibration is None:
        return None
    from core.calibration.profile import CalibrationProfile

    return CalibrationProfile.from_document(capture.calibration, f"{folder / 'capture.json'}: calibration")


def capture_report(analysed: AnalysedCapture) -> dict[str, Any]:
    """What ``capture-info --json`` prints.

    Every joint has its place, its picture pixel (``depth_pixel`` if the capture has no colour; null for a
    recorded joint behind the camera) and its visibility.
    """
    key = "pixel" if analysed.capture.color is not None else "depth_pixel"
    return {
        "joints": {
            name: {
                "point_m": [round(float(x), 5) for x in joint.point_m],
                key: [round(float(x), 2) for x in joint.pixel]
                if all(math.isfinite(x) for x in joint.pixel)
                else None,
                "visibility": round(joint.visibility, 3),
            }
            for name, joint in analysed.skeleton.joints.items()
        },
        "frames": len(analysed.capture.depth_frames),
        "body_coverage": round(float(analysed.scan.body_coverage), 4),
        "depth_noise_m": round(float(analysed.scan.depth_noise_m), 6),
        "warnings": list(analysed.warnings),
    }


def _calibration_text(profile: CalibrationProfile | None) -> str:
    if profile is None:
        return "not stated; the folder's own intrinsics are used"
    return f"version {profile.version} of {profile.made_at:%Y-%m-%d}, {profile.views} views ({profile.id})"


def _table(folder: Path, analysed: AnalysedCapture, calibration: CalibrationProfile | None) -> str:
    capture, skeleton = analysed.capture, analysed.skeleton
    depth = capture.rig.depth
    picture = "none (depth only)"
    if capture.rig.color is not None:
        picture = f"{capture.rig.color.width} x {capture.rig.color.height}"
    origin = {
        "color": "colour picture",
        "relief": "depth image",
        "recording": "recording",
        "hand": "placed by hand",
    }[skeleton.source]
    lines = [
        f"Capture        {folder}",
        f"View, stance   {capture.view}, {capture.stance or 'not stated'}",
        f"Taken          {capture.taken_at.isoformat(timespec='seconds')}",
        f"Depth          {len(capture.depth_frames)} frame(s) of {depth.width} x {depth.height}",
        f"Colour         {picture}",
        f"Sensor         {capture.sensor or 'not stated'}",
        f"Calibration    {_calibration_text(calibration)}",
        f"Body coverage  {100 * analysed.scan.body_coverage:.0f} %",
        f"Depth noise    {1000 * analysed.scan.depth_noise_m:.1f} mm",
        f"Joints         {len(skeleton.visible())} of {len(skeleton.joints)} visible, from the {origin}",
        "",
        "Joint             x       y       z (m)   pixel           visibility",
    ]
    for name, joint in skeleton.joints.items():
        x, y, z = joint.point_m
        u, v = joint.pixel
        seen = "" if name in skeleton.visible() else "  not seen"
        lines.append(
            f"{name:<14} {x:7.3f} {y:7.3f} {z:7.3f}   {u:7.1f} {v:7.1f}   {joint.visibility:4.2f}{seen}"
        )
    if analysed.warnings:
        lines += ["", *(f"Warning: {warning}" for warning in analysed.warnings)]
    return "\n".join(lines)
