import numpy as np
import pytest

from core.anchors import JOINT_NAMES, Joint, Skeleton


def test_joints_keep_the_order_of_the_vocabulary(psi_points, make_skeleton) -> None:
    backwards = dict(reversed(list(psi_points.items())))
    assert tuple(make_skeleton(backwards).joints) == JOINT_NAMES


def test_a_joint_outside_the_vocabulary_is_a_mistake() -> None:
    joint = Joint("tail", np.zeros(3), np.zeros(2), 1.0, "hand")
    with pytest.raises(ValueError, match="tail"):
        Skeleton({"tail": joint})


def test_visible_joints_are_those_from_one_half(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points, hidden=("left_foot",))
    assert "left_foot" not in skeleton.visible()
    assert "left_foot" in skeleton.visible(0.1)
    assert skeleton.sees("head", "neck")
    assert not skeleton.sees("head", "left_foot")


def test_a_joint_placed_by_hand_replaces_the_found_one(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points)
    placed = Joint("left_hand", np.array([0.1, 0.2, 2.0]), np.array([10.0, 20.0]), 1.0, "hand")
    changed = skeleton.with_joint(placed)
    assert changed.joints["left_hand"] is placed
    assert skeleton.joints["left_hand"] is not placed
    assert tuple(changed.joints) == JOINT_NAMES


def test_a_skeleton_cannot_be_changed(psi_points, make_skeleton) -> None:
    with pytest.raises(TypeError):
        make_skeleton(psi_points).joints["head"] = None
