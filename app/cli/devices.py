"""``geoderm devices``: which cameras can be opened now."""

from __future__ import annotations

import json

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("devices")(devices)


def devices(
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """List the cameras, live and simulated. Recordings and folders are opened by their path."""
    from devices.registry import list_devices

    found = list_devices()
    if as_json:
        typer.echo(
            json.dumps(
                [{"id": d.id, "name": d.name, "kind": d.kind, "live": d.live} for d in found], indent=1
            )
        )
        return
    width = max((len(d.id) for d in found), default=0)
    for device in found:
        typer.echo(f"{device.id:<{width}}  {device.name}")
    if not any(d.kind == "openni" for d in found):
        typer.echo("No OpenNI2 camera is connected.")
