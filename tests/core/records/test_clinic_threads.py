from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from sqlalchemy.exc import IntegrityError

from core.capture.rgbd import RgbdCapture
from core.records import ClinicStore, PatientDraft, User, Visit
from core.records import database as database_module
from core.records.failures import StorageError
from core.records.models import VisitRow


def test_windows_and_workers_use_one_store_at_once(
    store: ClinicStore, doctor: User, visit: Visit, capture_of: Callable[..., RgbdCapture]
) -> None:
    def work(i: int) -> int:
        record = store.captures.add(visit.id, capture_of(i), "working", doctor.id)
        store.lesions.create(visit.patient_id, visit.id, by=doctor.id)
        store.captures.load(record.id)
        return len(store.patients.search("nov"))

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(work, range(16))) == [1] * 16
    numbers = [lesion.number for lesion in store.lesions.list(visit.patient_id)]
    assert numbers == list(range(1, 17)), "no number is given twice"
    assert len(store.captures.list(visit.id)) == 16
    assert store.verify() == []


def test_a_writer_does_not_hold_up_readers(store: ClinicStore, doctor: User, visit: Visit) -> None:
    inside, done = threading.Event(), threading.Event()

    def slow() -> None:
        with store._database.write() as session:
            session.get_one(VisitRow, visit.id).note = "changed"
            session.flush()
            inside.set()
            done.wait(10)

    writer = threading.Thread(target=slow)
    writer.start()
    assert inside.wait(10)
    assert store.visits.get(visit.id).note == ""
    done.set()
    writer.join()
    assert store.visits.get(visit.id).note == "changed"


def test_another_program_that_keeps_the_database_is_a_clear_message(
    store: ClinicStore, doctor: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "BUSY_TIMEOUT_S", 0.05)
    with (
        ClinicStore.open(store.folder) as impatient,
        closing(sqlite3.connect(store.folder / "clinic.db", isolation_level=None)) as other,
    ):
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StorageError, match="in use by another program"):
            impatient.patients.create(PatientDraft("A"), by=doctor.id)
        other.execute("ROLLBACK")
        impatient.patients.create(PatientDraft("A"), by=doctor.id)


def test_references_are_enforced_and_errors_carry_no_patient_data(
    store: ClinicStore, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG")
    with pytest.raises(IntegrityError) as caught:
        store.patients.create(PatientDraft("Tajemství", note="Geheimnis"), by=12345)
    text = f"{caught.value!r} {caught.value} {caplog.text}"
    assert "Tajemství" not in text
    assert "Geheimnis" not in text
