"""The follow-up: stance, body capture, checking of the relocated lesions, review."""

from __future__ import annotations

from app.workflows.common import (
    CAPTURE_STATES,
    DECIDE_FIRST,
    END_STATES,
    STANCE_STATES,
    TAKE_CAPTURE,
    TAKE_STANCE,
    shared_refusals,
    stance_and_capture_rows,
)
from app.workflows.facts import Fact
from app.workflows.table import Event as E
from app.workflows.table import Refusal, Row, StateInfo, StateTable
from app.workflows.table import State as S

FIND_FIRST = "Find the known lesions on the new capture first."

STATES = {
    **STANCE_STATES,
    **CAPTURE_STATES,
    S.CAPTURE_DONE: StateInfo(
        1,
        "Body capture is saved",
        "Check the picture. Capture another side if lesions are on it, then let the lesions be found again.",
        "Find the lesions",
    ),
    S.CHECK: StateInfo(
        2,
        "Check the lesions",
        "Confirm each proposed place, drag it to the right one, or say that it is not in view.",
        "Continue to review",
    ),
    **END_STATES,
}

ROWS = [
    *stance_and_capture_rows(S.CHECK),
    Row(S.CAPTURE_DONE, E.LESIONS_RELOCATED, S.CHECK, (Fact.HAS_CAPTURE,), otherwise=TAKE_CAPTURE),
    Row(S.CHECK, E.LESIONS_RELOCATED, S.CHECK),
    *(
        Row(state, E.GO_LESIONS, S.CHECK, (Fact.HAS_CAPTURE, Fact.NONE_PENDING), otherwise=FIND_FIRST)
        for state in (S.STANCE_DONE, S.CAPTURE_DONE, S.CHECK, S.REVIEW)
    ),
    *(
        Row(state, E.GO_REVIEW, S.REVIEW, (Fact.HAS_CAPTURE, Fact.NONE_PENDING), otherwise=FIND_FIRST)
        for state in (S.STANCE_DONE, S.CAPTURE_DONE, S.CHECK, S.REVIEW)
    ),
    Row(
        S.REVIEW,
        E.CLOSE,
        S.CLOSED,
        (Fact.HAS_CAPTURE, Fact.NONE_PENDING, Fact.ALL_DECIDED),
        otherwise=DECIDE_FIRST,
    ),
]

REFUSALS: dict[tuple[S | None, E], Refusal] = {
    (None, E.GO_LESIONS): Refusal(TAKE_STANCE, "Lesions are found on the body capture."),
    (None, E.GO_REVIEW): Refusal("There is nothing to review yet.", TAKE_CAPTURE),
    (None, E.LESIONS_RELOCATED): Refusal(
        TAKE_CAPTURE, "Lesions are found on the body capture of this visit."
    ),
}

FOLLOW_UP = StateTable(
    "follow-up",
    steps=("Stance", "Body capture", "Check lesions", "Review and close"),
    start=S.STANCE,
    states=STATES,
    rows=ROWS,
    refusals={**shared_refusals(), **REFUSALS},
)
