"""Running the tracker over frames with truth, and learning from such frames."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from core.errors import GeodermError
from core.evaluation.hand.frames import FrameSet, TrueFrame
from core.evaluation.hand.measured_files import MeasuredFiles
from core.evaluation.hand.scores import FrameScore, score_frame
from core.hand.anchors import AnchorFinder, AnchorKind
from core.hand.hand_model import DEFAULT_MARKER_M, HandModel
from core.hand.learning import measure_labelled
from core.hand.model import learn_configuration
from core.hand.tracker import HandTracker, TrackingOptions
from core.hand.trying import MeasuredHand, Tried, cross_judge, grow_tree, try_frames
from core.progress import Progress, no_progress


@dataclass
class Measured:
    """Labelled frames as they are learned from.

    Attributes
    ----------
    hands : list of MeasuredHand
    bodies : list of str
        Whose hand each is.
    left_out : list of (str, str)
        Frames that teach nothing, with the reason.
    """

    hands: list[MeasuredHand] = field(default_factory=list)
    bodies: list[str] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def chosen(
        self, configurations: Sequence[str], most: int | None = None, body: str | None = None
    ) -> list[MeasuredHand]:
        """Frames of some configurations, at most so many of each, or of one body.

        All bodies give alike, and the frames of a body come in a row: cross-validation, which takes whole
        stretches, then asks about bodies that it has not learned from.
        """
        out: list[MeasuredHand] = []
        for name in configurations:
            of_body: dict[str, list[int]] = {}
            for k, (hand, whose) in enumerate(zip(self.hands, self.bodies, strict=True)):
                if hand.frame.configuration == name and body in (None, whose):
                    of_body.setdefault(whose, []).append(k)
            longest = max((len(some) for some in of_body.values()), default=0)
            in_turn = [some[k] for k in range(longest) for some in of_body.values() if k < len(some)]
            out += [self.hands[k] for k in sorted(in_turn[:most], key=lambda k: (self.bodies[k], k))]
        return out


@dataclass(frozen=True, eq=False)
class Taught:
    """What a model is made of; as `core.hand.learning.learn_hand` makes it.

    Attributes
    ----------
    hands : list of MeasuredHand
    tried : list of Tried
        Every configuration looked for in every frame.
    kind : {"marker", "palm"}
    """

    hands: list[MeasuredHand]
    tried: list[Tried]
    kind: AnchorKind

    @classmethod
    def of(cls, hands: list[MeasuredHand], kind: AnchorKind, progress: Progress = no_progress) -> Taught:
        """Look for every configuration in the frames, which takes most of the time."""
        return cls(hands, try_frames(hands, rigid_anchors=kind == "marker", progress=progress), kind)

    def only(self, configurations: Sequence[str]) -> Taught:
        """The same with some of the configurations, as if the others had never been there."""
        hands = [hand for hand in self.hands if hand.frame.configuration in configurations]
        tried = [
            replace(
                one,
                pairs_m={name: pairs for name, pairs in one.pairs_m.items() if name in configurations},
                misfits={name: worse for name, worse in one.misfits.items() if name in configurations},
            )
            for one in self.tried
            if one.configuration in configurations
        ]
        return Taught(hands, tried, self.kind)

    def model(self, marker_m: float = DEFAULT_MARKER_M) -> HandModel:
        """Learn."""
        frames = [hand.frame for hand in self.hands]
        names = sorted({frame.configuration for frame in frames})
        rigid = self.kind == "marker"
        models = {
            name: learn_configuration(
                name, [frame for frame in frames if frame.configuration == name], rigid_anchors=rigid
            )
            for name in names
        }
        tree = grow_tree(frames, self.tried) if len(names) > 1 else None
        return HandModel(models, tree, self.kind, marker_m)

    def cross_validated(self) -> tuple[int, int]:
        """Frames judged rightly by what has not learned from them, and how many were judged."""
        if not self.tried:
            return 0, 0
        confusion = cross_judge([hand.frame for hand in self.hands], self.tried)
        return int(confusion.counts.trace()), int(confusion.counts.sum())


def measure_sets(
    sets: Iterable[FrameSet],
    finder: AnchorFinder,
    kept: MeasuredFiles | None = None,
    progress: Progress = no_progress,
) -> Measured:
    """Measure the labelled frames of several hands."""
    measured = Measured()
    sets = list(sets)
    for number, frames in enumerate(sets):
        progress(number / len(sets), f"Learning from {frames.body}")
        known = None if kept is None else kept.read(frames, finder.kind)
        hands, left_out = known or _measured(frames, finder)
        if known is None and kept is not None:
            kept.write(frames, finder.kind, hands, left_out)
        measured.hands += hands
        measured.bodies += [frames.body] * len(hands)
        measured.left_out += left_out
    return measured


def _measured(frames: FrameSet, finder: AnchorFinder) -> tuple[list[MeasuredHand], list[tuple[str, str]]]:
    hands: list[MeasuredHand] = []
    left_out: list[tuple[str, str]] = []
    for frame in frames:
        try:
            hands.append(measure_labelled(frame.capture, frame.labels, finder).hand)
        except GeodermError as error:
            left_out.append((frame.name, str(error)))
    return hands, left_out


def track_set(
    frames: Iterable[TrueFrame],
    model: HandModel,
    finder: AnchorFinder,
    options: TrackingOptions | None = None,
    *,
    stills: bool = False,
    paths: bool = False,
) -> list[FrameScore]:
    """Track the frames of one hand and score every answer.

    Parameters
    ----------
    stills : bool
        Every frame for itself: the tracker forgets the frames before.
    paths : bool
        Score distances along the skin too.
    """
    tracker: HandTracker | None = None
    scores = []
    for frame in frames:
        if tracker is None:
            tracker = HandTracker(model, frame.capture.rig, finder, options)
        if stills:
            tracker.reset()
        depth_m = frame.depth_m
        begun, begun_cpu = time.perf_counter(), time.process_time()
        answer = tracker.track(depth_m, frame.capture.color)
        took_s = time.perf_counter() - begun, time.process_time() - begun_cpu
        scores.append(score_frame(frame, answer, took_s=took_s, paths=paths))
    return scores
