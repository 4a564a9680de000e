"""``geoderm hand simulate``: frames of a simulated hand with a marker, with their truth."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from devices.simulator.hands.scene import HandFrame

_TRAINING = "training"
_MOST_FRAMES = 9999


def register(group: typer.Typer) -> None:
    """Add the command."""
    group.command("simulate")(simulate)


def simulate(
    out: Path = typer.Argument(..., help="Folder to write; must not exist."),
    kind: str = typer.Option(
        _TRAINING,
        help="training, large-displacements, configurations, occlusion, bottle or marker-lost.",
    ),
    frames: int | None = typer.Option(
        None, min=1, max=_MOST_FRAMES, help="Frames; as many as the kind needs if not given."
    ),
    shape: str = typer.Option("m_young_avg", help="Body whose hand it is: m_young_avg, f_young_avg ..."),
    side: str = typer.Option("R", help="Right hand R or left hand L."),
    seed: int = typer.Option(0, min=0, max=2**31 - 1, help="Seed of marker, skin, motion and noise."),
    configurations: str = typer.Option(
        "", help="Configurations in the order of training, with commas: open,fist,point,two,grip,pinch."
    ),
    labelled: bool = typer.Option(True, "--labelled/--unlabelled", help="Write hand.json with the truth."),
    marker_m: float = typer.Option(0.036, "--marker-m", help="Side of the marker, metres; 0 for none."),
    dictionary: str = typer.Option("DICT_4X4_50", help="ArUco dictionary of the marker."),
    rate_hz: float = typer.Option(30.0, "--rate-hz", min=1.0, max=120.0, help="Frames per second."),
    sensor: str = typer.Option("kinect-v1", help="Depth sensor: kinect-v1, kinect-v2 or realsense-d4xx."),
) -> None:
    """Write frames of a simulated hand with a marker as capture folders, to train and track with.

    The same options give the same frames. Beside them lies sequence.json: the folder can be played.
    """
    if out.exists() or out.is_symlink():
        raise InputError(f"{out}: exists already.", "Choose another name.")
    taken, count = _taken(
        kind, frames, shape, side, seed, configurations, marker_m, dictionary, rate_hz, sensor
    )
    try:
        out.mkdir()
    except OSError as error:
        raise InputError(f"{out}: cannot be made ({error.strerror}).", "Choose another place.") from error
    try:
        seen = _write(out, taken, count, labelled, sensor)
    except BaseException as error:  # Ctrl-C, too: no half sequence stays
        shutil.rmtree(out, ignore_errors=True)
        if isinstance(error, OSError):
            raise WorkError(
                f"{out}: could not be written ({error.strerror}).", "Check the free space."
            ) from error
        raise
    words = "labelled" if labelled else "not labelled"
    typer.echo(f"{out}: {kind}, {count} frames, {words}; {seen:.1f} of 15 points visible in the mean")


def _taken(
    kind: str,
    frames: int | None,
    shape: str,
    side: str,
    seed: int,
    configurations: str,
    marker_m: float,
    dictionary: str,
    rate_hz: float,
    sensor: str,
) -> tuple[Iterator[HandFrame], int]:
    """The frames to come and how many, after every option has been checked."""
    from devices.simulator.hands.sequence import (
        SEQUENCES,
        USUAL_FRAMES,
        checked_configurations,
        hand_sequence,
        training_frames,
    )
    from devices.simulator.hands.shots import Holder, checked_holder
    from devices.simulator.room import make_rig

    if kind != _TRAINING and kind not in SEQUENCES:
        raise InputError(
            f"--kind: there is no simulated hand '{kind}'.", f"Choose {_TRAINING}, {', '.join(SEQUENCES)}."
        )
    names = checked_configurations([name.strip() for name in configurations.split(",") if name.strip()])
    holder = checked_holder(Holder(shape, side, seed, marker_m, dictionary))
    rig = make_rig((640, 480), device_seed=seed, sensor=sensor)
    count = frames or USUAL_FRAMES.get(kind, 60)
    if kind == _TRAINING:
        return (
            training_frames(holder, count, seed=seed, configurations=names, rig=rig, rate_hz=rate_hz),
            count,
        )
    taken = hand_sequence(kind, holder, count, seed=seed, configurations=names, rate_hz=rate_hz, rig=rig)
    return taken, count


def _write(out: Path, taken: Iterator[HandFrame], count: int, labelled: bool, sensor: str) -> float:
    """Write all frames; return how many points are visible in the mean."""
    from dataclasses import replace

    from core.capture import write_capture
    from core.hand.dataset import write_labels
    from devices.recordings.sources import write_sequence

    entries: list[dict[str, Any]] = []
    seen = 0
    digits = max(4, len(str(count)))
    for number, frame in enumerate(taken, start=1):
        name = f"frame_{number:0{digits}d}"
        write_capture(replace(frame.capture, sensor=sensor), out / name)
        if labelled:
            write_labels(out / name, frame.labels())
        entries.append({"folder": name, "times_s": [frame.time_s], "color_time_s": frame.time_s})
        seen += sum(frame.visible.values())
    write_sequence(out, entries, nominal=False)
    return seen / max(len(entries), 1)
