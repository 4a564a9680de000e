"""How much the joints between two skin places bent from one visit to the next.

Skin keeps its length within a body part, but over a shoulder that is raised or a hip that is bent it folds
and slides: a geodesic that crosses bent joints is less certain. The spread of a distance between two places
grows by `SPREAD_M_PER_RAD` times the root sum of squares of the bends between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import Bone, nearest_bone
from core.relocation.pair import VisitPair

FloatArray = NDArray[np.float64]

SPREAD_M_PER_RAD = 0.35
"""Learned on the tuning bodies."""


@dataclass(frozen=True, eq=False)
class Articulation:
    """Bends of the skeleton between two captures.

    Attributes
    ----------
    bones : tuple of Bone
    chains : ndarray (b, b) bool
        ``chains[i, j]``: joint j, where bone j hangs on its parent, lies between bone i and the trunk.
    bend_rad : ndarray (b,)
        How far each bone turned against its parent.
    trunk_twist_rad : float
        How far the shoulders turned against the hips.
    trunk_axis : ndarray (2, 3)
        Hips and shoulders of the first visit: where the twist is spread out.
    """

    bones: tuple[Bone, ...]
    chains: NDArray[np.bool_]
    bend_rad: FloatArray
    trunk_twist_rad: float
    trunk_axis: FloatArray

    def spread_m(self, one: FloatArray, two: FloatArray) -> FloatArray:
        """Spread (k, m) that bending adds to distances between first-visit places (k, 3) and (m, 3)."""
        if not self.bones:
            return np.zeros((len(one), len(two)))
        chain1, level1 = self._places(one)
        chain2, level2 = self._places(two)
        crossed = chain1[:, None, :] ^ chain2[None, :, :]
        square = (crossed * self.bend_rad**2).sum(axis=2)
        square = square + (self.trunk_twist_rad * (level1[:, None] - level2[None, :])) ** 2
        return np.asarray(SPREAD_M_PER_RAD * np.sqrt(square))

    def _places(self, places: FloatArray) -> tuple[NDArray[np.bool_], FloatArray]:
        owners = [self.bones.index(nearest_bone(p, self.bones)) for p in places]
        hips, shoulders = self.trunk_axis
        axis = shoulders - hips
        roots = np.array([self._root(p, o) for p, o in zip(places, owners, strict=True)]).reshape(-1, 3)
        level = (roots - hips) @ axis / max(float(axis @ axis), 1e-9)
        return self.chains[owners].reshape(len(places), -1), np.clip(level, 0.0, 1.0)

    def _root(self, place: FloatArray, owner: int) -> FloatArray:
        """Where a place hangs on the trunk: itself, or the joint of its limb."""
        joints = np.flatnonzero(self.chains[owner])
        return place if len(joints) == 0 else self.bones[int(joints[0])].start


def articulation(pair: VisitPair, skeleton: tuple[Bone, ...]) -> Articulation:
    """The bends between the two captures of a pair; none without a skeleton."""
    count = len(skeleton)
    chains = np.zeros((count, count), bool)
    bend = np.zeros(count)
    for i, bone in enumerate(skeleton):
        if bone.parent is None:
            continue
        chains[i] = chains[bone.parent]
        chains[i, i] = True
        bend[i] = _angle(skeleton[bone.parent].rotation.T @ bone.rotation)
    seen = set(pair.first.skeleton.visible()) & set(pair.followup.skeleton.visible())
    twist, axis = 0.0, np.zeros((2, 3))
    if count and {"left_shoulder", "right_shoulder", "left_hip", "right_hip"} <= seen:
        shoulder = [pair.joints_m("left_shoulder")[k] - pair.joints_m("right_shoulder")[k] for k in (0, 1)]
        hip = [pair.joints_m("left_hip")[k] - pair.joints_m("right_hip")[k] for k in (0, 1)]
        back = [skeleton[0].rotation.T @ shoulder[1], skeleton[0].rotation.T @ hip[1]]
        twist = _between(shoulder[0], back[0]) + _between(hip[0], back[1])
        axis = np.array(
            [
                (pair.joints_m("left_hip")[0] + pair.joints_m("right_hip")[0]) / 2,
                (pair.joints_m("left_shoulder")[0] + pair.joints_m("right_shoulder")[0]) / 2,
            ]
        )
    return Articulation(skeleton, chains, bend, twist, axis)


def _angle(rotation: FloatArray) -> float:
    return float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))


def _between(a: FloatArray, b: FloatArray) -> float:
    cosine = float(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-9)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))
