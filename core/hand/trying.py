"""Training frames as the tracker will see them: every configuration is looked for in each.

A tree that learns from clicked points alone learns whether a person could click them. The tracker knows only
what it finds, under one configuration after the other, and finds some points that are not there. So the
training frames are tracked as well, each by models that have not learned from it, and the tree learns from
the distances between the points as they were found. The same tries tell how often the whole judgement is
right (cross-validation), and how badly the right configuration usually fits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.geodesics import geodesic_solver
from core.hand.fields import HandFields
from core.hand.fitting import fit_configuration
from core.hand.judging import decide, misfit
from core.hand.model import LEAST_FRAMES, ConfigurationModel, LabelledFrame, learn_configuration
from core.hand.tree import ConfigurationTree, learn_tree
from core.progress import Progress, no_progress

FloatArray = NDArray[np.float64]

FOLDS = 5
MOST_FRAMES = 60
"""Frames of a configuration that are tried, evenly spread: more take long and teach little."""


@dataclass(frozen=True, eq=False)
class MeasuredHand:
    """A labelled frame with its surface: what is needed to look for its points anew.

    Attributes
    ----------
    frame : LabelledFrame
    vertices_m : ndarray (n, 3) float32
    triangles : ndarray (m, 3) int32
    values_m : ndarray (a + 2, n) float32
        Of the vertices (`core.hand.fields`).
    """

    frame: LabelledFrame
    vertices_m: NDArray[np.float32]
    triangles: NDArray[np.int32]
    values_m: NDArray[np.float32]

    @classmethod
    def of(cls, frame: LabelledFrame, fields: HandFields) -> MeasuredHand:
        """Keep what is needed of a frame's fields, in little memory."""
        surface = fields.surface
        return cls(
            frame,
            surface.vertices.astype(np.float32),
            surface.triangles,
            fields.values_m.astype(np.float32),
        )


@dataclass(frozen=True, eq=False)
class Tried:
    """One frame, with every configuration looked for.

    Attributes
    ----------
    configuration : str
        The true one.
    fold : int
        Of the frames that its models have not learned from.
    labelled_pair_m : ndarray (105,)
    pairs_m : dict of str to ndarray (105,)
        By configuration that was looked for.
    misfits : dict of str to float
    """

    configuration: str
    fold: int
    labelled_pair_m: FloatArray
    pairs_m: Mapping[str, FloatArray]
    misfits: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Confusion:
    """What is said of frames that were not learned from (cross-validation).

    Attributes
    ----------
    classes : tuple of str
    counts : ndarray (c, c + 1) int64
        Frames; rows the true configuration, columns what was said; the last: that it is unknown.
    folds : int
    """

    classes: tuple[str, ...]
    counts: NDArray[np.int64]
    folds: int

    @property
    def accuracy(self) -> float:
        """Share of the frames whose configuration was said rightly."""
        return float(np.trace(self.counts) / self.counts.sum())


def try_frames(
    hands: Sequence[MeasuredHand], *, rigid_anchors: bool = True, progress: Progress = no_progress
) -> list[Tried]:
    """Look for every configuration in the frames.

    Folds take whole stretches of every configuration's frames, in their order, and never shuffle:
    neighbouring frames of a recording are nearly the same, and one in training would answer for the other.

    Parameters
    ----------
    hands : sequence of MeasuredHand
        At least `LEAST_FRAMES` + 1 of each of at least two configurations, or nothing can be tried.
    rigid_anchors : bool
    progress : Progress
    """
    numbers: dict[str, list[int]] = {}
    for k, hand in enumerate(hands):
        numbers.setdefault(hand.frame.configuration, []).append(k)
    folds = min(FOLDS, *map(len, numbers.values()))
    if folds <= LEAST_FRAMES:
        return []
    fold_of = {k: i * folds // len(rows) for rows in numbers.values() for i, k in enumerate(rows)}
    chosen = {k for rows in numbers.values() for k in _spread(rows)}
    tried: list[Tried] = []
    for fold in range(folds):
        others = {
            name: [hands[k].frame for k in rows if fold_of[k] != fold] for name, rows in numbers.items()
        }
        try:
            models = {
                name: learn_configuration(name, frames, rigid_anchors=rigid_anchors)
                for name, frames in others.items()
            }
        except InputError:
            # the frames of this fold are the only ones that show a point twice: they cannot be done without
            continue
        for k in sorted(k for k in chosen if fold_of[k] == fold):
            progress(len(tried) / len(chosen), "Trying every configuration")
            tried.append(_try(hands[k], fold, models))
    return tried


def _spread(rows: Sequence[int]) -> list[int]:
    places = np.linspace(0, len(rows) - 1, min(len(rows), MOST_FRAMES))
    return [rows[round(p)] for p in places]


def _try(hand: MeasuredHand, fold: int, models: Mapping[str, ConfigurationModel]) -> Tried:
    vertices = hand.vertices_m.astype(float)
    values = hand.values_m.astype(float)
    solver = geodesic_solver(vertices, hand.triangles)
    fits = {name: fit_configuration(model, vertices, values, solver) for name, model in models.items()}
    return Tried(
        hand.frame.configuration,
        fold,
        hand.frame.pair_m,
        {name: fit.pair_m for name, fit in fits.items()},
        {name: misfit(models[name], fit) for name, fit in fits.items()},
    )


def grow_tree(frames: Sequence[LabelledFrame], tried: Sequence[Tried] = ()) -> ConfigurationTree:
    """The decision tree of frames of at least two configurations, by clicked points and by points as found.

    Raises
    ------
    InputError
        If there are not at least two configurations.
    """
    rows = [frame.pair_m for frame in frames]
    names = [frame.configuration for frame in frames]
    for one in tried:
        rows += list(one.pairs_m.values())
        names += [one.configuration] * len(one.pairs_m)
    return learn_tree(np.array(rows), names)


def cross_judge(frames: Sequence[LabelledFrame], tried: Sequence[Tried]) -> Confusion:
    """What the judgement says of every frame that was tried, by models and a tree that have not seen it.

    Parameters
    ----------
    frames : sequence of LabelledFrame
        Give the classes.
    tried : sequence of Tried
    """
    classes = tuple(sorted({frame.configuration for frame in frames}))
    counts = np.zeros((len(classes), len(classes) + 1), np.int64)
    folds = sorted({one.fold for one in tried})
    for fold in folds:
        others = [one for one in tried if one.fold != fold]
        labelled = [LabelledFrame(one.configuration, np.empty((0, 0)), one.labelled_pair_m) for one in others]
        tree = grow_tree(labelled, others)
        for one in tried:
            if one.fold == fold:
                said = decide(tree, one.misfits, one.pairs_m).configuration
                column = len(classes) if said is None else classes.index(said)
                counts[classes.index(one.configuration), column] += 1
    return Confusion(classes, counts, len(folds))
