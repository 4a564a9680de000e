"""The visit workflows are complete tables: nothing undefined, nothing dead, nothing silent."""

from __future__ import annotations

from itertools import product

import pytest

from app.workflows.facts import VisitFacts
from app.workflows.first_visit import FIRST_VISIT
from app.workflows.follow_up import FOLLOW_UP
from app.workflows.table import Event, Refusal, Refused, Row, State, StateInfo, StateTable

TABLES = [FIRST_VISIT, FOLLOW_UP]
ALL_FACTS = [
    VisitFacts(has_stance=s, has_capture=c, pending=p, lesions=n, undecided=u)
    for s, c, p, n, u in product((False, True), (False, True), (0, 2), (0, 3), (0, 1))
]
CELLS = [(t, s, e) for t in TABLES for s in t.states for e in Event]


def _id(value: object) -> str:
    return value.name.replace(" ", "_") if isinstance(value, StateTable) else str(value)


@pytest.mark.parametrize(("table", "state", "event"), CELLS, ids=_id)
def test_every_event_in_every_state_leads_somewhere_or_is_refused_in_words(
    table: StateTable, state: State, event: Event
) -> None:
    for facts in ALL_FACTS:
        if table.allows(state, event, facts):
            assert table.next(state, event, facts) in table.states
        else:
            with pytest.raises(Refused, match=r"^[A-Z].{8,}\.$") as refusal:
                table.next(state, event, facts)
            assert refusal.value.exit_code == 3


@pytest.mark.parametrize("table", TABLES, ids=_id)
def test_every_state_is_reached_from_the_start(table: StateTable) -> None:
    seen, todo = {table.start}, [table.start]
    while todo:
        for target in table.targets(todo.pop()) - seen:
            seen.add(target)
            todo.append(target)
    assert seen == set(table.states)


@pytest.mark.parametrize("table", TABLES, ids=_id)
def test_no_state_is_a_dead_end_but_the_two_ends(table: StateTable) -> None:
    finals = {s for s, info in table.states.items() if info.final}
    assert finals == {State.CLOSED, State.DISCARDED}
    for state in set(table.states) - finals:
        seen, todo = {state}, [state]
        while todo:
            for target in table.targets(todo.pop()) - seen:
                seen.add(target)
                todo.append(target)
        assert State.CLOSED in seen, f"{state} cannot reach the closed visit"
    for state in finals:
        assert not table.targets(state)


@pytest.mark.parametrize("table", TABLES, ids=_id)
def test_every_open_state_names_its_step_its_instruction_and_one_next_thing_to_do(table: StateTable) -> None:
    for state, info in table.states.items():
        assert 0 <= info.step < len(table.steps)
        assert info.title
        assert info.instruction.endswith(".")
        assert info.primary or state is State.DISCARDED


def test_the_happy_path_of_a_first_visit() -> None:
    facts = VisitFacts()
    state = FIRST_VISIT.start
    state = FIRST_VISIT.next(state, Event.STANCE_GOOD, facts)
    facts = VisitFacts(has_stance=True)
    for event, expected in [
        (Event.GO_CAPTURE, State.CAPTURE),
        (Event.CAPTURE_STORED, State.CAPTURE_DONE),
    ]:
        state = FIRST_VISIT.next(state, event, facts)
        assert state is expected
    facts = VisitFacts(has_stance=True, has_capture=True, lesions=2)
    for event, expected in [
        (Event.GO_LESIONS, State.MARK),
        (Event.LESION_EDITED, State.MARK),
        (Event.GO_REVIEW, State.REVIEW),
        (Event.CLOSE, State.CLOSED),
    ]:
        state = FIRST_VISIT.next(state, event, facts)
        assert state is expected


def test_a_follow_up_is_not_closed_while_a_place_waits_for_the_doctor() -> None:
    waiting = VisitFacts(has_stance=True, has_capture=True, lesions=3, undecided=1)
    with pytest.raises(Refused, match="confirm each place"):
        FOLLOW_UP.next(State.REVIEW, Event.CLOSE, waiting)
    decided = VisitFacts(has_stance=True, has_capture=True, lesions=3)
    assert FOLLOW_UP.next(State.REVIEW, Event.CLOSE, decided) is State.CLOSED


def test_a_follow_up_is_not_reviewed_before_the_lesions_were_looked_for() -> None:
    pending = VisitFacts(has_stance=True, has_capture=True, pending=3)
    with pytest.raises(Refused, match="Find the known lesions"):
        FOLLOW_UP.next(State.CAPTURE_DONE, Event.GO_REVIEW, pending)


@pytest.mark.parametrize(
    ("facts", "expected"),
    [
        (VisitFacts(), State.STANCE),
        (VisitFacts(has_stance=True), State.CAPTURE),
        (VisitFacts(has_stance=True, has_capture=True, pending=2), State.CAPTURE_DONE),
        (VisitFacts(has_stance=True, has_capture=True, lesions=1, pending=1), State.CAPTURE_DONE),
        (VisitFacts(has_stance=True, has_capture=True, lesions=2, undecided=2), State.CHECK),
        (VisitFacts(has_stance=True, has_capture=True, lesions=2, closed=True), State.CLOSED),
    ],
)
def test_an_interrupted_follow_up_goes_on_at_the_first_step_not_done(
    facts: VisitFacts, expected: State
) -> None:
    assert FOLLOW_UP.resume(facts) is expected


def test_an_interrupted_first_visit_goes_on_marking() -> None:
    assert FIRST_VISIT.resume(VisitFacts(has_stance=True, has_capture=True, lesions=1)) is State.MARK


def test_a_table_with_a_hole_is_not_built() -> None:
    states = {State.STANCE: StateInfo(0, "a", "b."), State.CLOSED: StateInfo(0, "a", "b.", final=True)}
    rows = [Row(State.STANCE, Event.CLOSE, State.CLOSED)]
    with pytest.raises(ValueError, match="undefined"):
        StateTable("hole", steps=("a",), start=State.STANCE, states=states, rows=rows, refusals={})
    refusals = {(None, event): Refusal("No.") for event in Event}
    table = StateTable("whole", steps=("a",), start=State.STANCE, states=states, rows=rows, refusals=refusals)
    assert table.next(State.STANCE, Event.CLOSE, VisitFacts()) is State.CLOSED
