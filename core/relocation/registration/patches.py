"""Which bone every patch of skin belongs to.

The nearest bone is not always the own one: a hand that hangs beside the thigh is nearer to the thigh's bone.
But it is connected to the forearm and not to the thigh, and a patch belongs to what it is connected to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from core.relocation.bones import Bone
from core.relocation.shortcuts import owners

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

STRAY_SHARE = 0.5
"""A patch smaller than this share of its bone's largest patch may belong to another bone."""
ROUNDS = 3


def near_bones(skeleton: tuple[Bone, ...]) -> NDArray[np.bool_]:
    """Which bones (b, b) share a joint, or are one."""
    count = len(skeleton)
    out = np.eye(count, dtype=bool)
    for i, bone in enumerate(skeleton):
        if bone.parent is not None:
            out[i, bone.parent] = out[bone.parent, i] = True
    return out


def patch_owners(skeleton: tuple[Bone, ...], places: FloatArray, edges: IntArray) -> NDArray[np.intp]:
    """Bone (n,) of each place (n, 3), given which places (e, 2) are joined along the skin."""
    owner = owners(skeleton, places)
    for _ in range(ROUNDS):
        same = owner[edges[:, 0]] == owner[edges[:, 1]]
        inner = edges[same]
        graph = coo_matrix((np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(len(places),) * 2)
        count, patch = connected_components(graph, directed=False)
        size = np.bincount(patch, minlength=count)
        bone_of_patch = np.zeros(count, np.intp)
        bone_of_patch[patch] = owner
        largest = np.zeros(len(skeleton), np.int64)
        np.maximum.at(largest, bone_of_patch, size)
        stray = size < STRAY_SHARE * largest[bone_of_patch]
        across = edges[~same]
        both = np.concatenate([across, across[:, ::-1]])
        from_patch = patch[both[:, 0]]
        votes = np.zeros((count, len(skeleton)), np.int64)
        np.add.at(votes, (from_patch, owner[both[:, 1]]), 1)
        moved = stray & (votes.sum(axis=1) > 0)
        if not moved.any():
            break
        new = np.where(moved, votes.argmax(axis=1), bone_of_patch)
        owner = new[patch]
    return owner


class SkinOwners:
    """Bones of the patches of one surface, for any place on it.

    Parameters
    ----------
    skeleton : tuple of Bone
    places : ndarray (n, 3)
        Samples of the surface.
    edges : ndarray (e, 2)
        Samples that are joined along the skin.
    """

    def __init__(self, skeleton: tuple[Bone, ...], places: FloatArray, edges: IntArray) -> None:
        self.skeleton = skeleton
        self.of_samples = patch_owners(skeleton, places, edges)
        self._tree = cKDTree(places)
        self._near = near_bones(skeleton)

    def at(self, places: FloatArray) -> NDArray[np.intp]:
        """Number (k,) of the bone of each place (k, 3)."""
        return np.asarray(self.of_samples[self._tree.query(places)[1]])

    def may_carry(self, places: FloatArray) -> NDArray[np.bool_]:
        """Which bones (k, b) may move a place: its own and those that share a joint with it."""
        return np.asarray(self._near[self.at(places)])
