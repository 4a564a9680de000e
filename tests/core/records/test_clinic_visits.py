from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from core.capture.rgbd import RgbdCapture
from core.errors import InputError
from core.records import (
    AnatomicSite,
    AnchorRecord,
    CandidatePlace,
    ClinicStore,
    ObservationDraft,
    Patient,
    PatientDraft,
    User,
    Visit,
)


def draft(lesion: int, visit: Visit, capture: int, status: str = "found") -> ObservationDraft:
    return ObservationDraft(
        lesion_id=lesion,
        visit_id=visit.id,
        capture_id=capture,
        status=status,
        pixel=(10.25, 20.5),
        point_m=np.array([0.1, -0.2, 2.3]),
        radius95_m=0.0042,
        confidence=0.93,
        method="trilateration",
        appearance_matched=True,
        candidates=(CandidatePlace((1.0, 2.0), (0.0, 0.0, 2.0), 0.2), CandidatePlace(None, None, 0.1)),
    )


class TestVisits:
    def test_numbers_run_per_patient(self, store: ClinicStore, doctor: User, patient: Patient) -> None:
        other = store.patients.create(PatientDraft("B"), by=doctor.id)
        numbers = [store.visits.create(p, doctor.id).number for p in (patient.id, other.id, patient.id)]
        assert numbers == [1, 1, 2]
        first, second = store.visits.list(patient.id)
        assert store.visits.previous(second.id) == first
        assert store.visits.previous(first.id) is None

    def test_closing_is_recorded_and_final(self, store: ClinicStore, doctor: User, visit: Visit) -> None:
        assert store.visits.open_visit(visit.patient_id) == visit
        closed = store.visits.close(visit.id, doctor.id, "All seen.")
        assert (closed.closed_by, closed.note, closed.is_open) == (doctor.id, "All seen.", False)
        assert store.visits.open_visit(visit.patient_id) is None
        with pytest.raises(InputError, match="already closed"):
            store.visits.close(visit.id, doctor.id)
        with pytest.raises(InputError, match="closed visit"):
            store.visits.discard(visit.id, doctor.id)
        assert store.visits.set_note(visit.id, "Later.").note == "Later."

    def test_discarding_leaves_no_trace_of_the_visit(
        self, store: ClinicStore, doctor: User, visit: Visit, capture: RgbdCapture
    ) -> None:
        stored = store.captures.add(visit.id, capture, "working", doctor.id)
        store.anchors.put(stored.id, [AnchorRecord("head", 0, 0, 2, None, None, 1, 0.01, "color")])
        lesion = store.lesions.create(visit.patient_id, visit.id, by=doctor.id)
        store.observations.put(draft(lesion.id, visit, stored.id), doctor.id)
        store.visits.discard(visit.id, doctor.id)
        assert store.visits.list(visit.patient_id) == []
        assert store.lesions.list(visit.patient_id) == []
        assert store.anchors.list(stored.id) == []
        assert store.verify() == []
        assert store.remove_orphans() == 0, "young blobs may belong to a capture being stored"
        assert store.remove_orphans(min_age_s=-1.0) == 3
        again = store.visits.create(visit.patient_id, doctor.id)
        assert again.number == 1
        assert again.id != visit.id, "an id that a window may still hold is not given to another visit"

    def test_a_lesion_seen_elsewhere_keeps_its_visit(
        self, store: ClinicStore, doctor: User, visit: Visit, capture: RgbdCapture
    ) -> None:
        lesion = store.lesions.create(visit.patient_id, visit.id, by=doctor.id)
        second = store.visits.create(visit.patient_id, doctor.id)
        stored = store.captures.add(second.id, capture, "working")
        store.observations.put(draft(lesion.id, second, stored.id), doctor.id)
        with pytest.raises(InputError, match="another visit"):
            store.visits.discard(visit.id, doctor.id)
        with pytest.raises(InputError, match="closed visit"):
            store.lesions.discard(lesion.id, doctor.id)


