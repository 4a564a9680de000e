"""Several views, one lesion: which answer counts, and when two answers contradict each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture
from core.relocation import LesionQuery, RelocatedLesion, Spot, relocate_visit
from core.relocation.pair import VisitPair
from core.relocation.types import Region
from core.relocation.view_choice import best_of_views, is_settled
from core.relocation.view_crossing import Crossing
from core.relocation.view_spots import PairSpots, SpotsOfVisits
from core.relocation.views import BoneBridge, frontality, is_rigid, opposite, turn_deg
from devices.simulator import STILL, CaptureTruth, SimulatedPatient
from devices.trackers import default_tracker
from tests.app.cli.cases import small_rig

Views = dict[str, tuple[AnalysedCapture, CaptureTruth]]


@pytest.fixture(scope="module")
def views() -> Views:
    """One patient from the front, the left and the back, with true joints."""
    patient = SimulatedPatient(
        "f_young_avg", seed=3, moles=60, lesions=30, freckles=0, variation=STILL, rig=small_rig()
    )
    out = {}
    for view in ("front", "left", "back"):
        taken = patient.capture("A", view, 2, frames=1, joints=True)
        out[view] = (analyse_capture(taken.capture, default_tracker()), taken.truth)
    return out


@pytest.fixture(scope="module")
def captures(views: Views) -> dict[str, AnalysedCapture]:
    return {name: analysed for name, (analysed, _) in views.items()}


def _shared(views: Views, a: str, b: str) -> list[tuple[np.ndarray, np.ndarray]]:
    one, two = views[a][1], views[b][1]
    seen = [
        (i, two.mole_ids.index(name))
        for i, name in enumerate(one.mole_ids)
        if one.mole_visible[i] and name in two.mole_ids and two.mole_visible[two.mole_ids.index(name)]
    ]
    return [(np.asarray(one.mole_points_m[i]), np.asarray(two.mole_points_m[j])) for i, j in seen]


def _answer(
    status: str, point: np.ndarray | None, size: float, capture: str, **more: object
) -> RelocatedLesion:
    region = None if point is None else Region((size, size), np.array([1.0, 0.0, 0.0]))
    return RelocatedLesion(
        "L1", status, f"{capture} says {status}.", point_m=point, confidence=0.8, radius95_m=size,
        region=region, capture=capture, **more,
    )  # type: ignore[arg-type]  # fmt: skip


def test_the_skeleton_carries_places_between_views_to_a_few_centimetres(views: Views) -> None:
    for a, b in (("front", "left"), ("left", "back")):
        bridge = BoneBridge(views[a][0], views[b][0])
        pairs = _shared(views, a, b)
        assert len(pairs) >= 2
        for here, there in pairs:
            carried = bridge.carry(here)
            assert carried is not None
            assert np.linalg.norm(carried.point_m - there) < 0.04


def test_guessed_joints_carry_nothing(views: Views) -> None:
    front, left = views["front"][0], views["left"][0]
    assert is_rigid(VisitPair(front, left))
    assert turn_deg(VisitPair(front, left)) == pytest.approx(90, abs=3)
    joints = dict(left.skeleton.joints)
    moved = joints["left_shoulder"].point_m + np.array([0.2, 0.0, 0.1])
    joints["left_shoulder"] = replace(joints["left_shoulder"], point_m=moved)
    guessed = replace(left, skeleton=replace(left.skeleton, joints=joints))
    assert not is_rigid(VisitPair(front, guessed))
    assert turn_deg(VisitPair(front, guessed)) is None
    place = _shared(views, "front", "left")[0][0]
    assert BoneBridge(front, guessed).carry(place) is None


def test_status_counts_first_then_the_size_of_the_region(
    views: Views, captures: dict[str, AnalysedCapture]
) -> None:
    here, there = _shared(views, "front", "left")[0]
    cases = (
        (("found", 0.03), ("predicted", 0.01), "front"),
        (("predicted", 0.03), ("predicted", 0.02), "left"),
        (("ambiguous", 0.01), ("predicted", 0.03), "left"),
    )
    for front, left, winner in cases:
        answers = [_answer(front[0], here, front[1], "front"), _answer(left[0], there, left[1], "left")]
        for order in (answers, answers[::-1]):
            best, doubt = best_of_views(order, captures)
            assert (best.capture, doubt) == (winner, "")


def test_equal_answers_go_to_the_view_that_sees_the_skin_from_the_front(
    views: Views, captures: dict[str, AnalysedCapture]
) -> None:
    here, there = _shared(views, "front", "left")[0]
    expected = (
        "front" if frontality(captures["front"], here) > frontality(captures["left"], there) else "left"
    )
    best, _ = best_of_views(
        [_answer("found", here, 0.005, "front"), _answer("found", there, 0.005, "left")], captures
    )
    assert best.capture == expected


def test_views_that_answer_with_different_skin_say_so(
    views: Views, captures: dict[str, AnalysedCapture]
) -> None:
    pairs = _shared(views, "front", "left")
    here = pairs[0][0]
    far = max((there for _, there in pairs), key=lambda p: np.linalg.norm(p - pairs[0][1]))
    assert np.linalg.norm(far - pairs[0][1]) > 0.2
    best, doubt = best_of_views(
        [_answer("found", here, 0.005, "front"), _answer("predicted", far, 0.02, "left")], captures
    )
    assert best.capture == "front"
    assert best.status == "ambiguous"
    assert best.confidence == pytest.approx(0.4)
    assert "front" in doubt
    assert "left" in doubt
    assert "cm apart" in doubt
    assert best.point_m is here


def test_not_visible_only_if_no_view_sees_it_refused_only_if_all_refuse(
    views: Views, captures: dict[str, AnalysedCapture]
) -> None:
    nothing = [_answer("refused", None, 0, "back"), _answer("not_visible", None, 0, "left")]
    best, _ = best_of_views(nothing, captures)
    assert best.status == "not_visible"
    assert "back" in best.reason
    assert "left" in best.reason
    refused, _ = best_of_views([_answer("refused", None, 0, c) for c in ("back", "left")], captures)
    assert refused.status == "refused"
    seen, _ = best_of_views(
        [*nothing, _answer("predicted", _shared(views, "front", "left")[0][0], 0.02, "front")], captures
    )
    assert seen.status == "predicted"


def test_a_tight_answer_needs_no_second_view(views: Views, captures: dict[str, AnalysedCapture]) -> None:
    front = captures["front"]
    vertices = front.scan.surface.vertices
    facing = -np.einsum("nc,nc->n", front.scan.surface.normals, vertices) / np.linalg.norm(vertices, axis=1)
    frontal, grazing = vertices[facing.argmax()], vertices[np.abs(facing - 0.3).argmin()]
    assert is_settled(_answer("found", frontal, 0.008, "front"), front, appearance=True)
    assert not is_settled(_answer("found", frontal, 0.03, "front"), front, appearance=True)
    assert not is_settled(_answer("predicted", frontal, 0.008, "front"), front, appearance=True)
    assert is_settled(_answer("predicted", frontal, 0.008, "front"), front, appearance=False)
    assert not is_settled(_answer("predicted", grazing, 0.008, "front"), front, appearance=False)
    assert not is_settled(_answer("not_visible", None, 0, "front"), front, appearance=True)


def test_a_spot_stays_new_only_if_every_view_that_shows_its_skin_misses_it(
    views: Views, captures: dict[str, AnalysedCapture]
) -> None:
    front, left = captures["front"], captures["left"]
    bridge = BoneBridge(left, front)
    both = next(t for _, t in _shared(views, "front", "left") if bridge.carry(t).seen)  # type: ignore[union-attr]
    spot = Spot((100.0, 100.0), both, 0.9)
    same = {"front": front, "left": left}
    lists = [PairSpots("left", "left", (spot,), ()), PairSpots("front", "left", (), ())]
    assert SpotsOfVisits(same, same, lists).only_in_one_visit()[0] == ()
    lists = [PairSpots("left", "left", (spot,), ()), PairSpots("front", "left", (spot,), ())]
    (kept,), gone = SpotsOfVisits(same, same, lists).only_in_one_visit()
    assert (kept.capture, kept.pixel, gone) == ("left", (100.0, 100.0), ())


def test_a_new_spot_seen_in_two_views_is_one(views: Views, captures: dict[str, AnalysedCapture]) -> None:
    here, there = _shared(views, "front", "left")[0]
    lists = [
        PairSpots("front", "front", (Spot((10.0, 10.0), here, 0.6),), ()),
        PairSpots("left", "left", (Spot((90.0, 10.0), there, 0.8),), ()),
    ]
    two = {"front": captures["front"], "left": captures["left"]}
    new, _ = SpotsOfVisits(two, two, lists).only_in_one_visit()
    assert [s.capture for s in new] == ["left"]


def test_opposite_sides_are_not_searched(views: Views, captures: dict[str, AnalysedCapture]) -> None:
    assert opposite(captures["front"], captures["back"])
    truth = views["front"][1]
    name = next(n for n, v in zip(truth.mole_ids, truth.mole_visible, strict=True) if v and n.startswith("L"))
    u, v = truth.mole_pixels[truth.mole_ids.index(name)]
    query = LesionQuery(name, pixel=(float(u), float(v)), capture="front")
    result = relocate_visit({"front": captures["front"]}, captures, [query], method="trilateration")
    answer = result[name]
    assert answer.point_m is not None
    assert answer.capture in ("front", "left")
    assert result.seconds["total"] > 0


def test_an_answer_in_another_view_counts_only_where_the_skeleton_carries_it(views: Views) -> None:
    front, left = views["front"][0], views["left"][0]
    query, here, there = _query_in_both(views)
    crossing = Crossing(front, left)
    assert crossing.is_crossing
    right = _answer("predicted", there, 0.02, "left")
    assert crossing.judged(query, right) is right
    elsewhere = left.scan.surface.nearest(there + np.array([0.0, 0.5, 0.0]))[0].position_m
    wrong = crossing.judged(query, _answer("predicted", np.asarray(elsewhere), 0.02, "left"))
    assert (wrong.status, wrong.point_m) == ("refused", None)
    doubted = crossing.judged(query, _answer("found", np.asarray(elsewhere), 0.01, "left"))
    assert doubted.status == "ambiguous"
    assert doubted.confidence < 0.8
    own = Crossing(front, front)
    assert not own.is_crossing
    strange = _answer("predicted", np.asarray(here + 0.3), 0.02, "front")
    assert own.judged(query, strange) is strange


def test_where_the_joints_do_not_fit_nothing_is_answered_in_another_view(views: Views) -> None:
    front, left = views["front"][0], views["left"][0]
    query, _, there = _query_in_both(views)
    joints = dict(left.skeleton.joints)
    moved = joints["left_shoulder"].point_m + np.array([0.2, 0.0, 0.1])
    joints["left_shoulder"] = replace(joints["left_shoulder"], point_m=moved)
    crossing = Crossing(front, replace(left, skeleton=replace(left.skeleton, joints=joints)))
    assert crossing.is_crossing, "the sides' names tell"
    assert crossing.judged(query, _answer("predicted", there, 0.02, "left")).status == "refused"
    seen = crossing.judged(query, _answer("found", there, 0.005, "left"))
    assert (seen.status, seen.point_m) == ("refused", None), "spots are matched from a wrong start, too"


def _query_in_both(views: Views) -> tuple[LesionQuery, np.ndarray, np.ndarray]:
    """A lesion that front and left see, where the skeleton says so, too."""
    one, two = views["front"][1], views["left"][1]
    bridge = BoneBridge(views["front"][0], views["left"][0])
    for i, name in enumerate(one.mole_ids):
        if (
            not one.mole_visible[i]
            or name not in two.mole_ids
            or not two.mole_visible[two.mole_ids.index(name)]
        ):
            continue
        here, there = one.mole_points_m[i], two.mole_points_m[two.mole_ids.index(name)]
        carried = bridge.carry(np.asarray(here))
        if carried is not None and carried.seen:
            u, v = one.mole_pixels[i]
            return LesionQuery(name, pixel=(float(u), float(v)), capture="front"), here, there
    raise AssertionError("no lesion is seen by both")
