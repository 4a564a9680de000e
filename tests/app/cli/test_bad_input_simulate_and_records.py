"""``simulate``, ``records`` and ``devices``: wrong options, folders that hold no clinic, damaged records."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import pytest

from tests.app.cli.cases import Outcome, assert_told, geoderm

# --- simulate


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--shape", "giant"), "giant"),
        (("--stance", "headstand"), "headstand"),
        (("--view", "above"), "above"),
        (("--visit", "0"), "--visit"),
        (("--visit", "two"), "--visit"),
        (("--frames", "0"), "--frames"),
        (("--frames", "1e9"), "--frames"),
        (("--frames", "301"), "--frames"),
        (("--distance-m", "0.1"), "--distance-m"),
        (("--distance-m", "nan"), "--distance-m"),
        (("--distance-m", "inf"), "--distance-m"),
        (("--turn-deg", "900"), "--turn-deg"),
        (("--turn-deg", "nan"), "--turn-deg"),
        (("--seed", "x"), "--seed"),
        (("--bogus",), "--bogus"),
    ],
    ids=lambda o: " ".join(o) if isinstance(o, tuple) else "",
)
def test_a_wrong_option_is_named_and_nothing_is_written(
    tmp_path: Path, options: tuple[str, ...], word: str
) -> None:
    assert_told(geoderm("simulate", tmp_path / "out", "--frames", "1", *options), 2, word)
    assert [p.name for p in tmp_path.iterdir()] == []


def test_an_earlier_capture_is_never_overwritten(tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.mkdir()
    (taken / "note.txt").write_text("mine")
    assert_told(geoderm("simulate", taken), 2, taken, "exists")
    assert [p.name for p in taken.iterdir()] == ["note.txt"]


@pytest.mark.parametrize("beside", ["a.oni.calibration.json", "a.oni.picture.png", "a.lesions.json"])
def test_what_lies_beside_a_recording_is_never_overwritten(tmp_path: Path, beside: str) -> None:
    (tmp_path / beside).write_text("mine")
    assert_told(geoderm("simulate", tmp_path / "a.oni"), 2, beside, "exists")
    assert [p.name for p in tmp_path.iterdir()] == [beside]


@pytest.mark.parametrize("name", ["capture", "capture.oni"])
def test_a_place_below_a_file_cannot_be_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("mine")
    outcome = geoderm("simulate", tmp_path / "file" / name, "--frames", "1")
    assert outcome.code in (2, 3)
    assert_told(outcome, outcome.code, tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"


# --- records

READING: list[tuple[str, ...]] = [
    ("patients",),
    ("visits", "1"),
    ("lesions", "1"),
    ("verify",),
    ("report", "1", "--out", "r.pdf"),
    ("export-capture", "1", "--out", "c"),
    ("add-patient", "Muster"),
]


@pytest.fixture
def clinic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clinic with one user and no patient, made by the command itself."""
    monkeypatch.setenv("GEODERM_PASSWORD", "a long enough password 1")
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "clinic"
    outcome = geoderm("records", "add-user", "doctor", "--data", folder)
    assert (outcome.code, outcome.err) == (0, ""), outcome
    return folder


def records(folder: Path, *arguments: object) -> Outcome:
    return geoderm("records", *arguments, "--data", folder)


