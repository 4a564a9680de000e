"""A way over skin that merely touches is told from a way along the body."""

from __future__ import annotations

import numpy as np
import pytest

from core.relocation.bones import Bone
from core.relocation.shortcuts import is_shortcut, moved, owners, skeleton_way_m


@pytest.fixture
def hanging_arm():
    """A trunk and an arm that hangs beside it: the hand is near the hip."""
    still = np.eye(3)

    def bone(name, start, end, radius, parent):
        return Bone(name, np.array(start), np.array(end), radius, still, np.array(start), parent)

    return (
        bone("trunk", [0, 0, 0.0], [0, 0.5, 0.0], 0.15, None),
        bone("upper", [0.2, 0.05, 0], [0.25, 0.3, 0], 0.09, 0),
        bone("fore", [0.25, 0.3, 0], [0.25, 0.55, 0], 0.06, 1),
    )


def test_hand_to_hip_goes_over_the_shoulder(hanging_arm):
    hand, hip = np.array([[0.26, 0.52, 0]]), np.array([[0.1, 0.5, 0]])
    way = skeleton_way_m(hanging_arm, hand, hip)[0, 0]
    assert way == pytest.approx(0.22 + 0.255 + 0.46, abs=0.02)
    assert is_shortcut(hanging_arm, hand, hip, np.array([[0.16]]))[0, 0]
    assert not is_shortcut(hanging_arm, hand, hip, np.array([[0.85]]))[0, 0]
    assert not is_shortcut(hanging_arm, hand, hip, np.array([[np.inf]]))[0, 0]


def test_neighbouring_parts_are_never_doubted(hanging_arm):
    elbow, shoulder = np.array([[0.25, 0.32, 0]]), np.array([[0.22, 0.1, 0]])
    chest = np.array([[0.05, 0.2, 0]])
    assert not is_shortcut(hanging_arm, elbow, shoulder, np.array([[0.01]])).any()
    assert not is_shortcut(hanging_arm, shoulder, chest, np.array([[0.01]])).any()


def test_without_a_skeleton_nothing_is_doubted():
    assert not is_shortcut((), np.zeros((2, 3)), np.zeros((3, 3)), np.zeros((2, 3))).any()


def test_places_belong_to_the_bone_nearest_in_its_own_radii(hanging_arm):
    places = np.array([[0.25, 0.5, 0], [0.0, 0.25, 0.1], [0.23, 0.2, 0]])
    assert owners(hanging_arm, places).tolist() == [2, 0, 1]


def test_bones_are_also_known_where_the_follow_up_has_them():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    bone = Bone("fore", np.zeros(3), np.array([0.3, 0, 0]), 0.06, turn, np.array([1.0, 0, 0]), None)
    (there,) = moved((bone,))
    assert there.start == pytest.approx([1, 0, 0])
    assert there.end == pytest.approx([1, 0.3, 0])
