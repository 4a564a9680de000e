"""``geoderm devices``: which cameras can be opened now."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from core.calibration.profile import ProfileStore
    from devices.camera import DeviceInfo


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("devices")(devices)


def devices(
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
    modes: bool = typer.Option(
        False, "--modes", help="Open each connected camera and show its modes and settings as well."
    ),
    profiles: Path | None = typer.Option(
        None, "--profiles", help="Folder of calibration profiles; the workstation's by default."
    ),
) -> None:
    """List the cameras, live and simulated. Recordings and folders are opened by their path.

    Connected cameras are opened for a moment to ask for serial number, sensor and calibration.
    """
    from app.paths import calibration_dir
    from core.calibration.profile import ProfileStore
    from core.errors import InputError

    if profiles is not None and not profiles.is_dir():
        raise InputError(f"{profiles}: there is no such folder of calibration profiles.")
    store = ProfileStore(profiles or calibration_dir())
    found, notes = _find()
    described = [_describe(info, store, details=as_json or modes) for info in found]
    if as_json:
        typer.echo(json.dumps(described, indent=1))
        for note in notes:
            if note.startswith("The OpenNI2 runtime was not found"):
                typer.echo(note, err=True)
        return
    width = max((len(d["id"]) for d in described), default=0)
    for device in described:
        typer.echo(f"{device['id']:<{width}}  {device['name']}{_remarks(device)}")
        for mode in device.get("modes", ()) if modes else ():
            typer.echo(
                f"    {mode['kind']:<9} {mode['width']} x {mode['height']} at {mode['fps']}/s, "
                f"{mode['pixel_format']}"
            )
        for control in device.get("controls", ()) if modes else ():
            typer.echo(
                f"    {control['name']} = {control['value']:g} "
                f"({control['minimum']:g} to {control['maximum']:g})"
            )
    for note in notes:
        typer.echo(note)


def _find() -> tuple[list[DeviceInfo], list[str]]:
    """Devices of all kinds, and what is to be said about kinds without any."""
    from core.errors import WorkError
    from devices.openni.cameras import find_cameras
    from devices.registry import camera_kinds, list_devices

    found, notes = [], []
    for kind in camera_kinds():
        if kind != "openni":
            found += list_devices(kind)
            continue
        try:
            cameras = find_cameras()
        except WorkError as error:
            notes.append(str(error))
            continue
        found += cameras
        if not cameras:
            notes.append("The OpenNI2 runtime is installed; no OpenNI2 camera is connected.")
    if "realsense" in camera_kinds() and not any(d.kind == "realsense" for d in found):
        notes.append(_about_realsense())
    return found, notes


def _about_realsense() -> str:
    from importlib.util import find_spec

    if find_spec("pyrealsense2") is None:
        return "RealSense: pyrealsense2 is not installed (pip install geoderm[realsense])."
    return "RealSense: pyrealsense2 is installed; no RealSense camera is connected."


def _describe(info: DeviceInfo, store: ProfileStore, *, details: bool) -> dict[str, Any]:
    """What is known about a device; a connected camera is opened for it, a simulated one is not."""
    from core.errors import GeodermError
    from devices.live import LiveCamera
    from devices.registry import camera_factory

    told: dict[str, Any] = {"id": info.id, "name": info.name, "kind": info.kind, "live": info.live}
    if not info.live or info.kind == "simulator":
        return told
    kind, _, address = info.id.partition(":")
    try:
        camera = camera_factory(kind).create(address)
        with camera:
            if not isinstance(camera, LiveCamera):
                return told
            identity = camera.identity
            profile = store.newest(identity.depth_serial, identity.color_serial)
            told |= {
                "model": identity.model,
                "serial": identity.depth_serial,
                "color_serial": identity.color_serial,
                "serial_lasts": identity.lasting,
                "sensor": identity.sensor,
                "calibration": None
                if profile is None
                else {"version": profile.version, "made_at": profile.made_at.isoformat(), "id": profile.id},
            }
            if details:
                told["modes"] = [vars(mode) for mode in camera.modes()]
                told["controls"] = [vars(control) for control in camera.controls()]
    except GeodermError as error:
        told["problem"] = str(error)
    return told


def _remarks(device: dict[str, Any]) -> str:
    if "problem" in device:
        return f" [{device['problem']}]"
    if "serial" not in device:
        return ""
    serial = f"serial number {device['serial']}" if device["serial_lasts"] else "tells no serial number"
    sensor = device["sensor"] or "unknown sensor"
    calibration = device["calibration"]
    state = (
        "not calibrated"
        if calibration is None
        else f"calibrated {calibration['made_at'][:10]} (version {calibration['version']})"
    )
    return f" [{serial}, {sensor}, {state}]"
