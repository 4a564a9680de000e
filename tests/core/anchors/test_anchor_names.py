from hypothesis import given
from hypothesis import strategies as st

from core.anchors.names import (
    BONES,
    EXTRA_NAMES,
    JOINT_NAMES,
    LANDMARK_NAMES,
    LIMBS,
    OPPOSITE_LANDMARKS,
    opposite,
)


def test_there_are_the_fifteen_joints_of_the_thesis() -> None:
    assert len(JOINT_NAMES) == len(set(JOINT_NAMES)) == 15


def test_there_are_the_33_landmarks_of_the_pose_model() -> None:
    assert len(LANDMARK_NAMES) == len(set(LANDMARK_NAMES)) == 33
    assert set(EXTRA_NAMES) <= set(LANDMARK_NAMES)


@given(st.sampled_from((*JOINT_NAMES, *LANDMARK_NAMES)))
def test_the_opposite_of_the_opposite_is_the_place_itself(name: str) -> None:
    assert opposite(opposite(name)) == name
    assert (opposite(name) == name) == ("left" not in name and "right" not in name)


def test_opposites_of_landmarks_exchange_pairs() -> None:
    assert [OPPOSITE_LANDMARKS[k] for k in OPPOSITE_LANDMARKS] == list(range(33))
    assert LANDMARK_NAMES[OPPOSITE_LANDMARKS[LANDMARK_NAMES.index("mouth_left")]] == "mouth_right"


def test_bones_form_one_tree_over_all_joints() -> None:
    assert {"neck", *(far for _, far in BONES)} == set(JOINT_NAMES)
    assert len(BONES) == 14
    for limb in LIMBS:
        assert (limb[0], limb[1]) in BONES
        assert (limb[1], limb[2]) in BONES
