"""A first visit without a window: every step saved as it happens, every refusal in words, nothing half."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.workflows.table import Event, Refused, State
from core.errors import Cancelled, InputError, WorkError
from core.records.sites import find_site
from tests.app.workflows.conftest import Clinic, Take, capture_body, capture_stance, seen_lesions


def cancel_at(fraction: float):
    def progress(done: float, message: str = "") -> None:
        if done >= fraction:
            raise Cancelled

    return progress


def test_a_good_stance_is_stored_with_its_anchors_and_survives_a_crash(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    assert session.state is State.STANCE
    assert not session.is_follow_up
    capture_stance(session, take("psi", 1))
    assert session.state is State.STANCE_DONE
    stance = session.snapshot.stance
    assert stance is not None
    assert len(clinic.store.anchors.list(stance.id)) >= 12

    reopened = clinic.session()
    assert reopened.visit_id == session.visit_id
    assert reopened.state is State.CAPTURE


def test_a_wrong_stance_is_shown_with_corrections_and_not_stored_until_accepted(
    clinic: Clinic, take: Take
) -> None:
    session = clinic.session()
    capture_stance(session, take("down", 1))
    assert session.state is State.STANCE_CHECK
    assert session.stance_candidate is not None
    assert any("left" in text for text in session.stance_candidate.corrections)
    assert session.snapshot.stance is None
    with pytest.raises(Refused, match="stance capture first"):
        session.fire(Event.GO_CAPTURE)

    session.store_capture(session.stance_candidate)
    session.adopt_accepted_stance()
    assert session.state is State.STANCE_DONE
    assert session.snapshot.stance is not None


def test_cancelling_a_capture_leaves_the_visit_as_it_was(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    for fraction in (0.0, 0.4, 0.85):
        with pytest.raises(Cancelled):
            session.take_stance(take("psi", 1).capture, cancel_at(fraction))
        session.reload()
        assert session.state is State.STANCE
        assert session.is_empty


def test_an_empty_room_is_no_body_and_nothing_is_stored(clinic: Clinic, take: Take) -> None:
    from dataclasses import replace

    capture = take("psi", 1).capture
    empty = replace(capture, depth_frames=np.full_like(capture.depth_frames, 4000))
    session = clinic.session()
    with pytest.raises(WorkError, match=r"(?i)body") as refusal:
        session.take_stance(empty)
    assert refusal.value.advice
    session.reload()
    assert session.is_empty


def test_lesions_are_marked_moved_described_and_removed(clinic: Clinic, take: Take, tmp_path: Path) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    body = take("A", 1)
    capture_body(session, body)
    session.fire(Event.GO_LESIONS)
    capture_id = session.snapshot.views["front"]
    (first, second) = seen_lesions(body, 2).values()

    lesion, _ = session.mark(capture_id, first)
    other, _ = session.mark(capture_id, second)
    assert (lesion.number, other.number) == (1, 2)
    observation = session.snapshot.in_force(lesion.id)
    assert observation is not None
    name = next(iter(seen_lesions(body, 1)))
    truth = body.truth.mole_points_m[list(body.truth.mole_ids).index(name)]
    assert np.linalg.norm(np.array(observation.point_m) - truth) < 0.015
    assert session.status(lesion.id).label == "Marked"
    assert "Dr Anna Weber" in session.status(lesion.id).detail

    session.move(lesion.id, capture_id, (first[0] + 3, first[1]))
    moved = session.snapshot.in_force(lesion.id)
    assert moved is not None
    assert moved.decision == "marked"
    assert moved.pixel == (first[0] + 3, first[1])

    session.set_site(lesion.id, find_site("45981001"))
    session.set_note(lesion.id, "irregular border")
    session.set_size(lesion.id, 4.5)
    picture = tmp_path / "dermo.png"
    cv2.imwrite(str(picture), np.full((60, 80, 3), 120, np.uint8))
    session.attach_dermoscopy(lesion.id, picture)
    stored = clinic.store.lesions.get(lesion.id)
    assert stored.site is not None
    assert stored.note == "irregular border"
    assert len(session.snapshot.dermoscopy[lesion.id]) == 1

    session.remove(other.id)
    assert [x.id for x in session.snapshot.shown_lesions()] == [lesion.id]
    session.fire(Event.GO_REVIEW)
    session.close()
    assert session.state is State.CLOSED
    with pytest.raises(Refused, match="closed"):
        session.mark(capture_id, second)


def test_a_click_beside_the_body_or_on_hair_is_refused_in_words_and_stores_nothing(
    clinic: Clinic, take: Take
) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    body = take("A", 1)
    capture_body(session, body)
    session.fire(Event.GO_LESIONS)
    capture_id = session.snapshot.views["front"]
    with pytest.raises(Refused, match="not on the body") as refusal:
        session.mark(capture_id, (120.0, 200.0))
    assert "Click on the patient's skin" in refusal.value.advice
    with pytest.raises(Refused, match="outside"):
        session.mark(capture_id, (-40.0, 4.0))
    head = session.analysed(capture_id).skeleton.joints["head"].pixel
    refusals = []
    for up in range(0, 60, 3):
        try:
            lesion, _ = session.mark(capture_id, (float(head[0]), float(head[1] - up)))
        except Refused as error:
            refusals.append(error.message)
        else:
            session.remove(lesion.id)
    assert any("hair" in text for text in refusals)
    assert session.snapshot.facts().lesions == 0
    assert clinic.store.lesions.list(clinic.patient.id) == []


def test_a_file_that_is_no_image_is_not_attached(clinic: Clinic, take: Take, tmp_path: Path) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    capture_body(session, take("A", 1))
    session.fire(Event.GO_LESIONS)
    pixel = next(iter(seen_lesions(take("A", 1), 1).values()))
    lesion, _ = session.mark(session.snapshot.views["front"], pixel)
    wrong = tmp_path / "holiday.jpg"
    wrong.write_bytes(b"not an image at all")
    with pytest.raises(InputError, match=r"holiday\.jpg"):
        session.attach_dermoscopy(lesion.id, wrong)
    with pytest.raises(InputError, match=r"gone\.jpg"):
        session.attach_dermoscopy(lesion.id, tmp_path / "gone.jpg")
    assert lesion.id not in session.snapshot.dermoscopy


def test_an_abandoned_visit_is_discarded_whole(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    session.discard()
    assert session.state is State.DISCARDED
    assert clinic.store.visits.list(clinic.patient.id) == []


def test_reopening_goes_on_marking_and_clicks_need_the_surface_prepared(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    capture_body(session, take("A", 1))
    session.fire(Event.GO_LESIONS)
    capture_id = session.snapshot.views["front"]
    first, second = seen_lesions(take("A", 1), 2).values()
    session.mark(capture_id, first)

    reopened = clinic.session()
    assert reopened.state is State.MARK
    with pytest.raises(Refused, match="prepared"):
        reopened.mark(capture_id, second)
    reopened.prepare(capture_id)
    reopened.mark(capture_id, second)
    assert reopened.snapshot.facts().lesions == 2
