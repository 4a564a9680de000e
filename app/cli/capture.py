"""``geoderm capture``: takes a capture with any camera, or says why it is not good."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from core.capture.rgbd import RgbdCapture
    from core.surface.scan import BodyScan
    from devices.camera import DepthCamera
    from devices.live import LiveCamera

LEAST_COVERAGE = 0.5
"""With less of the body's outline measured, skin is missing nearly everywhere: not a capture to keep."""

_STILL_M = 0.006
_STILL_FOR_S = 1.0
_LOOK_BACK_S = 0.5


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("capture")(capture)


def capture(
    device: str = typer.Argument(..., help="Camera as `geoderm devices` lists it, or rig:DEPTH|COLOR."),
    out: Path = typer.Argument(..., help="Capture folder to write; must not exist."),
    frames: int = typer.Option(30, min=1, max=300, help="Depth frames."),
    view: str = typer.Option("front", help="front, back, left, right, or a name."),
    stance: str = typer.Option("", help="Stance, such as psi."),
    when_still: bool = typer.Option(False, "--when-still", help="Wait until the patient holds still."),
    wait_s: float = typer.Option(30.0, "--wait-s", min=0.0, max=600.0, help="Longest wait, seconds."),
    profiles: Path | None = typer.Option(
        None, "--profiles", help="Folder of calibration profiles; the workstation's own by default."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of text."),
) -> None:
    """Take one capture: depth frames and a picture of the same moment, with the newest calibration.

    The capture is written only if a body is seen well enough (exit code 3 and the reason otherwise).
    """
    _check_target(out)
    if profiles is not None and not profiles.is_dir():
        raise InputError(f"{profiles}: there is no such folder of calibration profiles.")
    from app.paths import calibration_dir
    from app.workflows.analysis import take
    from core.calibration.profile import CalibrationProfile, ProfileStore
    from core.surface.scan import scan_body
    from devices.live import LiveCamera
    from devices.registry import open_device

    store = ProfileStore(profiles or calibration_dir())
    camera = open_device(device, store)
    with camera:
        if when_still:
            if not isinstance(camera, LiveCamera):
                raise InputError(f"{device}: --when-still needs a camera that sees the present.")
            _wait_until_still(camera, wait_s)
        taken = take(camera, view=view, stance=stance or None, frames=frames, progress=_Shown(as_json))
        pairing = _pairing(camera)
    if taken.calibration is not None:
        profile = CalibrationProfile.from_document(taken.calibration, f"{device}: calibration")
        taken = replace(taken, calibration=profile.document())
    try:
        scan = scan_body(taken)
    except WorkError as error:
        raise WorkError(f"The capture was not kept. {error.message}", error.advice) from error
    if scan.body_coverage < LEAST_COVERAGE:
        raise WorkError(
            f"The capture was not kept: only {scan.body_coverage:.0%} of the body's outline was measured.",
            "Stand 1.5 to 3 metres away; avoid sunlight and dark or shiny clothing, then take it again.",
        )
    _write(taken, out)
    report = _report(device, out, taken, scan, pairing)
    typer.echo(json.dumps(report, indent=1) if as_json else _text(report))


def _check_target(out: Path) -> None:
    if out.exists() or out.is_symlink():
        raise InputError(f"{out}: exists already.", "Choose another name.")
    if not out.parent.is_dir() or not os.access(out.parent, os.W_OK):
        raise InputError(f"{out}: the folder it would be in does not exist or cannot be written.")


def _write(taken: RgbdCapture, out: Path) -> None:
    from core.capture import write_capture

    _check_target(out)
    try:
        with tempfile.TemporaryDirectory(prefix=f".{out.name[:50]}-", dir=out.parent) as staging:
            staged = Path(staging) / "capture"
            try:
                write_capture(taken, staged)
            except InputError as error:
                raise InputError(error.message.replace(str(staged), str(out)), error.advice) from error
            # A folder with something in it is not replaced: of two captures with one name, one is refused.
            staged.rename(out)
    except OSError as error:
        if out.exists():
            raise InputError(f"{out}: exists already.", "Choose another name.") from error
        raise InputError(
            f"{out}: the capture cannot be written ({error.strerror or error}).",
            "Check the folder's permissions and the free space.",
        ) from error


class _Shown:
    """Progress on a terminal's standard error; nothing where there is no terminal."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet or not sys.stderr.isatty()
        self._last = ""

    def __call__(self, fraction: float, message: str = "") -> None:
        """Show a message when it changes."""
        if not self._quiet and message and message != self._last:
            self._last = message
            typer.echo(message, err=True)


def _wait_until_still(camera: LiveCamera, wait_s: float) -> None:
    """Return when the body has moved less than 6 mm in half a second, for a second."""
    from devices.auxiliary.pairing import DepthTrail

    trail = DepthTrail(camera.rig.depth)
    deadline, number = time.monotonic() + wait_s, 0
    still_since: float | None = None
    moved: float | None = None
    while time.monotonic() < deadline:
        frame = camera.latest(number, 0.5)
        if frame is None or frame.depth is None:
            continue
        number = frame.number
        trail.add(frame.time_s, frame.depth, frame.depth_unit_m)
        moved = trail.moved_m(frame.time_s - _LOOK_BACK_S, frame.time_s)
        if moved is None or moved > _STILL_M:
            still_since = None
        elif still_since is None:
            still_since = frame.time_s
        elif frame.time_s - still_since >= _STILL_FOR_S:
            return
    if moved is None:
        raise WorkError(
            f"No body was seen before the camera for {wait_s:g} seconds.",
            "Stand before the camera, 1.5 to 3 metres away.",
        )
    raise WorkError(
        f"The patient did not hold still within {wait_s:g} seconds (last {1000 * moved:.0f} mm in half a "
        "second).",
        "Ask the patient to hold still, or take it without --when-still.",
    )


def _pairing(camera: DepthCamera) -> dict[str, Any] | None:
    """Gap and movement between depth and picture, where two cameras were grabbed together."""
    found = getattr(camera, "last_pairing", None)
    if found is None:
        return None
    moved = found.moved_m
    return {
        "gap_s": round(found.gap_s, 4),
        "moved_m": None if moved is None else round(moved, 5),
    }


def _report(
    device: str, out: Path, taken: RgbdCapture, scan: BodyScan, pairing: dict[str, Any] | None
) -> dict[str, Any]:
    picture, calibration = taken.rig.color, taken.calibration
    return {
        "folder": str(out),
        "device": device,
        "view": taken.view,
        "stance": taken.stance,
        "taken_at": taken.taken_at.isoformat(),
        "frames": len(taken.depth_frames),
        "depth": [taken.rig.depth.width, taken.rig.depth.height],
        "picture": None if picture is None else [picture.width, picture.height],
        "sensor": taken.sensor or None,
        "calibration": None
        if calibration is None
        else {"id": calibration["id"], "version": calibration["version"]},
        "body_coverage": round(float(scan.body_coverage), 4),
        "depth_noise_m": round(float(scan.depth_noise_m), 6),
        "motion_m": _motion(taken),
        "pairing": pairing,
        "warnings": list(dict.fromkeys((*taken.warnings, *scan.warnings))),
    }


def _motion(taken: RgbdCapture) -> float | None:
    """Movement of the body within the burst; None if it cannot be told (a single frame)."""
    from devices.auxiliary.body_motion import motion_within

    motion = motion_within(taken.depth_frames, taken.depth_unit_m, taken.rig.depth)
    return None if motion is None else round(motion.moved_m, 5)


def _text(report: dict[str, Any]) -> str:
    picture = "no picture" if report["picture"] is None else "picture of {} x {}".format(*report["picture"])
    calibration = (
        "none; nominal or factory geometry"
        if report["calibration"] is None
        else f"version {report['calibration']['version']} ({report['calibration']['id']})"
    )
    motion = "not measured" if report["motion_m"] is None else f"{1000 * report['motion_m']:.1f} mm"
    lines = [
        f"Capture        {report['folder']}",
        f"View, stance   {report['view']}, {report['stance'] or 'not stated'}",
        f"Frames         {report['frames']} of {report['depth'][0]} x {report['depth'][1]}, {picture}",
        f"Calibration    {calibration}",
        f"Body coverage  {100 * report['body_coverage']:.0f} %",
        f"Depth noise    {1000 * report['depth_noise_m']:.1f} mm",
        f"Movement       {motion}",
    ]
    if report["pairing"] is not None:
        moved = report["pairing"]["moved_m"]
        lines.append(
            f"Picture        {1000 * report['pairing']['gap_s']:+.0f} ms from the depth, movement "
            + ("not measured" if moved is None else f"{1000 * moved:.1f} mm")
        )
    lines += [f"Warning: {warning}" for warning in report["warnings"]]
    return "\n".join(lines)
