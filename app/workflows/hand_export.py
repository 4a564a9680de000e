"""Tracking a whole recorded sequence, every frame in its order, into files. No Qt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.workflows.hand_rows import open_row
from app.workflows.hand_settings import HandSettings, finder_of
from core.errors import InputError
from core.hand.answer import HandAnswer
from core.hand.tracker import HandTracker
from core.progress import Progress

if TYPE_CHECKING:
    from core.hand.hand_model import HandModel
    from core.hand.landmarks import HandDetector

FORMS = (".json", ".csv")


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes
    ----------
    paths : tuple of Path
    frames : int
    with_hand : int
        Frames in which at least one point is told.
    """

    paths: tuple[Path, ...]
    frames: int
    with_hand: int


def track_all(
    path: Path,
    model: HandModel,
    settings: HandSettings,
    progress: Progress,
    detector: HandDetector | None = None,
) -> list[tuple[str, HandAnswer]]:
    """Answers of every frame of a sequence, without their surfaces.

    Raises
    ------
    GeodermError
        If a frame cannot be read.
    Cancelled
    """
    row = open_row(path)
    try:
        answers: list[tuple[str, HandAnswer]] = []
        tracker: HandTracker | None = None
        for number in range(row.count):
            progress(number / row.count, f"Frame {number + 1} of {row.count}")
            shot = row.read(number)
            if tracker is None:
                tracker = HandTracker(model, shot.rig, finder_of(model, detector), settings.tracking)
            answers.append((shot.name, replace(tracker.track(shot.depth_m, shot.rgb), surface=None)))
        return answers
    finally:
        row.close()


def write_answers(target: Path, answers: list[tuple[str, HandAnswer]]) -> Exported:
    """Write answers as tracks.json or as a table, by the ending of the name.

    Raises
    ------
    InputError
        If the ending is neither ``.json`` nor ``.csv``, or there is nothing to write.
    WorkError
        If it cannot be written.
    """
    from core.hand.tracks import write_csv, write_tracks

    if not answers:
        raise InputError("Nothing was tracked yet.", "Choose a model and play the sequence first.")
    ending = target.suffix.lower()
    if ending not in FORMS:
        raise InputError(f"'{target.name}' is neither .json nor .csv.", "End the name in .json or .csv.")
    if ending == ".json":
        write_tracks(target, answers)
    else:
        write_csv(target, answers)
    return Exported((target,), len(answers), sum(bool(answer.found.any()) for _, answer in answers))