class TestCaptures:
    @pytest.mark.parametrize("color", [True, False])
    @pytest.mark.parametrize("seed", range(4))
    def test_a_capture_comes_back_bit_for_bit(
        self,
        store: ClinicStore,
        visit: Visit,
        capture_of: Callable[..., RgbdCapture],
        color: bool,
        seed: int,
    ) -> None:
        given = replace(capture_of(seed, frames=3, color=color), mirrored=bool(seed % 2))
        record = store.captures.add(visit.id, given, "psi")
        back = store.captures.load(record.id)
        assert back.depth_frames.dtype == np.uint16
        assert np.array_equal(back.depth_frames, given.depth_frames)
        assert back.depth_unit_m == given.depth_unit_m
        assert (back.view, back.stance, back.taken_at, back.mirrored) == (
            given.view,
            given.stance,
            given.taken_at,
            given.mirrored,
        )
        assert (back.rig.depth, back.rig.color) == (given.rig.depth, given.rig.color)
        assert back.joints_m is not None
        assert given.joints_m is not None
        assert all(np.array_equal(back.joints_m[name], xyz) for name, xyz in given.joints_m.items())
        if color:
            assert np.array_equal(back.color, given.color)
            assert np.array_equal(store.captures.color_picture(record.id), given.color)
            assert back.rig.color_from_depth is not None
            assert given.rig.color_from_depth is not None
            assert np.array_equal(back.rig.color_from_depth.matrix, given.rig.color_from_depth.matrix)
        else:
            assert back.color is None
            assert store.captures.color_picture(record.id) is None
        assert np.array_equal(store.captures.depth_picture(record.id), given.depth_frames[0])
        assert len(store.captures.load(record.id, frames=1).depth_frames) == 1
        assert store.captures.list(visit.id) == [record] == [store.captures.get(record.id)]
        assert (record.frame_count, record.has_color) == (3, color)
        assert record.picture_size == ((40, 30) if color else (32, 24))

    def test_closed_visits_take_no_captures(
        self, store: ClinicStore, doctor: User, visit: Visit, capture: RgbdCapture
    ) -> None:
        with pytest.raises(InputError, match="psi or working"):
            store.captures.add(visit.id, capture, "other")
        kept = store.captures.add(visit.id, capture, "psi")
        retaken = store.captures.add(visit.id, capture, "psi")
        store.captures.remove(retaken.id, doctor.id)
        assert store.captures.list(visit.id) == [kept]
        store.visits.close(visit.id, doctor.id)
        with pytest.raises(InputError, match="closed"):
            store.captures.add(visit.id, capture, "working")
        with pytest.raises(InputError, match="closed"):
            store.captures.remove(kept.id, doctor.id)

    def test_anchors_are_replaced_as_a_set(
        self, store: ClinicStore, visit: Visit, capture: RgbdCapture
    ) -> None:
        record = store.captures.add(visit.id, capture, "psi")
        head = AnchorRecord("head", 0.1, 0.2, 2.0, 3.5, 4.5, 0.9, 0.012, "color")
        hand = AnchorRecord("left_hand", 0.3, 0.2, 2.0, None, None, 0.4, 0.03, "relief")
        store.anchors.put(record.id, [hand, head])
        assert store.anchors.list(record.id) == [head, hand]
        store.anchors.put(record.id, [replace(head, z=2.5)])
        assert store.anchors.list(record.id) == [replace(head, z=2.5)]


class TestLesions:
    def test_numbers_sites_and_states(self, store: ClinicStore, doctor: User, visit: Visit) -> None:
        site = AnatomicSite("45981001", "SCT", "Skin of anterior surface of upper arm", "left")
        first = store.lesions.create(visit.patient_id, visit.id, site, "brown", by=doctor.id)
        second = store.lesions.create(visit.patient_id, visit.id, by=doctor.id)
        assert [lesion.number for lesion in store.lesions.list(visit.patient_id)] == [1, 2]
        assert first.site == site
        assert site.name == "Anterior surface of upper arm, left"
        changed = store.lesions.update(first.id, state="removed", by=doctor.id)
        assert (changed.state, changed.site, changed.note) == ("removed", site, "brown")
        assert store.lesions.update(first.id, site=None, by=doctor.id).site is None
        store.lesions.discard(second.id, doctor.id)
        with pytest.raises(InputError, match="not in the clinic's records"):
            store.lesions.get(second.id)
        with pytest.raises(InputError, match="active or removed"):
            store.lesions.update(first.id, state="gone", by=doctor.id)

    def test_a_lesion_cannot_start_in_another_patient_s_visit(
        self, store: ClinicStore, doctor: User, visit: Visit
    ) -> None:
        other = store.patients.create(PatientDraft("B"), by=doctor.id)
        with pytest.raises(InputError):
            store.lesions.create(other.id, visit.id, by=doctor.id)

    def test_records_cannot_be_written_to(self, store: ClinicStore, doctor: User, visit: Visit) -> None:
        lesion = store.lesions.create(visit.patient_id, visit.id, by=doctor.id)
        with pytest.raises(FrozenInstanceError):
            lesion.number = 5  # type: ignore[misc]


