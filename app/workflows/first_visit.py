"""The first visit: stance, body capture, marking of lesions, review."""

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

CAPTURE_AGAIN = (
    "Take the body capture first; lesions marked on a replaced capture are then found again on the new one."
)

STATES = {
    **STANCE_STATES,
    **CAPTURE_STATES,
    S.CAPTURE_DONE: StateInfo(
        1,
        "Body capture is saved",
        "Check that the skin is sharp and the joints sit where they should. "
        "Capture another side if you need it.",
        "Continue to lesions",
    ),
    S.MARK: StateInfo(
        2,
        "Mark lesions",
        "Click each lesion on the photo. Then give its site and attach its dermoscopic image.",
        "Continue to review",
    ),
    **END_STATES,
}

ROWS = [
    *stance_and_capture_rows(S.MARK),
    Row(S.CAPTURE_DONE, E.LESIONS_RELOCATED, S.MARK),
    Row(S.MARK, E.LESIONS_RELOCATED, S.MARK),
    *(
        Row(state, E.GO_LESIONS, S.MARK, (Fact.HAS_CAPTURE, Fact.NONE_PENDING), otherwise=CAPTURE_AGAIN)
        for state in (S.STANCE_DONE, S.CAPTURE_DONE, S.MARK, S.REVIEW)
    ),
    *(
        Row(state, E.GO_REVIEW, S.REVIEW, (Fact.HAS_CAPTURE, Fact.NONE_PENDING), otherwise=CAPTURE_AGAIN)
        for state in (S.STANCE_DONE, S.CAPTURE_DONE, S.MARK, S.REVIEW)
    ),
    Row(S.REVIEW, E.CLOSE, S.CLOSED, (Fact.HAS_CAPTURE, Fact.ALL_DECIDED), otherwise=DECIDE_FIRST),
]

REFUSALS: dict[tuple[S | None, E], Refusal] = {
    (None, E.GO_LESIONS): Refusal(TAKE_STANCE, "Lesions are marked on the body capture."),
    (None, E.GO_REVIEW): Refusal("There is nothing to review yet.", TAKE_CAPTURE),
    (None, E.LESIONS_RELOCATED): Refusal(
        TAKE_CAPTURE, "Lesions are found on the body capture of this visit."
    ),
}

FIRST_VISIT = StateTable(
    "first visit",
    steps=("Stance", "Body capture", "Mark lesions", "Review and close"),
    start=S.STANCE,
    states=STATES,
    rows=ROWS,
    refusals={**shared_refusals(), **REFUSALS},
)
