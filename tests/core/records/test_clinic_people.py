from __future__ import annotations

from datetime import UTC, date, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import insert

from core.errors import InputError
from core.records import ClinicStore, PatientDraft, User
from core.records.models import PatientRow
from core.records.text import patient_search_key, search_form


class TestUsers:
    def test_sign_in_needs_the_right_password(self, store: ClinicStore, doctor: User) -> None:
        assert store.users.authenticate("doctor", "correct horse") == doctor
        assert store.users.authenticate(" DOCTOR ", "correct horse") == doctor
        assert store.users.authenticate("doctor", "wrong horse") is None
        assert store.users.authenticate("nobody", "correct horse") is None

    def test_passwords_are_not_in_the_database(self, store: ClinicStore, doctor: User) -> None:
        store.close()
        for path in store.folder.glob("clinic.db*"):
            assert b"correct horse" not in path.read_bytes()

    def test_a_password_can_be_changed(self, store: ClinicStore, doctor: User) -> None:
        store.users.set_password(doctor.id, "battery staple")
        assert store.users.authenticate("doctor", "correct horse") is None
        assert store.users.authenticate("doctor", "battery staple") == doctor

    def test_names_are_unique_and_passwords_not_short(self, store: ClinicStore, doctor: User) -> None:
        with pytest.raises(InputError, match="taken"):
            store.users.create("Doctor", "", "another password")
        with pytest.raises(InputError, match="shorter than 8"):
            store.users.create("nurse", "", "short")
        assert store.users.count() == 1


class TestPatients:
    def test_who_and_when_are_kept(self, store: ClinicStore, doctor: User) -> None:
        before = datetime.now(UTC)
        nurse = store.users.create("nurse", "Nurse", "password")
        draft = PatientDraft(
            "Dvořák", "Antonín", date(1841, 9, 8).replace(year=1941), "M", "7", "line 1\nline 2"
        )
        created = store.patients.create(draft, by=doctor.id)
        updated = store.patients.update(created.id, PatientDraft("Dvořák", "A."), by=nurse.id)
        assert store.patients.get(created.id) == updated
        assert (updated.created_by, updated.updated_by) == (doctor.id, nurse.id)
        assert before <= updated.created_at <= updated.updated_at
        assert updated.created_at.tzinfo is UTC
        assert created.note == "line 1\nline 2"
        assert updated.clinic_number == ""

    @pytest.mark.parametrize(
        ("draft", "message"),
        [
            (PatientDraft(" "), "family name is empty"),
            (PatientDraft("A", sex="X"), "sex"),
            (PatientDraft("A", birth_date=date(2999, 1, 1)), "birth date"),
            (PatientDraft("A", birth_date=date(1700, 1, 1)), "birth date"),
            (PatientDraft("A" * 201), "longer than 200"),
        ],
    )
    def test_impossible_entries_are_refused(
        self, store: ClinicStore, doctor: User, draft: PatientDraft, message: str
    ) -> None:
        with pytest.raises(InputError, match=message):
            store.patients.create(draft, by=doctor.id)
        assert store.patients.count() == 0

    def test_a_clinic_number_belongs_to_one_patient(self, store: ClinicStore, doctor: User) -> None:
        first = store.patients.create(PatientDraft("A", clinic_number="B 12/3"), by=doctor.id)
        with pytest.raises(InputError, match="clinic number"):
            store.patients.create(PatientDraft("B", clinic_number="b123"), by=doctor.id)
        store.patients.update(first.id, PatientDraft("A2", clinic_number="B-123"), by=doctor.id)
        store.patients.create(PatientDraft("C"), by=doctor.id)
        store.patients.create(PatientDraft("D"), by=doctor.id)

    @pytest.mark.parametrize(
        ("typed", "found"),
        [
            ("novak", {"Novák"}),
            ("NOVÁK j", {"Novák"}),
            ("jiri nov", {"Novák"}),
            ("nguyen duc", {"Nguyễn"}),
            ("παπαδοπουλος", {"Παπαδόπουλος"}),
            ("obrien", {"O'Brien"}),
            ("lukasz", {"Wałęsa"}),
            ("strasse", {"Straße"}),
            ("a12", {"Novák"}),
            ("A-12", {"Novák"}),
            ("ovak", set()),
            ("%", {"Novák", "Nguyễn", "Παπαδόπουλος", "O'Brien", "Wałęsa", "Straße"}),
            ("n_v", {"Nguyễn"}),
        ],
    )
    def test_search_ignores_accents_case_and_punctuation(
        self, store: ClinicStore, doctor: User, typed: str, found: set[str]
    ) -> None:
        for family, given_name, number in (
            ("Novák", "Jiří", "A-12"),
            ("Nguyễn", "Văn Đức", "B-77"),
            ("Παπαδόπουλος", "Γιώργος", ""),
            ("O'Brien", "Zoë", ""),
            ("Wałęsa", "Łukasz", ""),
            ("Straße", "Jörg", ""),
        ):
            store.patients.create(PatientDraft(family, given_name, clinic_number=number), by=doctor.id)
        assert {row.patient.family_name for row in store.patients.search(typed)} == found

    def test_the_list_counts_visits_and_lesions(self, store: ClinicStore, doctor: User) -> None:
        a = store.patients.create(PatientDraft("A"), by=doctor.id)
        b = store.patients.create(PatientDraft("B"), by=doctor.id)
        visit = store.visits.create(b.id, doctor.id)
        store.lesions.create(b.id, visit.id, by=doctor.id)
        store.lesions.create(b.id, visit.id, by=doctor.id)
        rows = store.patients.search()
        assert [(r.patient, r.visit_count, r.lesion_count, r.last_visit_at) for r in rows] == [
            (a, 0, 0, None),
            (b, 1, 2, visit.started_at),
        ]
        assert store.patients.summary(b.id) == rows[1]

    def test_ten_thousand_patients_are_searched_through_the_index(
        self, store: ClinicStore, doctor: User
    ) -> None:
        now = datetime.now(UTC)
        rows = [
            {
                "family_name": f"Család{i % 977}",
                "given_name": f"Név{i}",
                "sex": "U",
                "clinic_number": f"N{i}",
                "clinic_number_key": f"n{i}",
                "search_key": patient_search_key(f"Család{i % 977}", f"Név{i}", f"N{i}"),
                "note": "",
                "created_at": now,
                "created_by": doctor.id,
                "updated_at": now,
                "updated_by": doctor.id,
            }
            for i in range(10_000)
        ]
        with store._database.write() as session:
            session.execute(insert(PatientRow), rows)
        assert len(store.patients.search("csalad12 ")) == 121
        assert [row.patient.given_name for row in store.patients.search("n9999")] == ["Név9999"]
        assert len(store.patients.search()) == 200
        names = [row.patient.family_name for row in store.patients.search(limit=10_000)]
        assert [search_form(name) for name in names] == sorted(search_form(name) for name in names)
        with store._database.read() as session:
            plan = session.connection().exec_driver_sql(
                "EXPLAIN QUERY PLAN SELECT * FROM patients WHERE search_key LIKE '% n%' "
                "ORDER BY search_key, id LIMIT 200"
            )
            assert any("ix_patients_search_key" in str(row) for row in plan)


@given(st.text(), st.text())
def test_the_search_form_is_stable_and_finds_every_word(family: str, given_name: str) -> None:
    once = search_form(family)
    assert search_form(once) == once
    key = patient_search_key(family, given_name, "")
    for word in search_form(f"{given_name} {family}").split():
        assert f" {word}" in key
