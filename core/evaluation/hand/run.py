"""All experiments on the hand tracker, or some of them: from sets of frames to figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from core.errors import InputError
from core.evaluation.hand.classifier import judged
from core.evaluation.hand.experiments import (
    FEW_FRAMES,
    THESIS_TEST_FRAMES,
    THRESHOLDS_M,
    Classified,
    FinderMaker,
    classify,
    follow,
    frames_of,
    own_hand,
    unlearned,
)
from core.evaluation.hand.frames import HandSets
from core.evaluation.hand.measured_files import MeasuredFiles
from core.evaluation.hand.rivals import WAYS, LandmarkScore, beside, landmark_scores
from core.evaluation.hand.running import Measured, Taught, measure_sets, track_set
from core.evaluation.hand.scores import FrameScore
from core.evaluation.hand.speed import speed_of
from core.evaluation.hand.summaries import accuracy, by_body, frames_since_lost
from core.hand.hand_model import HandModel
from core.hand.landmarks import HandDetector
from core.progress import Progress, no_progress

BALANCED: Final = 48
"""Training frames of every configuration where there are five or six: four of each hand."""

SIX_TEST_FRAMES: Final = 168
FEW_TEST_FRAMES: Final = 70
"""Test frames for six configurations, and for what was learned from a few frames."""

UNLEARNED_TEST_FRAMES: Final = 28
"""Test frames of a configuration that was not learned."""

OWN_HANDS: Final = 2
"""Hands that are followed by a model of their own."""

THESIS_TRAINING: Final = 300
"""Training frames of every configuration of the thesis's classifier."""


@dataclass(frozen=True)
class Makers:
    """What finds anchors and landmarks.

    Attributes
    ----------
    marker : function
        A finder of the marker, for one sequence.
    palm : function of bool
        A finder of the palm, for a sequence (False) or for single frames (True); None to leave all this out.
    landmarks : function of bool
        A landmark detector, likewise.
    """

    marker: FinderMaker
    palm: Callable[[bool], FinderMaker] | None = None
    landmarks: Callable[[bool], HandDetector] | None = None


@dataclass
class Outcome:
    """What came out.

    Attributes
    ----------
    figures : dict
        Plain values by experiment, for JSON and tables.
    scores : dict of str to list of FrameScore
        Frame by frame, for pictures.
    models : dict of str to HandModel
        "marker" (five configurations), "three", "palm".
    classified : dict of str to Classified
    """

    figures: dict[str, Any] = field(default_factory=dict)
    scores: dict[str, list[FrameScore]] = field(default_factory=dict)
    models: dict[str, HandModel] = field(default_factory=dict)
    classified: dict[str, Classified] = field(default_factory=dict)


