"""A follow-up without a window: places proposed, decided by a person, and kept with who and when."""

from __future__ import annotations

import numpy as np
import pytest

from app.workflows.table import Event, Refused, State
from core.errors import Cancelled
from tests.app.workflows.conftest import (
    Clinic,
    Take,
    capture_body,
    capture_stance,
    close_first_visit,
    seen_lesions,
)


def test_a_follow_up_from_capture_to_close(clinic: Clinic, take: Take) -> None:
    marked = close_first_visit(clinic.session(), take, lesions=4)
    session = clinic.session()
    assert session.is_follow_up
    capture_stance(session, take("psi", 2))
    body = take("A", 2)
    capture_body(session, body)
    assert session.state is State.CAPTURE_DONE
    assert session.pending_count == 4
    with pytest.raises(Refused, match="Find the known lesions"):
        session.fire(Event.GO_LESIONS)

    session.adopt_search(session.find_lesions())
    assert session.state is State.CHECK
    assert session.pending_count == 0
    observations = {name: session.snapshot.in_force(i) for name, i in marked.items()}
    errors = []
    for name, observation in observations.items():
        assert observation is not None
        assert observation.decision == "proposed"
        assert session.status(observation.lesion_id).needs_doctor
        if observation.point_m is not None:
            truth = body.truth.mole_points_m[list(body.truth.mole_ids).index(name)]
            errors.append(float(np.linalg.norm(np.array(observation.point_m) - truth)))
            assert "±" in session.status(observation.lesion_id).label
    assert len(errors) >= 3
    assert np.median(errors) < 0.08

    session.fire(Event.GO_REVIEW)
    with pytest.raises(Refused, match="confirm each place"):
        session.close()
    session.fire(Event.GO_LESIONS)

    names = list(marked)
    here = session.snapshot.views["front"]
    session.confirm(marked[names[0]])
    where = seen_lesions(body, 20)[names[1]]
    session.move(marked[names[1]], here, where)
    session.not_in_view(marked[names[2]])
    session.not_in_view(marked[names[3]])
    session.reopen(marked[names[3]])
    session.confirm(marked[names[3]])

    corrected = session.snapshot.in_force(marked[names[1]])
    assert corrected is not None
    assert corrected.decision == "corrected"
    assert corrected.pixel == where
    assert corrected.decided_by == clinic.user.id
    assert corrected.decided_at is not None
    assert session.status(marked[names[1]]).label == "Corrected"
    assert "Dr Anna Weber" in session.status(marked[names[1]]).detail
    assert session.status(marked[names[2]]).label == "Not in view"

    new, _ = session.mark(here, seen_lesions(body, 9)[list(seen_lesions(body, 9))[-1]])
    assert new.number == 5
    with pytest.raises(Refused, match="earlier visit"):
        session.remove(marked[names[0]])
    session.fire(Event.GO_REVIEW)
    session.close()
    assert session.state is State.CLOSED


def test_the_next_visit_starts_from_the_corrected_place(clinic: Clinic, take: Take) -> None:
    marked = close_first_visit(clinic.session(), take, lesions=1)
    session = clinic.session()
    capture_stance(session, take("psi", 2))
    capture_body(session, take("A", 2))
    session.adopt_search(session.find_lesions())
    ((name, lesion_id),) = marked.items()
    where = seen_lesions(take("A", 2), 20)[name]
    session.move(lesion_id, session.snapshot.views["front"], where)
    session.fire(Event.GO_REVIEW)
    session.close()

    third = clinic.session()
    capture_stance(third, take("psi", 2))
    capture_body(third, take("A", 2))
    (search,) = third.snapshot.pending().searches
    assert search.places[0].pixel == where
    assert search.reference_capture_id == session.snapshot.views["front"]


def test_a_side_that_was_not_captured_is_said_and_looked_for_once_it_is(clinic: Clinic, take: Take) -> None:
    marked = close_first_visit(clinic.session(), take, lesions=2)
    session = clinic.session()
    capture_stance(session, take("psi", 2))
    capture_body(session, take("A", 2, "back"))
    session.adopt_search(session.find_lesions())
    for lesion_id in marked.values():
        observation = session.snapshot.in_force(lesion_id)
        assert observation is not None
        assert observation.pixel is None
        assert "front view" in observation.reason
        assert session.status(lesion_id).label == "Not in view: please check"
    assert session.unseen_count() == 2

    capture_body(session, take("A", 2))
    assert session.pending_count == 2
    assert set(session.snapshot.views) == {"back", "front"}


def test_a_retake_is_searched_again_and_the_old_places_are_set_aside(clinic: Clinic, take: Take) -> None:
    marked = close_first_visit(clinic.session(), take, lesions=2)
    session = clinic.session()
    capture_stance(session, take("psi", 2))
    capture_body(session, take("A", 2))
    session.adopt_search(session.find_lesions())
    lesion_id = next(iter(marked.values()))
    session.confirm(lesion_id)
    replaced = session.snapshot.views["front"]

    capture_body(session, take("A", 2))
    assert session.snapshot.views["front"] != replaced
    assert session.state is State.CAPTURE_DONE
    assert session.pending_count == 2
    references = {s.reference_capture_id for s in session.snapshot.pending().searches}
    assert replaced in references
    session.adopt_search(session.find_lesions())
    old = [o for o in clinic.store.observations.for_lesion(lesion_id) if o.capture_id == replaced]
    assert old[0].decision == "rejected"
    in_force = session.snapshot.in_force(lesion_id)
    assert in_force is not None
    assert in_force.capture_id == session.snapshot.views["front"]


def test_cancelling_the_search_stores_no_place(clinic: Clinic, take: Take) -> None:
    close_first_visit(clinic.session(), take, lesions=2)
    session = clinic.session()
    capture_stance(session, take("psi", 2))
    capture_body(session, take("A", 2))

    def stop(done: float, message: str = "") -> None:
        if done > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        session.find_lesions(stop)
    session.reload()
    assert session.state is State.CAPTURE_DONE
    assert session.snapshot.facts().lesions == 0
    assert session.pending_count == 2
