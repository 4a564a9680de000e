"""A dataset in the making: what is labelled, storing frames, learning a model from it. No Qt."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from app.workflows.hand_rows import HandShot
from app.workflows.hand_settings import HandSettings, empty_model, finder_of
from core.capture import read_capture, write_capture
from core.capture.folder import CAPTURE_FILE
from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.hand.dataset import configuration_name, dataset_frames, read_labels, write_labels
from core.hand.labels import FrameLabels
from core.hand.model import LEAST_FRAMES
from core.progress import Progress

if TYPE_CHECKING:
    from core.hand.landmarks import HandDetector
    from core.hand.learning import Lesson


class HandDataset:
    """A folder of capture folders, some of them labelled.

    Parameters
    ----------
    folder : Path
        May be empty, or not be there yet.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def captures(self) -> list[Path]:
        """Capture folders in name order; none in an empty folder."""
        if not self.folder.is_dir() or not any(self.folder.glob(f"*/{CAPTURE_FILE}")):
            return [] if not (self.folder / CAPTURE_FILE).exists() else [self.folder]
        return dataset_frames(self.folder)

    def counts(self) -> dict[str, int]:
        """Labelled frames of every configuration, in name order.

        Raises
        ------
        InputError
            If a frame's labels are damaged.
        """
        labelled = (read_labels(capture) for capture in self.captures())
        counted = Counter(
            labels.configuration
            for labels in labelled
            if labels is not None and labels.configuration is not None and labels.points_m
        )
        return dict(sorted(counted.items()))

    def store(self, shot: HandShot, labels: FrameLabels) -> Path:
        """Store a frame's labels beside it; a frame that is in no folder yet becomes a capture here.

        Raises
        ------
        InputError
            If there is nothing to store, or the configuration has no name.
        WorkError
            If it cannot be written.
        """
        if not labels.points_m:
            raise InputError("No point is placed yet.", "Click at least one point, then save.")
        configuration_name(labels.configuration or "")
        folder = shot.folder
        if folder is None:
            folder = self.folder / self._free_name()
            write_capture(shot.capture(), folder)
        write_labels(folder, labels)
        return folder

    def _free_name(self) -> str:
        number = 1 + len(self.captures())
        while (self.folder / f"frame_{number:04d}").exists():
            number += 1
        return f"frame_{number:04d}"

    def learn(
        self, settings: HandSettings, progress: Progress, detector: HandDetector | None = None
    ) -> Lesson:
        """Learn a model from all labelled frames; some seconds.

        Raises
        ------
        InputError
            If too little is labelled, with what is missing.
        Cancelled
            Through ``progress``.
        """
        from core.hand.learning import learn_hand

        counts = self.counts()
        short = [f"'{name}' has {n}" for name, n in counts.items() if n < LEAST_FRAMES]
        if not counts or len(short) == len(counts):
            have = f" {', '.join(short)}." if short else ""
            raise InputError(
                f"Too few frames are labelled.{have}",
                f"Label at least {LEAST_FRAMES} frames of each configuration: one frame shows no spread.",
            )
        return learn_hand(
            self._labelled(),
            finder_of(empty_model(settings), detector),
            dictionary=settings.dictionary,
            marker_m=settings.marker_m,
            count=sum(counts.values()),
            progress=progress,
        )

    def _labelled(self) -> Iterator[tuple[str, RgbdCapture, FrameLabels]]:
        for folder in self.captures():
            labels = read_labels(folder)
            if labels is not None and labels.points_m and labels.configuration is not None:
                yield folder.name, read_capture(folder), labels
