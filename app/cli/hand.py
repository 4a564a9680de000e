"""``geoderm hand``: joints of a hand by geodesics from a marker; train a model, track a sequence."""

from __future__ import annotations

import json
import os
import time
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from core.errors import InputError, WorkError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from core.capture import CameraRig, RgbdCapture
    from core.hand.anchors import AnchorFinder
    from core.hand.hand_model import HandModel
    from core.hand.labels import FrameLabels
    from core.hand.tracker import TrackingOptions
    from core.hand.tracks import Tracks

_OF_A_SEQUENCE = ("capture.json", "hand.json", "sequence.json")


class Anchors(StrEnum):
    """From where distances are measured."""

    MARKER = "marker"
    PALM = "palm"


class Refinement(StrEnum):
    """How candidates of the points are decided between."""

    JOINT = "joint"
    SEQUENTIAL = "sequential"


def register(app: typer.Typer) -> None:
    """Add the command group."""
    from app.cli import hand_marker, hand_simulate, hand_window

    group = typer.Typer(
        help="Joints of a hand by geodesics.", no_args_is_help=True, pretty_exceptions_enable=False
    )
    group.callback()(_group)
    group.command("train")(train)
    group.command("track")(track)
    hand_marker.register(group)
    hand_simulate.register(group)
    hand_window.register(group)
    app.add_typer(group, name="hand")


def _group() -> None:
    """Joints of a hand by geodesics from a marker on its back."""


