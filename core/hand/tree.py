"""The decision tree that tells configurations apart by geodesics between points (thesis figure 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_LEAF_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class ConfigurationTree:
    """A binary tree over the 105 distances between points; plain arrays, so that a file can hold it.

    Attributes
    ----------
    classes : tuple of str
    left, right : ndarray (n,) int64
        Children; -1 at a leaf.
    feature : ndarray (n,) int64
        Which pair is asked (`names.PAIRS`); -1 at a leaf.
    threshold_m : ndarray (n,)
        Go left at or below.
    missing_left : ndarray (n,) bool
        Where a pair goes that was not measured.
    share : ndarray (n, c)
        Of the training frames at the node, by class; weighted so that classes count alike.
    frames : ndarray (n,) int64
        Training frames at the node.
    """

    classes: tuple[str, ...]
    left: IntArray
    right: IntArray
    feature: IntArray
    threshold_m: FloatArray
    missing_left: NDArray[np.bool_]
    share: FloatArray
    frames: IntArray

    def leaf(self, pair_m: FloatArray) -> int:
        """Node at which distances (105,), NaN for those not measured, arrive."""
        node = 0
        while self.left[node] >= 0:
            value = pair_m[self.feature[node]]
            to_left = self.missing_left[node] if np.isnan(value) else value <= self.threshold_m[node]
            node = int(self.left[node] if to_left else self.right[node])
        return node

    def likelihood(self, pair_m: FloatArray) -> FloatArray:
        """Share (c,) of each class among the training frames that the tree cannot tell from this one."""
        return np.asarray(self.share[self.leaf(pair_m)])


def learn_tree(pairs_m: FloatArray, names: Sequence[str], *, seed: int = 0) -> ConfigurationTree:
    """Grow a tree from distances of frames whose configuration is known.

    Parameters
    ----------
    pairs_m : ndarray (n, 105)
        Metres; NaN for pairs that were not measured.
    names : sequence of str
        Configuration of every frame.
    seed : int
        Of the choice between splits that are equally good.

    Raises
    ------
    InputError
        If there are not at least two configurations.
    """
    from sklearn.tree import DecisionTreeClassifier

    if len(set(names)) < 2:
        raise InputError("A decision tree needs at least two configurations.")
    least = max(2, round(_LEAF_SHARE * len(names)))
    grown: Any = DecisionTreeClassifier(
        min_samples_leaf=least,
        class_weight="balanced",
        random_state=seed,
    )
    grown.fit(pairs_m, list(names))
    tree = grown.tree_
    share = tree.value[:, 0, :]
    return ConfigurationTree(
        classes=tuple(map(str, grown.classes_)),
        left=tree.children_left.astype(np.int64),
        right=tree.children_right.astype(np.int64),
        feature=np.where(tree.children_left < 0, -1, tree.feature).astype(np.int64),
        threshold_m=tree.threshold.astype(float),
        missing_left=np.asarray(tree.missing_go_to_left).astype(bool),
        share=share / np.maximum(share.sum(axis=1, keepdims=True), 1e-12),
        frames=tree.n_node_samples.astype(np.int64),
    )
