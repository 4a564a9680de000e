import numpy as np
import pytest

from core.anchors import Sides, exchange_sides, guard_left_right
from core.anchors.left_right import shoulder_order_m


def facing_away(points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: p * (-1, 1, 1) for name, p in points.items()}


def test_a_front_view_that_looks_like_one_is_accepted(psi_points, make_skeleton) -> None:
    report = guard_left_right(make_skeleton(psi_points), "front")
    assert report.sides is Sides.AGREE
    assert report.warnings == ()


def test_a_back_view_that_looks_like_one_is_accepted(psi_points, make_skeleton) -> None:
    assert guard_left_right(make_skeleton(facing_away(psi_points)), "back").sides is Sides.AGREE


@pytest.mark.parametrize("view", ["front", "back"])
def test_exchanged_sides_are_said_and_never_mended(view, psi_points, make_skeleton) -> None:
    right = psi_points if view == "front" else facing_away(psi_points)
    skeleton = exchange_sides(make_skeleton(right))
    before = {name: joint.point_m.copy() for name, joint in skeleton.joints.items()}
    report = guard_left_right(skeleton, view)
    assert report.sides is Sides.EXCHANGED
    assert "Check the view" in report.warnings[0]
    assert "nothing was exchanged" in report.warnings[0]
    for name, joint in skeleton.joints.items():
        np.testing.assert_array_equal(joint.point_m, before[name])


def test_a_second_opinion_that_differs_makes_unsure(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points)
    agreeing = make_skeleton({name: p + 0.03 for name, p in psi_points.items()})
    assert guard_left_right(skeleton, "front", agreeing).sides is Sides.AGREE
    report = guard_left_right(skeleton, "front", exchange_sides(agreeing))
    assert report.sides is Sides.UNSURE
    assert "disagree about left and right" in report.warnings[0]


def test_a_second_opinion_counts_for_views_in_free_text(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points)
    assert guard_left_right(skeleton, "left arm, close").sides is Sides.AGREE
    assert guard_left_right(skeleton, "left arm, close", exchange_sides(skeleton)).sides is Sides.UNSURE


def test_someone_sideways_in_a_front_view_is_unsure(psi_points, make_skeleton) -> None:
    sideways = {name: np.array([0.1 * p[0], p[1], 2.6 + p[0]]) for name, p in psi_points.items()}
    report = guard_left_right(make_skeleton(sideways), "front")
    assert report.sides is Sides.UNSURE
    assert "sideways" in report.warnings[0]


def test_hidden_shoulders_cannot_be_checked(psi_points, make_skeleton) -> None:
    report = guard_left_right(make_skeleton(psi_points, hidden=("left_shoulder",)), "front")
    assert report.sides is Sides.UNSURE


@pytest.mark.parametrize(("view", "sign"), [("left", -1), ("right", 1)])
def test_in_a_side_view_that_side_is_nearer(view, sign, psi_points, make_skeleton) -> None:
    near = {name: np.array([0.0, p[1], 2.6 + sign * p[0]]) for name, p in psi_points.items()}
    assert guard_left_right(make_skeleton(near), view).sides is Sides.AGREE
    far = {name: np.array([0.0, p[1], 2.6 - sign * p[0]]) for name, p in psi_points.items()}
    assert guard_left_right(make_skeleton(far), view).sides is Sides.EXCHANGED


def test_crossed_arms_do_not_exchange_the_sides(psi_points, make_skeleton) -> None:
    crossed = dict(psi_points)
    crossed["left_elbow"], crossed["right_elbow"] = psi_points["right_elbow"], psi_points["left_elbow"]
    skeleton = make_skeleton(crossed)
    assert shoulder_order_m(skeleton) is not None
    assert guard_left_right(skeleton, "front").sides is Sides.AGREE


def test_exchanging_twice_changes_nothing(psi_points, make_skeleton) -> None:
    skeleton = make_skeleton(psi_points)
    again = exchange_sides(exchange_sides(skeleton))
    for name, joint in again.joints.items():
        assert joint.name == name
        np.testing.assert_array_equal(joint.point_m, skeleton.point(name))
