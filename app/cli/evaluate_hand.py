"""``geoderm evaluate hand``: the experiments on the hand tracker, on simulated hands."""

from __future__ import annotations

import json
import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from core.errors import InputError

if TYPE_CHECKING:
    from core.evaluation.hand.experiments import FinderMaker
    from core.evaluation.hand.frames import HandSets
    from core.evaluation.hand.measured_files import MeasuredFiles
    from core.evaluation.hand.run import Makers, Outcome
    from core.hand.landmarks import HandDetector
    from core.progress import Progress

CACHE_VARIABLE = "GEODERM_SIMULATED_HANDS"
"""Environment variable naming the folder in which frames of simulated hands are kept."""


def register(group: typer.Typer) -> None:
    """Add the command."""
    group.command("hand")(hand)


def hand(
    only: str = typer.Option(
        "",
        help="Experiments separated by commas: classifier, large, occlusion, bottle, lost, palm. "
        "Default: all.",
    ),
    split: str = typer.Option(
        "test", help="test; or tuning: some of the hands that parameters were chosen on, the others learned."
    ),
    quick: bool = typer.Option(False, "--quick", help="Few frames of few hands: a trial, not a result."),
    cache: Path | None = typer.Option(
        None, "--cache", envvar=CACHE_VARIABLE, help="Folder that keeps simulated frames for the next run."
    ),
    real: Path | None = typer.Option(
        None, "--real", help="Folder with depth pictures of a real hand (SR305)."
    ),
    out: Path | None = typer.Option(None, "--out", help="Folder for hand.json, report.md and pictures."),
    pictures: bool = typer.Option(True, help="Draw the pictures; needs --out."),
) -> None:
    """Measure the hand tracker on simulated hands: large displacements, configurations, occlusions, a bottle.

    Hands to learn from and hands to be tested on differ in shape, marker, view and noise.
    """
    from app.cli.evaluate import tell

    if split not in ("test", "tuning"):
        raise InputError(f"There is no split '{split}'.", "Choose test or tuning.")
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot be made ({error.strerror or error}).") from error
    names = tuple(word.strip() for word in only.split(",") if word.strip())
    with hand_run(cache, quick=quick, tuning=split == "tuning", progress=tell) as run:
        run.measure(names, real, out)
        if out is None:
            typer.echo(run.report())
            return
        for path in run.write(out, pictures=pictures):
            typer.echo(str(path))


@dataclass
class HandRun:
    """One run of the experiments: measured, then written.

    Attributes
    ----------
    sets : HandSets
    about : dict
        What it is measured on.
    makers : Makers
    kept : MeasuredFiles
        Measured training frames.
    progress : Progress
    document : dict
        ``geoderm-hand-experiments/1``, once it is measured.
    """

    sets: HandSets
    about: dict[str, Any]
    makers: Makers
    kept: MeasuredFiles
    progress: Progress
    document: dict[str, Any] = field(default_factory=dict)
    outcome: Outcome | None = None

    def measure(self, names: Sequence[str] = (), real: Path | None = None, out: Path | None = None) -> None:
        """Run some experiments, all if none is named; figures are written after each."""
        from core.evaluation.hand.real import real_surfaces
        from core.evaluation.hand.run import EXPERIMENTS, HandExperiments

        started = time.perf_counter()
        surfaces = None if real is None else real_surfaces(real)

        def after(outcome: Outcome) -> None:
            minutes = round((time.perf_counter() - started) / 60, 1)
            self.document = {
                "format": "geoderm-hand-experiments/1",
                "about": {**self.about, "minutes": minutes},
                **outcome.figures,
                **({} if surfaces is None else {"real": surfaces}),
            }
            if out is not None:
                self.write(out, pictures=False)

        experiments = HandExperiments(self.sets, self.makers, self.progress, self.kept)
        self.outcome = experiments.run(names or EXPERIMENTS, after)

    def report(self) -> str:
        """The tables."""
        from core.evaluation.hand.tables import markdown

        return markdown(self.document)

    def write(self, out: Path, *, pictures: bool = True) -> list[Path]:
        """Write figures, tables and pictures, and return the files."""
        from core.evaluation.hand.pictures import draw_pictures
        from core.hand.documents import write_file

        drawn: list[Path] = []
        if pictures and self.outcome is not None:
            self.progress(1.0, "Drawing pictures")
            drawn = draw_pictures(self.outcome, self.sets, self.makers.marker, out)
        shown = "".join(f"\n![{path.stem}]({path.name})\n" for path in drawn)
        write_file(out / "report.md", (self.report() + shown).encode())
        figures = json.dumps(without_nan(self.document), indent=1, allow_nan=False)
        write_file(out / "hand.json", (figures + "\n").encode())
        return [out / "report.md", out / "hand.json", *drawn]


def without_nan(value: Any) -> Any:
    """The same for JSON, which knows no NaN: null."""
    if isinstance(value, dict):
        return {key: without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def hand_run(
    cache: Path | None, *, quick: bool = False, tuning: bool = False, progress: Progress
) -> Iterator[HandRun]:
    """A run on the frames of a folder, or on frames that are kept for this run alone."""
    from app.cli.hand_experiment_sets import FULL, QUICK, about_sets, hand_sets
    from core.evaluation.hand.measured_files import MeasuredFiles

    plan = QUICK if quick else FULL
    with kept_frames(cache) as folder, makers() as made:
        sets = hand_sets(folder, plan, tuning=tuning)
        yield HandRun(sets, about_sets(sets, tuning=tuning), made, MeasuredFiles(folder), progress)


@contextmanager
def kept_frames(cache: Path | None) -> Iterator[Path]:
    """The folder of frames: kept, or for this run only (several experiments look at the same frames)."""
    from app.cli.simulated_hands import cache_folder

    with ExitStack() as stack:
        folder = cache or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="geoderm-hands-")))
        yield cache_folder(folder)


@contextmanager
def makers() -> Iterator[Makers]:
    """Finders and detectors; the detectors are closed in the end."""
    from core.evaluation.hand.run import Makers
    from core.hand.hand_model import DEFAULT_MARKER_M
    from core.hand.marker_anchors import MarkerAnchors
    from core.hand.palm_anchors import PalmAnchors
    from devices.trackers.mediapipe_hands import HandFollower, MediaPipeHands

    with ExitStack() as stack:
        single: list[MediaPipeHands] = []

        def landmarks(stills: bool) -> HandDetector:
            if not stills:
                follower = HandFollower()
                stack.callback(follower.close)
                return follower
            if not single:
                single.append(MediaPipeHands())
                stack.callback(single[0].close)
            return single[0]

        def palm(stills: bool) -> FinderMaker:
            return lambda: PalmAnchors(landmarks(stills))

        yield Makers(lambda: MarkerAnchors(DEFAULT_MARKER_M), palm, landmarks)
