"""A workflow as an explicit table: states, events, and what each event does in each state.

Every pair of state and event is either a list of rows (tried in order, each perhaps guarded by a fact) or
refused with a sentence for the person at the screen. Nothing is left undefined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from app.workflows.facts import Fact, VisitFacts
from core.errors import GeodermError


class Refused(GeodermError):
    """The event is not possible now; the message says why and the advice what comes first."""


class State(StrEnum):
    """Where a visit stands. The value is stable and may be logged."""

    STANCE = "stance"
    STANCE_CHECK = "stance-check"
    STANCE_DONE = "stance-done"
    CAPTURE = "capture"
    CAPTURE_DONE = "capture-done"
    MARK = "mark"
    CHECK = "check"
    REVIEW = "review"
    CLOSED = "closed"
    DISCARDED = "discarded"


class Event(StrEnum):
    """What may happen to a visit."""

    STANCE_GOOD = "stance-good"
    STANCE_TO_CORRECT = "stance-to-correct"
    STANCE_ACCEPTED = "stance-accepted"
    CAPTURE_STORED = "capture-stored"
    LESIONS_RELOCATED = "lesions-relocated"
    LESION_EDITED = "lesion-edited"
    GO_STANCE = "go-stance"
    GO_CAPTURE = "go-capture"
    GO_LESIONS = "go-lesions"
    GO_REVIEW = "go-review"
    CLOSE = "close"
    DISCARD = "discard"


@dataclass(frozen=True)
class StateInfo:
    """What the person is told in a state.

    Attributes
    ----------
    step : int
        Index of the step in the step bar.
    title, instruction : str
    primary : str
        Text of the one filled button: the obvious next thing to do. Empty in a terminal state.
    final : bool
        No event leads out.
    """

    step: int
    title: str
    instruction: str
    primary: str = ""
    final: bool = False


@dataclass(frozen=True)
class Row:
    """In `state`, `event` leads to `target` if every fact of `needs` holds.

    ``otherwise`` is the refusal when a needed fact is missing and no later row applies.
    """

    state: State
    event: Event
    target: State
    needs: tuple[Fact, ...] = ()
    otherwise: str = ""


@dataclass(frozen=True)
class Refusal:
    """The event cannot happen in this state."""

    message: str
    advice: str = ""


Cell = tuple[Row, ...] | Refusal


class StateTable:
    """One workflow, complete by construction.

    Parameters
    ----------
    name : str
    steps : sequence of str
        Titles of the step bar.
    start : State
    states : mapping of State to StateInfo
    rows : sequence of Row
    refusals : mapping of (State or None, Event) to Refusal
        ``(None, event)`` is the refusal of an event in every state that has no row of its own.

    Raises
    ------
    ValueError
        If a pair of state and event is undefined, or a row names an unknown state.
    """

    def __init__(
        self,
        name: str,
        *,
        steps: Sequence[str],
        start: State,
        states: Mapping[State, StateInfo],
        rows: Sequence[Row],
        refusals: Mapping[tuple[State | None, Event], Refusal],
    ) -> None:
        self.name = name
        self.steps = tuple(steps)
        self.start = start
        self.states = dict(states)
        self._cells: dict[tuple[State, Event], Cell] = {}
        unknown = {s for row in rows for s in (row.state, row.target)} - set(self.states)
        if unknown:
            raise ValueError(f"{name}: rows name unknown states {sorted(unknown)}")
        for state in self.states:
            for event in Event:
                self._cells[state, event] = self._define(state, event, rows, refusals)

    def _define(
        self,
        state: State,
        event: Event,
        rows: Sequence[Row],
        refusals: Mapping[tuple[State | None, Event], Refusal],
    ) -> Cell:
        own = tuple(row for row in rows if row.state is state and row.event is event)
        if own:
            if own[-1].needs and not own[-1].otherwise:
                raise ValueError(f"{self.name}: {state} x {event} may fall through without a message")
            return own
        refusal = refusals.get((state, event)) or refusals.get((None, event))
        if refusal is None or not refusal.message:
            raise ValueError(f"{self.name}: {state} x {event} is undefined")
        return refusal

    def cell(self, state: State, event: Event) -> Cell:
        """What ``event`` does in ``state``: rows or a refusal."""
        return self._cells[state, event]

    def next(self, state: State, event: Event, facts: VisitFacts) -> State:
        """The state after ``event``.

        Raises
        ------
        Refused
            With a message for the person at the screen.
        """
        cell = self._cells[state, event]
        if isinstance(cell, Refusal):
            raise Refused(cell.message, cell.advice)
        for row in cell:
            if all(facts.has(fact) for fact in row.needs):
                return row.target
        raise Refused(cell[-1].otherwise)

    def allows(self, state: State, event: Event, facts: VisitFacts) -> bool:
        """Whether ``event`` is possible now (for enabling buttons)."""
        try:
            self.next(state, event, facts)
        except Refused:
            return False
        return True

    def resume(self, facts: VisitFacts) -> State:
        """Where a visit that was left, or interrupted by a crash, goes on: the first step not yet done."""
        lesions = State.CHECK if State.CHECK in self.states else State.MARK
        if facts.closed:
            return State.CLOSED
        if not facts.has_stance:
            return State.STANCE
        if not facts.has_capture:
            return State.CAPTURE
        return lesions if facts.lesions and not facts.pending else State.CAPTURE_DONE

    def targets(self, state: State) -> frozenset[State]:
        """Every state that one event may lead to."""
        cells = (self._cells[state, event] for event in Event)
        return frozenset(row.target for cell in cells if isinstance(cell, tuple) for row in cell)