class TestObservations:
    @pytest.fixture
    def ids(self, store: ClinicStore, doctor: User, visit: Visit, capture: RgbdCapture) -> tuple[int, int]:
        stored = store.captures.add(visit.id, capture, "working")
        return store.lesions.create(visit.patient_id, visit.id, by=doctor.id).id, stored.id

    def test_a_proposal_waits_for_a_decision(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        given = draft(ids[0], visit, ids[1])
        got = store.observations.put(given, doctor.id)
        assert (got.pixel, got.point_m) == ((10.25, 20.5), (0.1, -0.2, 2.3))
        assert (got.proposed_pixel, got.proposed_point_m) == (got.pixel, got.point_m)
        assert (got.radius95_m, got.confidence, got.method) == (0.0042, 0.93, "trilateration")
        assert (got.decision, got.decided_by, got.decided_at) == ("proposed", None, None)
        assert got.candidates == given.candidates
        assert store.observations.for_visit(visit.id) == [got] == store.observations.for_lesion(ids[0])

    def test_correcting_keeps_the_proposal_and_the_history(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        nurse = store.users.create("nurse", "Nurse", "password")
        first = store.observations.put(draft(*ids[:1], visit, ids[1]), doctor.id)
        store.observations.correct(first.id, (11, 22), (0.11, -0.2, 2.3), nurse.id)
        last = store.observations.correct(first.id, (12, 23), None, doctor.id)
        assert (last.decision, last.decided_by) == ("corrected", doctor.id)
        assert last.decided_at is not None
        assert (last.pixel, last.point_m) == ((12, 23), None)
        assert last.proposed_pixel == first.pixel
        assert [(e.action, e.by, e.pixel) for e in store.observations.history(first.id)] == [
            ("proposed", doctor.id, (10.25, 20.5)),
            ("corrected", nurse.id, (11, 22)),
            ("corrected", doctor.id, (12, 23)),
        ]
        back = store.observations.reopen(first.id, doctor.id)
        assert (back.decision, back.decided_by, back.pixel) == ("proposed", None, first.pixel)
        assert store.observations.confirm(first.id, nurse.id).decision == "confirmed"
        assert store.observations.reject(first.id, nurse.id, "a hair").decision == "rejected"
        assert store.observations.history(first.id)[-1].detail == "a hair"

    def test_a_new_computation_does_not_overrule_the_doctor(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        first = store.observations.put(draft(ids[0], visit, ids[1]), doctor.id)
        store.observations.correct(first.id, (11, 22), (0, 0, 2), doctor.id)
        renewed = replace(draft(ids[0], visit, ids[1], "ambiguous"), pixel=(30, 10), confidence=0.4)
        again = store.observations.put(renewed, doctor.id)
        assert again.id == first.id
        assert (again.decision, again.pixel) == ("corrected", (11, 22))
        assert (again.proposed_pixel, again.confidence) == ((30, 10), 0.4)

    def test_a_mark_is_the_doctor_s_own(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        marked = store.observations.put(
            ObservationDraft(ids[0], visit.id, ids[1], "marked", (5, 6), (0, 0, 2)), doctor.id
        )
        assert (marked.decision, marked.decided_by) == ("marked", doctor.id)
        assert marked.proposed_pixel is None
        with pytest.raises(InputError, match="no proposal"):
            store.observations.reopen(marked.id, doctor.id)
        noted = store.observations.annotate(marked.id, doctor.id, note="itches", size_mm=4.5)
        assert (noted.note, noted.size_mm, noted.decision) == ("itches", 4.5, "marked")

    def test_absence_can_be_confirmed(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        absent = store.observations.put(
            ObservationDraft(ids[0], visit.id, ids[1], "not_visible", reason="behind the arm"), doctor.id
        )
        assert store.observations.confirm(absent.id, doctor.id).pixel is None

    def test_nonsense_is_refused_and_several_drafts_are_one_step(
        self, store: ClinicStore, doctor: User, visit: Visit, ids: tuple[int, int]
    ) -> None:
        good = draft(ids[0], visit, ids[1])
        for bad in (
            replace(good, status="somewhere"),
            replace(good, pixel=(1.0, float("nan"))),
            replace(good, point_m=(1.0, 2.0)),
            replace(good, confidence=1.5),
            replace(good, radius95_m=-1.0),
            replace(good, size_mm=float("inf")),
            replace(good, capture_id=ids[1] + 99),
        ):
            with pytest.raises(InputError):
                store.observations.put_many([good, bad], doctor.id)
        assert store.observations.for_visit(visit.id) == []
