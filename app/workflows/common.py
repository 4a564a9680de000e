"""Rows and refusals that the first visit and the follow-up share: stance, working capture, review, end."""

from __future__ import annotations

from app.workflows.facts import Fact
from app.workflows.table import Event as E
from app.workflows.table import Refusal, Row, StateInfo
from app.workflows.table import State as S

OPEN_STANCE = (S.STANCE, S.STANCE_CHECK, S.STANCE_DONE)
FINAL = (S.CLOSED, S.DISCARDED)

TAKE_STANCE = "Take the stance capture first."
TAKE_CAPTURE = "Take a capture of the body first."
DECIDE_FIRST = (
    "Some lesions still wait for you: confirm each place, drag it to the right one, "
    "or say that it is not in view."
)

STANCE_STATES = {
    S.STANCE: StateInfo(
        0,
        "Stance capture",
        "Ask the patient to face the camera with both upper arms out to the side and the forearms raised, "
        "like the letter psi. This capture measures the body once for this visit.",
        "Capture stance",
    ),
    S.STANCE_CHECK: StateInfo(
        0,
        "Please correct the stance",
        "Ask the patient for the corrections below and capture again. If the patient cannot hold the stance, "
        "use the capture as it is.",
        "Capture again",
    ),
    S.STANCE_DONE: StateInfo(
        0,
        "Stance capture is good",
        "The body was measured and saved. Next, capture the skin you want to examine.",
        "Continue to body capture",
    ),
}
CAPTURE_STATES = {
    S.CAPTURE: StateInfo(
        1,
        "Body capture",
        "Any comfortable stance. Choose the side you want to examine and keep the skin in the picture.",
        "Capture body",
    ),
}
END_STATES = {
    S.REVIEW: StateInfo(
        3, "Review and close", "Check the list, add a note and close the visit.", "Close visit"
    ),
    S.CLOSED: StateInfo(
        3,
        "Visit closed",
        "The visit is closed and can no longer be changed. Export the report for the patient's file.",
        "Export report",
        final=True,
    ),
    S.DISCARDED: StateInfo(3, "Visit discarded", "Nothing of this visit was kept.", final=True),
}


def stance_and_capture_rows(lesions: S) -> list[Row]:
    """Rows of the first two steps and of review.

    Parameters
    ----------
    lesions : State
        The third step: marking at a first visit, checking at a follow-up.
    """
    rows = []
    for state in OPEN_STANCE:
        rows += [
            Row(state, E.STANCE_GOOD, S.STANCE_DONE),
            Row(state, E.STANCE_TO_CORRECT, S.STANCE_CHECK),
        ]
    rows.append(Row(S.STANCE_CHECK, E.STANCE_ACCEPTED, S.STANCE_DONE))
    for state in (S.CAPTURE, S.CAPTURE_DONE):
        rows.append(Row(state, E.CAPTURE_STORED, S.CAPTURE_DONE))
    open_states = (*OPEN_STANCE, S.CAPTURE, S.CAPTURE_DONE, lesions, S.REVIEW)
    for state in open_states:
        rows += [
            Row(state, E.GO_STANCE, S.STANCE_DONE, (Fact.HAS_STANCE,)),
            Row(state, E.GO_STANCE, S.STANCE),
            Row(state, E.GO_CAPTURE, S.CAPTURE_DONE, (Fact.HAS_STANCE, Fact.HAS_CAPTURE)),
            Row(state, E.GO_CAPTURE, S.CAPTURE, (Fact.HAS_STANCE,), otherwise=TAKE_STANCE),
            Row(state, E.DISCARD, S.DISCARDED),
        ]
    rows.append(Row(lesions, E.LESION_EDITED, lesions))
    rows.append(Row(S.REVIEW, E.LESION_EDITED, S.REVIEW))
    return rows


def shared_refusals() -> dict[tuple[S | None, E], Refusal]:
    """What is said when an event has no row."""
    refusals: dict[tuple[S | None, E], Refusal] = {
        (None, E.STANCE_GOOD): Refusal("The stance is captured in step 1.", "Go back to step 1."),
        (None, E.STANCE_TO_CORRECT): Refusal("The stance is captured in step 1.", "Go back to step 1."),
        (None, E.STANCE_ACCEPTED): Refusal("There is no stance capture to accept.", "Capture the stance."),
        (None, E.CAPTURE_STORED): Refusal("The body is captured in step 2.", "Go back to step 2."),
        (None, E.LESION_EDITED): Refusal(
            "Lesions are marked after the body capture.", "Finish the body capture first."
        ),
        (None, E.CLOSE): Refusal("A visit is closed from the review.", "Go to the last step first."),
    }
    for event in E:
        refusals[S.CLOSED, event] = Refusal(
            "This visit is closed and can no longer be changed.", "Start a new visit for this patient."
        )
        refusals[S.DISCARDED, event] = Refusal(
            "This visit was discarded.", "Start a new visit for this patient."
        )
    return refusals
