"""Specification: the tree is grown from, and asked about, distances as the tracker finds them."""

from __future__ import annotations

import numpy as np

from core.hand.model import LabelledFrame
from core.hand.names import PAIRS
from core.hand.trying import Confusion, Tried, cross_judge, grow_tree


def made_up(count: int, *, telling: bool) -> tuple[list[LabelledFrame], list[Tried]]:
    """Frames of two configurations whose distances tell them apart, or are noise."""
    rng = np.random.default_rng(8)
    frames, tried = [], []
    for k in range(count):
        name = "AB"[k % 2]
        pair_m = rng.uniform(0.05, 0.15, len(PAIRS))
        if telling:
            pair_m[3] = 0.03 if k % 2 else 0.17
        frames.append(LabelledFrame(name, np.zeros((15, 6)), pair_m))
        tried.append(Tried(name, k // 2 % 5, pair_m, {"A": pair_m, "B": pair_m}, {"A": 3.0, "B": 3.0}))
    return frames, tried


def test_frames_are_judged_by_a_tree_that_has_not_seen_them() -> None:
    """Noise is learned by heart without fault; frames not learned from are guessed, or said to be unknown."""
    frames, tried = made_up(60, telling=False)
    tree = grow_tree(frames, tried)
    by_heart = [tree.classes[int(np.argmax(tree.likelihood(f.pair_m)))] == f.configuration for f in frames]
    assert np.mean(by_heart) > 0.9
    assert cross_judge(frames, tried).accuracy < 0.7
    assert cross_judge(*made_up(60, telling=True)).accuracy == 1.0


def test_the_confusion_matrix_has_the_truth_in_its_rows() -> None:
    confusion = Confusion(("A", "B"), np.array([[3, 1, 0], [0, 3, 1]]), 4)
    assert confusion.accuracy == 6 / 8
    asked = cross_judge(*made_up(20, telling=True))
    assert asked.classes == ("A", "B")
    assert asked.counts.tolist() == [[10, 0, 0], [0, 10, 0]]
    assert asked.folds == 5


def test_a_configuration_that_fits_badly_is_not_told_whatever_the_tree_says() -> None:
    frames, tried = made_up(20, telling=True)
    bad = [
        Tried(t.configuration, t.fold, t.labelled_pair_m, t.pairs_m, {"A": 90.0, "B": 91.0}) for t in tried
    ]
    assert cross_judge(frames, bad).counts.tolist() == [[0, 0, 10], [0, 0, 10]]
