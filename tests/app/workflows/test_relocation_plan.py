"""Each lesion is looked for once, from its newest sure place, on the capture that shows the same side."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from app.workflows.plan import KnownPlace, newest_of_each_view, pending, plan_relocation

VIEWS = ("front", "back", "left", "right", "turned a little")


def place(lesion: int, capture: int, view: str = "front", visit: int = 1) -> KnownPlace:
    return KnownPlace(lesion, capture, view, visit, (float(capture), float(lesion)))


def test_a_retake_replaces_the_capture_of_its_view() -> None:
    assert newest_of_each_view([(1, "front"), (2, "back"), (3, "front")]) == {"front": 3, "back": 2}


def test_lesions_of_one_earlier_capture_are_looked_for_together() -> None:
    plan = plan_relocation([place(1, 10), place(2, 10), place(3, 11, "back")], {"front": 20, "back": 21})
    assert [(s.reference_capture_id, s.target_capture_id, len(s.places)) for s in plan.searches] == [
        (10, 20, 2),
        (11, 21, 1),
    ]


def test_the_newest_place_in_a_captured_view_is_the_reference() -> None:
    places = [place(1, 10, visit=1), place(1, 14, visit=2), place(1, 15, "back", visit=3)]
    assert plan_relocation(places, {"front": 20}).searches[0].reference_capture_id == 14


def test_a_lesion_of_a_side_that_was_not_captured_is_out_of_view_and_says_so() -> None:
    plan = plan_relocation([place(1, 10, "back")], {"front": 20})
    assert not plan.searches
    assert "back view" in plan.out_of_view[0].reason


def test_what_was_looked_for_on_a_replaced_capture_is_pending_again() -> None:
    plan = plan_relocation([place(1, 10), place(2, 10)], {"front": 21})
    assert pending(plan, {1: {21}, 2: {20}}).lesion_ids == {2}
    assert len(pending(plan, {1: {21}, 2: {20, 21}})) == 0


def test_an_unseen_lesion_becomes_pending_when_its_side_is_captured() -> None:
    places = [place(1, 10, "back")]
    assert len(pending(plan_relocation(places, {"front": 20}), {1: {20}})) == 0
    assert pending(plan_relocation(places, {"front": 20, "back": 22}), {1: {20}}).lesion_ids == {1}


@given(
    st.lists(
        st.builds(place, st.integers(1, 6), st.integers(1, 9), st.sampled_from(VIEWS), st.integers(1, 4)),
        max_size=30,
    ),
    st.dictionaries(st.sampled_from(VIEWS), st.integers(20, 29), max_size=4),
)
def test_every_known_lesion_is_planned_exactly_once(
    places: list[KnownPlace], current: dict[str, int]
) -> None:
    plan = plan_relocation(places, current)
    planned = [p.lesion_id for s in plan.searches for p in s.places] + [o.lesion_id for o in plan.out_of_view]
    assert sorted(planned) == sorted({p.lesion_id for p in places})
    assert all(s.target_capture_id == current.get(s.view, s.target_capture_id) for s in plan.searches)
    assert all(o.place.view not in current for o in plan.out_of_view)


def test_a_view_that_names_no_side_may_show_any_lesion_but_two_sides_never_match() -> None:
    assert plan_relocation([place(1, 10)], {"turned a little": 20}).searches[0].target_capture_id == 20
    assert plan_relocation([place(1, 10, "turned a little")], {"front": 20}).searches
    assert plan_relocation([place(1, 10)], {"back": 20}).out_of_view
