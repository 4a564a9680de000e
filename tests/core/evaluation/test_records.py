"""The journal of a ladder: a killed run goes on, another program starts anew."""

from __future__ import annotations

import pytest

from core.errors import InputError
from core.evaluation import CaseName, Journal, LesionScore, Record, Rung, SpotScore, code_fingerprint

NAME = CaseName("c1", "body", "A", "psi")
OTHER_NAME = CaseName("c2", "body", "A", "A")
RUNG = Rung("trilateration", "true", 1, True)


def record(name=NAME, rung=RUNG, code="v1"):
    lesion = LesionScore("L1", "trunk", "trunk", True, False, "found", error_m=0.0123, in_region=True)
    return Record(rung, name, code, 1.25, 3.5, 179, (lesion,), SpotScore(3, 2, 1), None)


def test_what_was_measured_is_read_back(tmp_path):
    path = tmp_path / "journal.jsonl"
    Journal(path, "v1").add(record())
    again = Journal(path, "v1")
    assert (RUNG, NAME) in again
    assert again.records([RUNG], [NAME]) == [record()]


def test_a_torn_last_line_is_measured_again(tmp_path):
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, "v1")
    journal.add(record())
    journal.add(record(OTHER_NAME))
    path.write_text(path.read_text()[:-40])
    again = Journal(path, "v1")
    assert (RUNG, NAME) in again
    assert (RUNG, OTHER_NAME) not in again
    again.add(record(OTHER_NAME))
    assert len(Journal(path, "v1")) == 2


def test_measurements_of_another_program_are_dropped_unless_asked_for(tmp_path):
    path = tmp_path / "journal.jsonl"
    Journal(path, "v1").add(record())
    kept = Journal(path, "v2", any_code=True)
    assert len(kept) == 1
    newer = Journal(path, "v2")
    assert (len(newer), newer.outdated) == (0, 1)


def test_another_file_is_not_overwritten(tmp_path):
    path = tmp_path / "notes.jsonl"
    path.write_text("my notes\nmore of them\n")
    with pytest.raises(InputError, match=r"notes\.jsonl: line 1"):
        Journal(path, "v1")
    assert path.read_text().startswith("my notes")


def test_a_record_is_found_by_all_its_conditions():
    journal = Journal(None, "v1")
    journal.add(record())
    assert (Rung("trilateration", "true", 30, True), NAME) not in journal
    assert (Rung("trilateration", "tracked", 1, True), NAME) not in journal
    assert journal.records([RUNG], [OTHER_NAME]) == []


def test_the_fingerprint_follows_the_source(tmp_path):
    (tmp_path / "a.py").write_text("x = 1\n")
    before = code_fingerprint([tmp_path])
    assert code_fingerprint([tmp_path]) == before
    (tmp_path / "a.py").write_text("x = 2\n")
    assert code_fingerprint([tmp_path]) != before
