"""The experiments on the hand tracker, one function each; frames and finders come from outside.

Each takes learned frames (`running.Measured`) or a model, and sets of frames, and gives the scores: figures
are made of scores in `document`, pictures in `pictures`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, zip_longest

from core.evaluation.hand.classifier import Judged, LeftOut, judged, left_out
from core.evaluation.hand.frames import FrameSet, TrueFrame
from core.evaluation.hand.running import Taught, measure_sets, track_set
from core.evaluation.hand.scores import FrameScore
from core.hand.anchors import AnchorFinder
from core.hand.hand_model import HandModel
from core.hand.model import LEAST_FRAMES
from core.hand.tracker import Refinement, TrackingOptions
from core.progress import Progress, no_progress

FinderMaker = Callable[[], AnchorFinder]
"""A finder for one sequence: finders remember."""

THESIS_TEST_FRAMES = 118
"""Of the thesis's classifier."""

FEW_FRAMES = 5

THRESHOLDS_M = (0.008, 0.012, 0.016)
"""Errors beyond which a point is not told, for the sweep on occlusions."""


@dataclass(frozen=True, eq=False)
class Classified:
    """One classifier and what it said.

    Attributes
    ----------
    title : str
    training : int
        Frames it was learned from.
    judged : Judged
    scores : list of FrameScore
    model : HandModel
    """

    title: str
    training: int
    judged: Judged
    scores: list[FrameScore]
    model: HandModel


def classify(
    title: str,
    taught: Taught,
    configurations: Sequence[str],
    test: Sequence[FrameSet],
    finder: FinderMaker,
    *,
    test_frames: int | None = None,
    progress: Progress = no_progress,
) -> Classified:
    """Ask a model about single frames of other hands.

    Parameters
    ----------
    test_frames : int, optional
        So many test frames, the hands and configurations in turn; all if not given.
    """
    model = taught.model()
    progress(0.0, title)
    scores = _stills(model, configurations, test, finder, test_frames, progress)
    return Classified(title, len(taught.hands), judged(scores, configurations), scores, model)


def stills_in_turn(sets: Sequence[FrameSet], configurations: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Hand and name of single frames of some configurations: one of every hand, then the next."""
    columns = [
        [(f.body, f.name) for f in frames if f.labels.configuration in configurations] for frames in sets
    ]
    for row in zip_longest(*columns):
        yield from (one for one in row if one is not None)


def unlearned(
    name: str,
    model: HandModel,
    test: Sequence[FrameSet],
    finder: FinderMaker,
    *,
    most: int | None = None,
    progress: Progress = no_progress,
) -> LeftOut:
    """Show a configuration that the model does not have."""
    progress(0.0, f"Without {name}")
    return left_out(name, _stills(model, (name,), test, finder, most, progress))


def _stills(
    model: HandModel,
    configurations: Sequence[str],
    test: Sequence[FrameSet],
    finder: FinderMaker,
    most: int | None,
    progress: Progress,
) -> list[FrameScore]:
    """Scores of single frames, at most so many: the hands and configurations in turn."""
    wanted: dict[str, set[str]] = {}
    for whose, name in islice(stills_in_turn(test, configurations), most):
        wanted.setdefault(whose, set()).add(name)
    scores: list[FrameScore] = []
    for number, frames in enumerate(test):
        progress(number / len(test), f"Single frames of {frames.body}")
        names = wanted.get(frames.body, set())
        scores += track_set((f for f in frames if f.name in names), model, finder(), stills=True)
    return scores


def follow(
    sets: Sequence[FrameSet],
    model: HandModel,
    finder: FinderMaker,
    *,
    refinement: Refinement = "joint",
    threshold_m: float | None = None,
    paths: bool = False,
    progress: Progress = no_progress,
) -> list[FrameScore]:
    """Track sequences, each from its beginning."""
    options = TrackingOptions(refinement=refinement)
    if threshold_m is not None:
        options = replace(options, threshold_m=threshold_m)
    scores: list[FrameScore] = []
    for number, frames in enumerate(sets):
        progress(number / len(sets), f"{frames.name}: {frames.body}")
        scores += track_set(frames, model, finder(), options, paths=paths)
    return scores


def own_hand(
    sets: Sequence[FrameSet],
    stills: Sequence[FrameSet],
    configurations: Sequence[str],
    finder: FinderMaker,
    *,
    most: int = FEW_FRAMES,
    progress: Progress = no_progress,
) -> list[FrameScore]:
    """Learn from a few single frames of every hand itself, then track its sequence.

    The way the application is used: a person labels some frames of a hand, and that hand is tracked. Without
    configurations that are labelled in too few frames, and without hands that have none then.
    """
    scores: list[FrameScore] = []
    for number, frames in enumerate(sets):
        progress(number / len(sets), f"Own model: {frames.body}")
        own = [one for one in stills if one.body == frames.body]
        measured = measure_sets(own, finder())
        enough = [name for name in configurations if len(measured.chosen([name])) >= LEAST_FRAMES]
        if not enough:
            continue
        taught = Taught.of(measured.chosen(enough, most), finder().kind)
        scores += track_set(frames, taught.model(), finder())
    return scores


def frames_of(sets: Sequence[FrameSet]) -> Iterator[TrueFrame]:
    """All frames of some sets."""
    for frames in sets:
        yield from frames
