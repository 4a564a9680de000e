"""``geoderm simulate``: a capture of a simulated patient, as a capture folder or an .oni recording."""

from __future__ import annotations

import json
import os
from pathlib import Path

import typer

from core.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("simulate")(simulate)


def simulate(
    out: Path = typer.Argument(..., help="Capture folder to write, or a file name ending in .oni."),
    shape: str = typer.Option("m_young_avg", help="Body: m_young_avg, f_young_avg, m_tall_thin ..."),
    stance: str = typer.Option("psi", help="Stance: psi, A, T, down, forward, up, knee, twist ..."),
    view: str = typer.Option("front", help="front, back, left or right."),
    visit: int = typer.Option(1, min=1, help="Visit number: the same moles, another day."),
    frames: int = typer.Option(30, min=1, max=300, help="Depth frames."),
    distance: float = typer.Option(2.3, "--distance-m", min=0.8, max=4.0, help="Camera to patient, metres."),
    turn: float = typer.Option(0.0, "--turn-deg", min=-180, max=180, help="Turn of the body, degrees."),
    seed: int = typer.Option(0, help="Seed of the patient's skin and of the noise."),
    sensor: str = typer.Option(
        "kinect-v1",
        help="Depth sensor: kinect-v1, kinect-v2 or realsense-d4xx.",
    ),
    joints: bool = typer.Option(False, "--joints", help="Store the simulator's own joints in the capture."),
) -> None:
    """Write a capture of a simulated patient. The true places of its lesions go into lesions.json."""
    for path in _files_of(out):
        if path.exists() or path.is_symlink():
            raise InputError(f"{path}: exists already.", "Choose another name.")
    if not out.parent.is_dir() or not os.access(out.parent, os.W_OK):
        raise InputError(f"{out}: the folder it would be in does not exist or cannot be written.")
    from core.capture import write_capture
    from devices.simulator import SimulatedPatient, make_rig

    patient = SimulatedPatient(shape=shape, seed=seed, rig=make_rig(sensor=sensor))
    simulated = patient.capture(
        stance=stance,
        view=view,
        visit=visit,
        frames=frames,
        distance_m=distance,
        turn_deg=turn,
        joints=joints,
        seed=seed + visit,
    )
    if out.suffix == ".oni":
        from devices.openni.cameras import write_oni

        write_oni(simulated.capture, out)
        lesions = out.with_suffix(".lesions.json")
    else:
        write_capture(simulated.capture, out)
        lesions = out / "lesions.json"
    truth = simulated.truth
    listed = [
        {"id": str(i), "pixel": [round(float(c), 2) for c in pixel]}
        for i, pixel, seen in zip(truth.mole_ids, truth.mole_pixels, truth.mole_visible, strict=True)
        if seen and str(i) in {str(lesion) for lesion in patient.lesion_ids}
    ]
    partial = lesions.with_name(lesions.name + ".part")
    partial.write_text(json.dumps({"lesions": listed}, indent=1), encoding="utf-8")
    partial.replace(lesions)
    typer.echo(
        f"{out}: {stance}, {view}, visit {visit}, {frames} depth frames, {len(listed)} lesions in view"
    )


def _files_of(out: Path) -> tuple[Path, ...]:
    """What a simulated capture of this name consists of."""
    if out.suffix != ".oni":
        return (out,)
    from devices.openni.calibration import calibration_path, picture_path

    return out, calibration_path(out), picture_path(out), out.with_suffix(".lesions.json")