class HandExperiments:
    """Runs experiments; what several need is learned once.

    Parameters
    ----------
    sets : HandSets
    makers : Makers
    progress : Progress
    kept : MeasuredFiles, optional
        Where measured training frames are kept for the next run.
    """

    def __init__(
        self,
        sets: HandSets,
        makers: Makers,
        progress: Progress = no_progress,
        kept: MeasuredFiles | None = None,
    ) -> None:
        self._sets, self._makers, self._progress, self._kept = sets, makers, progress, kept
        self._measured: Measured | None = None
        self._six: Taught | None = None
        self.outcome = Outcome()

    def run(self, names: Sequence[str], after: Callable[[Outcome], None] = lambda outcome: None) -> Outcome:
        """Run some experiments of `EXPERIMENTS`.

        Parameters
        ----------
        names : sequence of str
        after : function of an Outcome
            Called after each, with all there is so far.

        Raises
        ------
        InputError
            If there is no such experiment.
        """
        known = {
            "classifier": self._classifier,
            "large": self._large,
            "occlusion": self._occlusion,
            "bottle": self._bottle,
            "lost": self._lost,
            "palm": self._palm,
        }
        for name in names:
            if name not in known:
                raise InputError(
                    f"There is no experiment '{name}'.", f"Choose among: {', '.join(EXPERIMENTS)}."
                )
        for name in names:
            known[name]()
            after(self.outcome)
        return self.outcome

    def _learned(self) -> Measured:
        if self._measured is None:
            self._measured = measure_sets(
                self._sets.training, self._makers.marker(), self._kept, self._progress
            )
            self.outcome.figures["training"] = _about_training(self._measured)
        return self._measured

    def _taught(self) -> Taught:
        """All six configurations; models of fewer are made of it without looking at the frames again."""
        if self._six is None:
            hands = self._learned().chosen(self._sets.six, BALANCED)
            self._six = Taught.of(hands, self._makers.marker().kind, self._progress)
        return self._six

    def _model(self) -> HandModel:
        models = self.outcome.models
        if "marker" not in models:
            models["marker"] = self._taught().only(self._sets.five).model()
        return models["marker"]

    def _classifier(self) -> None:
        sets, finder, learned = self._sets, self._makers.marker, self._learned()
        kind = finder().kind
        three = Taught.of(learned.chosen(sets.three, THESIS_TRAINING), kind, self._progress)
        few = Taught.of(learned.chosen(sets.five, FEW_FRAMES, learned.bodies[0]), kind, self._progress)
        five = self._taught().only(sets.five)
        said = f"5 configurations, {FEW_FRAMES} frames each of one hand"
        asked: dict[str, tuple[str, Taught, tuple[str, ...], int | None]] = {
            "three": ("3 configurations", three, sets.three, THESIS_TEST_FRAMES),
            "five": ("5 configurations", five, sets.five, None),
            "six": ("6 configurations", self._taught(), sets.six, SIX_TEST_FRAMES),
            "few": (said, few, sets.five, FEW_TEST_FRAMES),
        }
        out: dict[str, Any] = {}
        for key, (title, taught, configurations, most) in asked.items():
            result = classify(
                title, taught, configurations, sets.test, finder, test_frames=most, progress=self._progress
            )
            self.outcome.classified[key] = result
            self.outcome.scores[f"stills {key}"] = result.scores
            out[key] = {
                "title": title,
                "training": result.training,
                "cross_validated": list(taught.cross_validated()),
                **result.judged.to_json(),
                "accuracy": accuracy(result.scores).to_json(),
            }
        self.outcome.models["three"] = self.outcome.classified["three"].model
        self.outcome.models["marker"] = self.outcome.classified["five"].model
        self.outcome.models["six"] = self.outcome.classified["six"].model
        out["unlearned"] = [
            asdict(
                unlearned(
                    name,
                    self._without(name),
                    sets.test,
                    finder,
                    most=UNLEARNED_TEST_FRAMES,
                    progress=self._progress,
                )
            )
            for name in sets.six
        ]
        changing = follow(sets.changing, self._model(), finder, progress=self._progress)
        self.outcome.scores["changing"] = changing
        out["changing"] = {
            **judged(changing, sets.five).to_json(),
            "accuracy": accuracy(changing).to_json(),
            "speed": speed_of(changing),
        }
        self.outcome.figures["classifier"] = out

    def _without(self, name: str) -> HandModel:
        """A model of the five configurations without one of them."""
        return self._taught().only([other for other in self._sets.five if other != name]).model()

    def _large(self) -> None:
        sets, finder = self._sets, self._makers.marker
        out: dict[str, Any] = {}
        joint = follow(sets.large, self._model(), finder, paths=True, progress=self._progress)
        sequential = follow(
            sets.large, self._model(), finder, refinement="sequential", progress=self._progress
        )
        own = own_hand(sets.large[:OWN_HANDS], sets.test, sets.five, finder, progress=self._progress)
        for key, scores in (("joint", joint), ("sequential", sequential), ("own", own)):
            self.outcome.scores[f"large {key}"] = scores
            out[key] = {
                "all": accuracy(scores).to_json(),
                "speed": speed_of(scores),
                "by_body": {body: accuracy(some).to_json() for body, some in by_body(scores).items()},
                "by_anchors": {
                    how: accuracy(some).to_json()
                    for how in ("seen", "followed", "none")
                    if (some := [s for s in scores if s.anchored == how])
                },
            }
        self.outcome.figures["large"] = out

    def _occlusion(self) -> None:
        out: dict[str, Any] = {}
        for threshold_m in THRESHOLDS_M:
            scores = follow(
                self._sets.occluded,
                self._model(),
                self._makers.marker,
                threshold_m=threshold_m,
                progress=self._progress,
            )
            self.outcome.scores[f"occlusion {1e3 * threshold_m:.0f}"] = scores
            passing = [s for s in scores if s.remark]
            out[f"{1e3 * threshold_m:.0f} mm"] = {
                "all": accuracy(scores).to_json(),
                "passing": accuracy(passing).to_json(),
                "free": accuracy([s for s in scores if not s.remark]).to_json(),
            }
        self.outcome.figures["occlusion"] = out

    def _bottle(self) -> None:
        sets, finder = self._sets, self._makers.marker
        models = self.outcome.models
        model = models["six"] = models.get("six") or self._taught().model()
        scores = follow(sets.bottle, model, finder, progress=self._progress)
        self.outcome.scores["bottle"] = scores
        self.outcome.figures["bottle"] = {
            "all": accuracy(scores).to_json(),
            "holding": accuracy([s for s in scores if s.remark]).to_json(),
            "judged": judged(scores, sets.six).to_json(),
        }

    def _lost(self) -> None:
        scores = follow(self._sets.lost, self._model(), self._makers.marker, progress=self._progress)
        self.outcome.scores["lost"] = scores
        groups: dict[str, list[FrameScore]] = {}
        for some in by_body(scores).values():
            for since, score in zip(frames_since_lost(some), some, strict=True):
                groups.setdefault("beyond" if since > _MOST_LOST else str(since), []).append(score)
        rows = {str(k): groups[str(k)] for k in (*range(_MOST_LOST + 1), "beyond") if str(k) in groups}
        self.outcome.figures["lost"] = {since: accuracy(some).to_json() for since, some in rows.items()}

    def _palm(self) -> None:
        sets, makers = self._sets, self._makers
        if makers.palm is None or makers.landmarks is None:
            raise InputError("The palm experiment needs a landmark detector.")
        measured = measure_sets(sets.bare_training, makers.palm(True)(), self._kept, self._progress)
        palm = Taught.of(measured.chosen(sets.five), "palm", self._progress).model()
        self.outcome.models["palm"] = palm
        bare = _stills(sets, palm, makers.palm(True))
        marked = self._marked_stills({score.name for score in bare})
        bare_large = follow(sets.bare_large, palm, makers.palm(False), progress=self._progress)
        bodies = {frames.body for frames in sets.bare_large}
        large = self.outcome.scores.get("large joint")
        if large is None:
            large = follow(sets.large, self._model(), makers.marker, progress=self._progress)
            self.outcome.scores["large joint"] = large
        self.outcome.scores.update({"stills palm": bare, "stills marker": marked, "large palm": bare_large})
        on_bare = landmark_scores(frames_of(sets.bare_test), makers.landmarks(True))
        on_marked = landmark_scores(frames_of(sets.test), makers.landmarks(True))
        following: list[LandmarkScore] = []
        for frames in sets.large:
            following += landmark_scores(frames, makers.landmarks(False))
        self.outcome.figures["palm"] = {
            "training": _about_training(measured),
            "stills": {"marker": accuracy(marked).to_json(), "palm": accuracy(bare).to_json()},
            "large": {
                "marker": accuracy([s for s in large if s.body in bodies]).to_json(),
                "palm": accuracy(bare_large).to_json(),
            },
            "speed": speed_of(bare_large),
            "beside_landmarks": [
                {"ours": ours, "way": way, "points": points, **comparison.to_json()}
                for ours, scores, rival in (
                    ("marker, stills; landmarks of the same hands without marker", marked, on_bare),
                    ("marker, stills; landmarks of the same pictures", marked, on_marked),
                    ("palm, stills without marker", bare, on_bare),
                    ("marker, large displacements", large, following),
                )
                for way in WAYS
                for points, guessed in (("all", False), ("taken to be visible", True))
                for comparison in (beside(scores, rival, way, guessed_visible=guessed),)
            ],
        }

    def _marked_stills(self, names: set[str]) -> list[FrameScore]:
        known = self.outcome.scores.get("stills five")
        if known is not None:
            return [score for score in known if score.name in names]
        out: list[FrameScore] = []
        for frames in self._sets.test:
            chosen = (f for f in frames if f.name in names)
            out += track_set(chosen, self._model(), self._makers.marker(), stills=True)
        return out


EXPERIMENTS: Final = ("classifier", "large", "occlusion", "bottle", "lost", "palm")
_MOST_LOST: Final = 10


def _stills(sets: HandSets, model: HandModel, finder: FinderMaker) -> list[FrameScore]:
    scores: list[FrameScore] = []
    for frames in sets.bare_test:
        scores += track_set(frames, model, finder(), stills=True)
    return scores


def _about_training(measured: Measured) -> dict[str, Any]:
    counts: dict[str, int] = {}
    for hand in measured.hands:
        name = hand.frame.configuration
        counts[name] = counts.get(name, 0) + 1
    return {
        "frames": counts,
        "hands": len(set(measured.bodies)),
        "left_out": [list(one) for one in measured.left_out],
    }
