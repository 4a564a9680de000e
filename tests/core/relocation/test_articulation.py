"""Distances over joints that bent between the visits count for less."""

from __future__ import annotations

import numpy as np
import pytest

from core.relocation.articulation import Articulation
from core.relocation.bones import Bone, carry, minimal_rotation, nearest_bone


def straight_arm(bend_rad: float) -> Articulation:
    """A trunk with one arm of two bones; the elbow bent by so much."""
    still, turn = (
        np.eye(3),
        minimal_rotation(np.array([1.0, 0, 0]), np.array([np.cos(bend_rad), np.sin(bend_rad), 0])),
    )
    trunk = Bone("trunk", np.zeros(3), np.array([0, 0.5, 0.0]), 0.15, still, np.zeros(3))
    upper = Bone("upper", np.array([0.2, 0, 0]), np.array([0.5, 0, 0]), 0.09, still, np.array([0.2, 0, 0]), 0)
    fore = Bone("fore", np.array([0.5, 0, 0]), np.array([0.8, 0, 0]), 0.06, turn, np.array([0.5, 0, 0]), 1)
    chains = np.array([[False] * 3, [False, True, False], [False, True, True]])
    axis = np.array([[0, 0.5, 0], [0, 0, 0.0]])
    return Articulation((trunk, upper, fore), chains, np.array([0, 0, bend_rad]), 0.0, axis)


def test_only_ways_over_the_bent_joint_are_doubted():
    joints = straight_arm(1.0)
    wrist, elbow_side, shoulder_side, belly = [[0.75, 0, 0]], [[0.6, 0, 0]], [[0.3, 0, 0]], [[0.0, 0.3, 0]]
    assert joints.spread_m(np.array(wrist), np.array(elbow_side))[0, 0] == 0.0
    assert joints.spread_m(np.array(shoulder_side), np.array(belly))[0, 0] == 0.0
    over = joints.spread_m(np.array(wrist), np.array(shoulder_side))[0, 0]
    assert over > 0.02
    assert joints.spread_m(np.array(wrist), np.array(belly))[0, 0] == pytest.approx(over)


def test_without_a_skeleton_nothing_is_doubted():
    none = Articulation((), np.zeros((0, 0), bool), np.zeros(0), 0.0, np.zeros((2, 3)))
    assert (none.spread_m(np.zeros((2, 3)), np.zeros((4, 3))) == np.zeros((2, 4))).all()


def test_a_place_moves_with_the_bone_that_it_belongs_to():
    joints = straight_arm(np.pi / 2)
    place = np.array([0.7, 0.05, 0.0])
    bone = nearest_bone(place, joints.bones)
    assert bone.name == "fore"
    assert carry(place, bone) == pytest.approx([0.45, 0.2, 0.0])
