"""Body parts and limbs by the joints under the skin."""

from __future__ import annotations

import numpy as np
import pytest

from core.evaluation import PARTS, BodyMap

JOINTS = {
    "head": (0.0, -0.72, 2.3),
    "neck": (0.0, -0.55, 2.3),
    "torso": (0.0, -0.30, 2.3),
    "left_shoulder": (0.18, -0.50, 2.3),
    "left_elbow": (0.45, -0.50, 2.3),
    "left_hand": (0.75, -0.50, 2.3),
    "right_shoulder": (-0.18, -0.50, 2.3),
    "right_elbow": (-0.45, -0.50, 2.3),
    "right_hand": (-0.75, -0.50, 2.3),
    "left_hip": (0.10, 0.0, 2.3),
    "left_knee": (0.11, 0.42, 2.3),
    "left_foot": (0.12, 0.82, 2.3),
    "right_hip": (-0.10, 0.0, 2.3),
    "right_knee": (-0.11, 0.42, 2.3),
    "right_foot": (-0.12, 0.82, 2.3),
}
BODY = BodyMap({name: np.array(p) for name, p in JOINTS.items()})


@pytest.mark.parametrize(
    ("point", "part", "limb"),
    [
        ((0.0, -0.72, 2.20), "head", "head"),
        ((0.05, -0.30, 2.18), "trunk", "trunk"),
        ((-0.08, -0.05, 2.18), "trunk", "trunk"),
        ((0.09, -0.52, 2.24), "trunk", "trunk"),
        ((0.32, -0.50, 2.25), "upper arm", "left arm"),
        ((-0.55, -0.50, 2.26), "forearm", "right arm"),
        ((-0.74, -0.50, 2.28), "hand", "right arm"),
        ((0.85, -0.50, 2.28), "hand", "left arm"),
        ((0.11, 0.25, 2.21), "thigh", "left leg"),
        ((-0.11, 0.60, 2.25), "lower leg", "right leg"),
        ((-0.12, 0.86, 2.15), "foot", "right leg"),
    ],
)
def test_skin_belongs_to_the_bone_under_it(point, part, limb):
    place = BODY.place(np.array(point))
    assert (place.part, place.limb) == (part, limb)
    assert place.part in PARTS


def test_without_joints_nothing_is_said():
    empty = BodyMap({})
    assert empty.place(np.zeros(3)) is None
    assert empty.is_wrong_limb(np.zeros(3), np.ones(3)) is None


def test_the_other_arm_is_a_wrong_limb_and_the_same_arm_is_not():
    left, right = np.array([0.32, -0.50, 2.25]), np.array([-0.32, -0.50, 2.25])
    assert BODY.is_wrong_limb(right, left) is True
    assert BODY.is_wrong_limb(np.array([0.55, -0.50, 2.26]), left) is False


def test_a_small_error_across_a_joint_is_no_wrong_limb():
    shoulder = np.array([0.20, -0.50, 2.24])
    chest = np.array([0.16, -0.48, 2.22])
    assert BODY.place(shoulder).limb != BODY.place(chest).limb
    assert BODY.is_wrong_limb(chest, shoulder) is False


def test_the_other_side_of_the_trunk_counts_only_beyond_the_midline():
    left, right = np.array([0.08, -0.20, 2.18]), np.array([-0.08, -0.20, 2.18])
    assert BODY.is_wrong_limb(right, left) is True
    assert BODY.is_wrong_limb(np.array([0.01, -0.20, 2.18]), left) is False
    assert BODY.is_wrong_limb(np.array([0.08, -0.35, 2.18]), left) is False