@pytest.mark.parametrize("command", READING, ids=lambda c: c[0])
def test_a_folder_without_a_clinic_is_refused_and_stays_empty(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert_told(records(empty, *command), 2, empty, "no clinic")
    assert list(empty.iterdir()) == []


def test_a_folder_that_does_not_exist_is_not_made(tmp_path: Path) -> None:
    assert_told(records(tmp_path / "none", "patients"), 2, tmp_path / "none")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("command", READING, ids=lambda c: c[0])
def test_a_file_that_is_no_database_is_told_and_left_alone(
    tmp_path: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    clinic = tmp_path / "clinic"
    clinic.mkdir()
    content = b"this is a text and no database\n" * 200
    (clinic / "clinic.db").write_bytes(content)
    outcome = records(clinic, *command)
    assert outcome.code in (2, 3)
    assert_told(outcome, outcome.code)
    assert (clinic / "clinic.db").read_bytes() == content


def test_a_database_of_another_program_is_left_alone(tmp_path: Path) -> None:
    clinic = tmp_path / "clinic"
    clinic.mkdir()
    with sqlite3.connect(clinic / "clinic.db") as database:
        database.execute("CREATE TABLE recipes (id INTEGER, name TEXT)")
    database.close()
    outcome = records(clinic, "patients")
    assert_told(outcome, 3, "not a GeoDerm clinic")
    with sqlite3.connect(clinic / "clinic.db") as database:
        names = [row[0] for row in database.execute("SELECT name FROM sqlite_master")]
    database.close()
    assert names == ["recipes"]


def test_a_clinic_of_a_newer_program_is_refused_and_left_alone(clinic: Path) -> None:
    with sqlite3.connect(clinic / "clinic.db") as database:
        database.execute("UPDATE alembic_version SET version_num = 'from_the_future'")
    database.close()
    for command in READING[:4]:
        assert_told(records(clinic, *command), 3, "newer")
    with sqlite3.connect(clinic / "clinic.db") as database:
        assert database.execute("SELECT version_num FROM alembic_version").fetchall() == [
            ("from_the_future",)
        ]
    database.close()


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (("visits", "77"), ""),
        (("lesions", "77"), ""),
        (("visits", "-1"), ""),
        (("visits", "99999999999999999999999"), ""),
        (("visits", "one"), "patient"),
        (("report", "77", "--out", "r.pdf"), ""),
        (("export-capture", "77", "--out", "c"), ""),
    ],
    ids=str,
)
def test_a_record_that_is_not_there(clinic: Path, command: tuple[str, ...], word: str) -> None:
    assert_told(records(clinic, *command), 2, word)
    assert not Path("r.pdf").exists()
    assert not Path("c").exists()


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("Muster", "--born", "yesterday"), "--born"),
        (("Muster", "--born", "2026-02-30"), "--born"),
        (("Muster", "--born", "2999-01-01"), ""),
        (("Muster", "--sex", "Q"), ""),
        (("", "--sex", "F"), ""),
        (("M" * 100_000,), ""),
        (("Muster", "--user", "nobody"), "--user"),
        ((), "family_name"),
    ],
    ids=lambda o: " ".join(o)[:40] if isinstance(o, tuple) else "",
)
def test_a_bad_patient_is_not_entered(clinic: Path, options: tuple[str, ...], word: str) -> None:
    assert_told(records(clinic, "add-patient", *options), 2, word)
    assert json.loads(records(clinic, "patients", "--json").out) == []


def test_a_user_is_not_made_twice(clinic: Path) -> None:
    assert_told(records(clinic, "add-user", "doctor"), 2, "user name")


def test_a_weak_password_is_refused(clinic: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODERM_PASSWORD", "x")
    assert_told(records(clinic, "add-user", "second"), 2, "assword")


def test_a_good_patient_is_entered_once_with_accents(clinic: Path) -> None:
    outcome = records(clinic, "add-patient", "Müßig-Łoś", "Zoë", "--born", "1961-04-05", "--sex", "F")
    assert (outcome.code, outcome.err) == (0, "")
    (patient,) = json.loads(records(clinic, "patients", "musig", "--json").out) or json.loads(
        records(clinic, "patients", "--json").out
    )
    assert patient["born"] == "1961-04-05"
    assert "Müßig-Łoś" in patient["name"]
    assert records(clinic, "verify").code == 0


# --- the command as a whole


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("relocte",), "relocte"),
        (("--bogus",), "--bogus"),
        (("capture-info",), "folder"),
        (("geodesics", "a.off"), "--sources"),
        (("records", "patientz"), "patientz"),
        (("demo", "--moles", "0"), "--moles"),
        (("devices", "now"), "now"),
    ],
    ids=str,
)
def test_wrong_use_is_told_in_one_line_with_where_to_find_help(arguments: tuple[str, ...], word: str) -> None:
    assert_told(geoderm(*arguments), 2, word, "--help")


def test_help_is_no_error() -> None:
    outcome = geoderm("relocate", "--help")
    assert (outcome.code, outcome.err) == (0, "")
    assert "--lesions" in outcome.out


def test_devices_are_listed_without_noise() -> None:
    outcome = geoderm("devices", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert any(device["kind"] == "simulator" for device in json.loads(outcome.out))