def train(
    dataset: Path = typer.Argument(
        ..., metavar="DATASET", help="Folder of capture folders, labelled by a hand.json each."
    ),
    out: Path = typer.Option(..., "--out", help="Model file to write."),
    marker_m: float = typer.Option(0.036, "--marker-m", help="Side of the marker's black square, metres."),
    dictionary: str = typer.Option("DICT_4X4_50", "--dictionary", help="ArUco dictionary of the marker."),
    anchors: Anchors = typer.Option(
        Anchors.MARKER, "--anchors", help="marker, or palm: landmarks of the palm, no marker."
    ),
    tree_picture: Path | None = typer.Option(
        None, "--tree-picture", help="Picture of the decision tree to write: NAME.png or NAME.svg."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Learn a hand's configurations and distances from labelled frames."""
    from app.cli import hand_words
    from core.hand.dataset import LABELS_FILE, dataset_frames
    from core.hand.hand_model import HandModel
    from core.hand.learning import learn_hand
    from core.hand.model_file import check_marker, write_model

    check_marker(marker_m, dictionary)
    _check_out("--out", out)
    _check_tree_picture(tree_picture)
    _check_apart({"--out": out, "--tree-picture": tree_picture}, {})
    folders = dataset_frames(dataset)
    labelled = [folder for folder in folders if (folder / LABELS_FILE).exists()]
    if not labelled:
        raise InputError(
            f"{dataset}: none of its {len(folders)} captures has a {LABELS_FILE}.",
            "Label frames first: geoderm hand window.",
        )
    begun_s = time.monotonic()
    with _finder(HandModel({}, None, anchors.value, marker_m, dictionary), follow=False) as finder:
        try:
            lesson = learn_hand(
                _labelled(labelled),
                finder,
                dictionary=dictionary,
                marker_m=marker_m,
                count=len(labelled),
                progress=hand_words.Ticker(),
            )
        except InputError as error:
            if error.message.startswith(str(dataset)):  # of a file in it
                raise
            raise InputError(f"{dataset}: {error.message}", error.advice) from error
    write_model(out, lesson.model)
    if tree_picture is not None and lesson.model.tree is not None:
        from core.evaluation.hand_tree_picture import write_tree_picture

        write_tree_picture(tree_picture, lesson.model.tree)
    told = hand_words.lesson_document(lesson, out, len(folders) - len(labelled), time.monotonic() - begun_s)
    typer.echo(json.dumps(told, indent=1) if as_json else "\n".join(hand_words.lesson_lines(told)))
    if tree_picture is not None and lesson.model.tree is None:
        typer.echo("warning: there is no tree to draw with a single configuration.", err=True)


def track(
    model_file: Path = typer.Argument(..., metavar="MODEL", help="Model file of geoderm hand train."),
    sequence: Path = typer.Argument(
        ..., metavar="SEQUENCE", help="Folder of capture folders, a capture folder, or .oni file."
    ),
    out: Path = typer.Option(..., "--out", help="tracks.json to write."),
    marker_m: float | None = typer.Option(
        None, "--marker-m", help="Side of the marker, if it is another than the model's."
    ),
    dictionary: str | None = typer.Option(
        None, "--dictionary", help="ArUco dictionary, if it is another than the model's."
    ),
    csv: Path | None = typer.Option(None, "--csv", help="Table to write: one row per frame and point."),
    refinement: Refinement = typer.Option(
        Refinement.JOINT, "--refinement", help="joint: all points together; sequential: as the thesis."
    ),
    threshold_mm: float | None = typer.Option(
        None, "--threshold-mm", min=1.0, max=100.0, help="Points that fit worse are not reported."
    ),
    configuration: str | None = typer.Option(
        None, "--configuration", help="The hand's configuration, where it is known; otherwise it is judged."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON instead of a table."),
) -> None:
    """Find the 15 points of a hand in every frame of a sequence."""
    from app.cli import hand_words
    from core.hand.model_file import read_model
    from core.hand.tracker import TrackingOptions
    from core.hand.tracks import write_csv, write_tracks

    _check_out("--out", out)
    _check_out("--csv", csv)
    _check_apart({"--out": out, "--csv": csv}, {"MODEL": model_file, "SEQUENCE": sequence})
    model = _overridden(read_model(model_file), marker_m, dictionary)
    if configuration is not None and configuration not in model.configurations:
        raise InputError(
            f"{model_file}: there is no configuration '{configuration[:60]}'.",
            f"It knows {', '.join(model.configurations)}.",
        )
    options = TrackingOptions(refinement=refinement.value, configuration=configuration)
    if threshold_mm is not None:
        options = replace(options, threshold_m=threshold_mm / 1000.0)
    tracks, times_s = _followed(model, sequence, options)
    write_tracks(out, tracks)
    if csv is not None:
        write_csv(csv, tracks)
    told = hand_words.tracks_document(tracks, out, times_s)
    typer.echo(json.dumps(told, indent=1) if as_json else "\n".join(hand_words.tracks_lines(told)))


def _followed(model: HandModel, sequence: Path, options: TrackingOptions) -> tuple[Tracks, list[float]]:
    """Tracks of a sequence, and the seconds that tracking alone took for each frame."""
    from app.cli import hand_words
    from app.cli.hand_frames import same_rig, sequence_frames
    from core.hand.tracker import HandTracker
    from core.hand.tracks import TrackedFrame, Tracks, tracked_frame

    count, frames = sequence_frames(sequence)
    ticker = hand_words.Ticker()
    times_s: list[float] = []
    kept: list[TrackedFrame] = []
    tracker: HandTracker | None = None
    rig: CameraRig | None = None
    with _finder(model, follow=True) as finder:
        for frame in frames:
            ticker(len(kept) / count if count else 0.0, f"Tracking {frame.name}")
            begun_s = time.perf_counter()
            if tracker is None or rig is None or not same_rig(rig, frame.rig):
                rig = frame.rig
                tracker = HandTracker(model, rig, finder, options)
            answer = tracker.track(frame.depth_m, frame.rgb)
            times_s.append(time.perf_counter() - begun_s)
            kept.append(tracked_frame(frame.name, answer, frame.stored_width))
    ticker(1.0)
    if not kept:
        raise InputError(f"{sequence}: has no frames.", "Choose another recording.")
    return Tracks(tuple(kept)), times_s


def _labelled(folders: list[Path]) -> Iterator[tuple[str, RgbdCapture, FrameLabels]]:
    """Labelled captures, read one at a time."""
    from app.cli.hand_frames import capture_name
    from core.capture import read_capture
    from core.hand.dataset import read_labels
    from core.hand.labels import FrameLabels

    for folder in folders:
        labels = read_labels(folder) or FrameLabels()
        yield capture_name(folder), read_capture(folder), labels


@contextmanager
def _finder(model: HandModel, *, follow: bool) -> Iterator[AnchorFinder]:
    """What finds the anchors; the hand detector that the palm's need is closed afterwards."""
    from core.hand.finders import finder_for

    if model.anchors == "marker":
        yield finder_for(model)
        return
    from devices.trackers.mediapipe_hands import HandFollower, MediaPipeHands

    detector = HandFollower() if follow else MediaPipeHands()
    try:
        yield finder_for(model, detector)
    finally:
        detector.close()


def _overridden(model: HandModel, marker_m: float | None, dictionary: str | None) -> HandModel:
    """The model with another marker, which is told."""
    from core.hand.model_file import check_marker

    check_marker(
        model.marker_m if marker_m is None else marker_m, dictionary if dictionary else model.dictionary
    )
    if model.anchors != "marker":
        if marker_m is not None or dictionary is not None:
            typer.echo(
                "warning: the model needs no marker: --marker-m and --dictionary are ignored.", err=True
            )
        return model
    if marker_m is not None and abs(marker_m - model.marker_m) > 1e-6:
        typer.echo(
            f"warning: --marker-m {marker_m:g} is not the {model.marker_m:g} m of the model: its distances "
            "are from the corners of that one.",
            err=True,
        )
        model = replace(model, marker_m=marker_m)
    if dictionary is not None and dictionary != model.dictionary:
        typer.echo(
            f"warning: --dictionary {dictionary} is not the model's {model.dictionary}.",
            err=True,
        )
        model = replace(model, dictionary=dictionary)
    return model


def _check_out(option: str, path: Path | None) -> None:
    """Refuse a file that cannot be written before the work is done for nothing."""
    if path is None:
        return
    try:
        if path.is_dir():
            raise InputError(f"{option} {path}: is a folder.", "Give the name of a file.")
        folder = path.resolve().parent
        if path.exists() and not path.is_file():  # a device or pipe
            writable = os.access(path, os.W_OK)
        elif not folder.is_dir():
            raise InputError(f"{option} {path}: the folder does not exist.", "Create it or choose another.")
        else:
            writable = os.access(folder, os.W_OK | os.X_OK)
    except (OSError, RuntimeError) as error:  # RuntimeError: links in a circle, before Python 3.13
        raise InputError(f"{option} {str(path)[:300]}: is no name for a file.") from error
    if not writable:
        raise WorkError(f"{option} {path}: cannot be written.", "Choose a folder that you may write to.")
    if path.name in _OF_A_SEQUENCE and path.exists():
        raise InputError(
            f"{option} {path}: is a file of a sequence, which would be lost.", "Give another name."
        )


def _check_apart(outs: dict[str, Path | None], ins: dict[str, Path]) -> None:
    """Refuse to write a file that is read, or two into one."""
    taken = {path.resolve(): option for option, path in ins.items()}
    for option, path in outs.items():
        if path is None or (path.exists() and not path.is_file()):
            continue
        if path.resolve() in taken:
            raise InputError(
                f"{option} {path}: is the file of {taken[path.resolve()]}, too.", "Give another name."
            )
        taken[path.resolve()] = option


def _check_tree_picture(path: Path | None) -> None:
    _check_out("--tree-picture", path)
    if path is not None and path.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"--tree-picture {path}: the name must end in .png or .svg.")
