"""From labelled frames to a model of the hand: measured, learned, cross-validated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import RgbdCapture
from core.errors import GeodermError, InputError, WorkError
from core.hand.anchors import AnchorFinder
from core.hand.fields import HandFields, measure_fields
from core.hand.hand_model import DEFAULT_MARKER_M, HandModel
from core.hand.labels import FrameLabels
from core.hand.marker import DEFAULT_DICTIONARY
from core.hand.model import LEAST_FRAMES, OWN_FIELDS, LabelledFrame, learn_configuration
from core.hand.names import PAIRS, POINT_NAMES
from core.hand.stills import still_depth
from core.hand.surface import cut_hand
from core.hand.trying import Confusion, MeasuredHand, cross_judge, grow_tree, try_frames
from core.progress import Cancelled, Progress, ScaledProgress, no_progress
from core.surface.body_surface import BodySurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

OFF_HAND_M = 0.010
"""A point labelled farther from the measured skin does not lie on it."""

FEW_FRAMES = 10
"""Of a configuration: with fewer, the accuracy found by cross-validation is a rough guess."""

FEW_POINTS = 3
"""Of a configuration: with fewer it is hardly told from others. A fist shows few."""

_FAULTY_SHARE = 0.5
_MEASURED = 0.6
"""Share of the progress that measuring takes."""


@dataclass(frozen=True, eq=False)
class MeasuredFrame:
    """A labelled frame's distances, and what is less than it could be.

    Attributes
    ----------
    frame : LabelledFrame
    hand : MeasuredHand
        The same with its surface.
    left_out : tuple of str
        A sentence for each point that could not be measured, such as "index_tip is labelled 40 mm off the
        hand."; and about anchors that were found with difficulty.
    """

    frame: LabelledFrame
    hand: MeasuredHand
    left_out: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Lesson:
    """What was learned, and from what.

    Attributes
    ----------
    model : HandModel
    used : dict of str to int
        Frames by configuration.
    left_out : tuple of (str, str)
        Frames that teach nothing, with the reason.
    points_left_out : tuple of (str, str)
        Frames that teach, but less than they could: a sentence for each point that does not count.
    confusion : Confusion or None
        Of the whole judgement, by cross-validation; None with a single configuration, or too few frames.
    remarks : tuple of str
        What makes the lesson less sure than usual; sentences for people.
    """

    model: HandModel
    used: Mapping[str, int]
    left_out: tuple[tuple[str, str], ...] = ()
    points_left_out: tuple[tuple[str, str], ...] = ()
    confusion: Confusion | None = None
    remarks: tuple[str, ...] = ()

    @property
    def accuracy(self) -> float | None:
        """By cross-validation; None with a single configuration."""
        return None if self.confusion is None else self.confusion.accuracy


def measure_frame(capture: RgbdCapture, labels: FrameLabels, finder: AnchorFinder) -> LabelledFrame:
    """Distances between the labelled points and from the anchors along the skin of one frame.

    Raises
    ------
    InputError, WorkError
        With what is wrong with the frame: no labels, no marker, points off the hand.
    """
    return measure_labelled(capture, labels, finder).frame


def measure_labelled(capture: RgbdCapture, labels: FrameLabels, finder: AnchorFinder) -> MeasuredFrame:
    """As `measure_frame`, with the points that had to be left out."""
    if labels.configuration is None:
        raise InputError("It has no configuration.", "Name one.")
    points = labels.array()
    labelled = np.flatnonzero(np.isfinite(points).all(axis=1))
    if len(labelled) == 0:
        raise InputError("No visible point is labelled.")
    depth_m = still_depth(capture)
    anchors = finder.find(capture.color, depth_m, capture.rig)
    if not anchors.seen:
        raise WorkError(anchors.reason or "No anchors were found.")
    there = np.isfinite(anchors.places_m).all(axis=1)
    if not there.any():
        raise WorkError(anchors.reason or "No anchors were found.")
    hand = cut_hand(depth_m, capture.rig.depth, anchors.places_m[there])
    labelled, faults = _on_skin(points, labelled, hand.surface)
    fields = measure_fields(hand, anchors.places_m)
    frame, lost = _distances(labels.configuration, fields, points, labelled)
    if len(lost) == len(labelled):
        raise WorkError("No labelled point hangs together with the anchors along the skin.")
    apart = "lies on skin that does not hang together with the anchors."
    about_anchors = [] if anchors.reason is None else [anchors.reason]
    hand_of = MeasuredHand.of(frame, fields)
    return MeasuredFrame(
        frame, hand_of, (*about_anchors, *faults, *(f"{POINT_NAMES[p]} {apart}" for p in lost))
    )


def _on_skin(points: FloatArray, labelled: IntArray, surface: BodySurface) -> tuple[IntArray, list[str]]:
    """Which of the labelled points (15, 3) lie on the skin, and what is wrong with the others."""
    off_m = np.linalg.norm(points[labelled] - surface.nearest_arrays(points[labelled])[2], axis=1)
    off = off_m > OFF_HAND_M
    if np.mean(off) > _FAULTY_SHARE:
        worst = int(np.argmax(off_m))
        raise InputError(
            f"{int(off.sum())} of {len(labelled)} points are labelled off the hand "
            f"({POINT_NAMES[labelled[worst]]} by {1000 * off_m[worst]:.0f} mm)."
        )
    said = [
        f"{POINT_NAMES[p]} is labelled {1000 * d:.0f} mm off the hand."
        for p, d in zip(labelled[off], off_m[off], strict=True)
    ]
    return labelled[~off], said


def _distances(
    name: str, fields: HandFields, points: FloatArray, labelled: IntArray
) -> tuple[LabelledFrame, IntArray]:
    """Distances of the labelled points, and which of them no anchor can be reached from."""
    surface, count = fields.surface, len(POINT_NAMES)
    values = fields.at(points[labelled])
    reached = np.isfinite(values[:, :-OWN_FIELDS]).any(axis=1)
    lost, labelled, values = labelled[~reached], labelled[reached], values[reached]
    anchor_m = np.full((count, values.shape[1]), np.nan)
    anchor_m[labelled] = np.where(np.isfinite(values), values, np.nan)
    between = np.full((count, count), np.nan)
    if len(labelled):
        triangles, weights, _ = surface.nearest_arrays(points[labelled])
        from_each = fields.solver.distances(surface.nearest(points[labelled]))
        there = np.einsum("skc,kc->sk", from_each[:, surface.triangles[triangles]], weights)
        # measured both ways: the mean has less of the noise
        mean = 0.5 * (there + there.T)
        between[np.ix_(labelled, labelled)] = np.where(np.isfinite(mean), mean, np.nan)
    return LabelledFrame(name, anchor_m, np.array([between[i, j] for i, j in PAIRS])), lost


def learn_hand(
    frames: Iterable[tuple[str, RgbdCapture, FrameLabels]],
    finder: AnchorFinder,
    *,
    dictionary: str = DEFAULT_DICTIONARY,
    marker_m: float = DEFAULT_MARKER_M,
    count: int | None = None,
    progress: Progress = no_progress,
) -> Lesson:
    """Learn a hand's configurations from labelled frames.

    A frame that cannot teach is left out with its reason. A configuration needs `model.LEAST_FRAMES` frames.

    Parameters
    ----------
    frames : iterable of (name, RgbdCapture, FrameLabels)
        Read one after the other, so that they need not fit into memory.
    finder : AnchorFinder
    dictionary : str
    marker_m : float
    count : int, optional
        How many frames there are, for the progress; taken from ``frames`` if it knows.
    progress : Progress

    Raises
    ------
    InputError
        If no configuration has enough frames; says why frames were left out.
    Cancelled
    """
    total = count if count is not None else (len(frames) if isinstance(frames, Sequence) else 0)
    collected = _Collected()
    for number, (name, capture, labels) in enumerate(frames):
        progress(_MEASURED * min(number / total, 1.0) if total else 0.0, f"Measuring {name}")
        collected.add(name, capture, labels, finder)
    progress(_MEASURED, "Learning distances")
    by_name = collected.enough()
    used = [hand for hands_of_one in by_name.values() for hand in hands_of_one]
    frames_used = [hand.frame for hand in used]
    rigid = finder.kind == "marker"
    models = {
        name: learn_configuration(name, [hand.frame for hand in of_one], rigid_anchors=rigid)
        for name, of_one in by_name.items()
    }
    tree, confusion = None, None
    if len(models) > 1:
        tried = try_frames(used, rigid_anchors=rigid, progress=ScaledProgress(progress, _MEASURED, 0.98))
        progress(0.98, "Growing the decision tree")
        tree = grow_tree(frames_used, tried)
        confusion = cross_judge(frames_used, tried) if tried else None
    model = HandModel(models, tree, finder.kind, marker_m, dictionary)
    progress(1.0, "Learned")
    return Lesson(
        model,
        {name: len(of_one) for name, of_one in by_name.items()},
        tuple(collected.left_out),
        tuple(collected.points_left_out),
        confusion,
        _remarks(by_name, confusion is None),
    )


@dataclass
class _Collected:
    """Frames as they are measured."""

    hands: list[tuple[str, MeasuredHand]] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    points_left_out: list[tuple[str, str]] = field(default_factory=list)

    def add(self, name: str, capture: RgbdCapture, labels: FrameLabels, finder: AnchorFinder) -> None:
        if labels.configuration is None and not labels.points_m:
            self.left_out.append((name, "It has no labels."))
            return
        try:
            measured = measure_labelled(capture, labels, finder)
        except Cancelled:
            raise
        except GeodermError as error:
            self.left_out.append((name, str(error)))
            return
        self.hands.append((name, measured.hand))
        self.points_left_out += [(name, fault) for fault in measured.left_out]

    def enough(self) -> dict[str, list[MeasuredHand]]:
        """Frames by configuration, of those that have enough."""
        by_name: dict[str, list[MeasuredHand]] = {}
        for _, hand in self.hands:
            by_name.setdefault(hand.frame.configuration, []).append(hand)
        few = {name: len(of_one) for name, of_one in by_name.items() if len(of_one) < LEAST_FRAMES}
        if len(few) == len(by_name):
            raise InputError(self._too_few(by_name), self._first_reason())
        for name, hand in self.hands:
            kind = hand.frame.configuration
            if kind in few:
                said = f"Configuration '{kind}' has {few[kind]} of the {LEAST_FRAMES} frames it needs."
                self.left_out.append((name, said))
        return {name: by_name[name] for name in sorted(by_name) if name not in few}

    def _too_few(self, by_name: Mapping[str, Sequence[MeasuredHand]]) -> str:
        if not self.hands and not self.left_out:
            return "There are no frames to learn from."
        if not by_name:
            return f"None of the {len(self.left_out)} frames teaches anything."
        most = max(by_name, key=lambda name: len(by_name[name]))
        had = len(by_name[most])
        return (
            f"No configuration has the {LEAST_FRAMES} frames it needs: of '{most}' there "
            f"{'is 1' if had == 1 else f'are {had}'} that can be used. One frame shows no spread."
        )

    def _first_reason(self) -> str:
        if not self.left_out:
            return "Label more frames."
        name, reason = self.left_out[0]
        others = len(self.left_out) - 1
        more = "" if others == 0 else f" ({others} more left out)"
        return f"{name}: {reason}{more}"


def _remarks(by_name: Mapping[str, Sequence[MeasuredHand]], unjudged: bool) -> tuple[str, ...]:
    said = []
    few = [f"'{name}' ({len(of_one)})" for name, of_one in by_name.items() if len(of_one) < FEW_FRAMES]
    if few:
        said.append(
            f"Few frames of {', '.join(few)}: spreads and accuracy are rough. {FEW_FRAMES} are better."
        )
    for name, of_one in by_name.items():
        taught = int(np.isfinite([one.frame.anchor_m for one in of_one]).any(axis=(0, 2)).sum())
        if taught < FEW_POINTS:
            of_all = f"{taught} of the {len(POINT_NAMES)} points"
            said.append(f"'{name}' is taught by {of_all}: no other can be found in it.")
    if len(by_name) == 1:
        said.append("A single configuration: there is nothing to tell apart, and no decision tree.")
    elif unjudged:
        said.append(
            f"Too few frames to say how often the configuration is judged rightly: label {LEAST_FRAMES + 1}."
        )
    return tuple(said)
