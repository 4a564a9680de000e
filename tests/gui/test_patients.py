"""The list of patients, its search, and the form of a patient."""

from __future__ import annotations

from datetime import date, timedelta

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit

from app.widgets.tables import RowTable
from tests.gui.conftest import Desk, OpenDesk


def listed(desk: Desk) -> list[str]:
    """First column of the list."""
    return [row.cells[0] for row in desk.find("patients_page").findChild(RowTable).rows()]


def search(desk: Desk, text: str) -> list[str]:
    desk.type("patient_search", text)
    QTest.qWait(180)
    return listed(desk)


def test_everyone_is_listed_by_name(small_desk: Desk) -> None:
    assert listed(small_desk) == ["Åkesson, Maja", "Fournier, Rémi", "Müller, Jörg", "Novák, Jiří"]
    assert small_desk.text("patient_count") == "4 patients"
    table = small_desk.find("patient_table", RowTable)
    assert table.rows()[3].cells == ("Novák, Jiří", "GD-1042", "14 May 1986", "0", "0", "")


@pytest.mark.parametrize(
    ("typed", "name"),
    [
        ("novak", "Novák, Jiří"),
        ("NOVÁK", "Novák, Jiří"),
        ("jiri", "Novák, Jiří"),
        ("muller jorg", "Müller, Jörg"),
        ("akes", "Åkesson, Maja"),
        ("Rémi", "Fournier, Rémi"),
        ("0871", "Åkesson, Maja"),
    ],
)
def test_search_needs_no_accents_no_capitals_and_no_whole_words(
    small_desk: Desk, typed: str, name: str
) -> None:
    assert search(small_desk, typed) == [name]
    assert small_desk.text("patient_count") == "1 patient"


def test_the_only_one_found_opens_with_enter(small_desk: Desk) -> None:
    small_desk.type("patient_search", "mull", enter=True)
    small_desk.find("patient_page")
    assert small_desk.text("patient_title") == "Müller, Jörg"


def test_nobody_found_is_said_and_enter_opens_nothing(small_desk: Desk) -> None:
    small_desk.type("patient_search", "zz%_'", enter=True)
    assert small_desk.is_shown("patients_page")
    assert any(
        label.isVisible() and label.text() == "Nobody found"
        for label in small_desk.find("patients_page").findChildren(QLabel)
    )
    assert search(small_desk, "")[0] == "Åkesson, Maja"


def test_a_patient_opens_by_double_click_by_enter_and_by_the_button(small_desk: Desk) -> None:
    table = small_desk.find("patient_table", RowTable)
    button = small_desk.main.findChild(type(small_desk.find("new_patient")), "open_patient")
    assert not button.isEnabled(), "nobody is selected"
    spot = table.visualRect(table.model().index(2, 0)).center()
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=spot)
    assert button.isEnabled()
    small_desk.click("open_patient")
    assert small_desk.text("patient_title") == "Müller, Jörg"
    small_desk.click("patient_back")
    assert table.selected() is not None, "the place in the list is kept"
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=spot)
    QTest.mouseDClick(table.viewport(), Qt.MouseButton.LeftButton, pos=spot)
    assert small_desk.text("patient_title") == "Müller, Jörg"
    small_desk.click("nav_patients")
    QTest.keyClick(table, Qt.Key.Key_Return)
    assert small_desk.text("patient_title") == "Müller, Jörg"


def test_an_empty_clinic_asks_for_its_first_patient(open_desk: OpenDesk) -> None:
    desk = open_desk(signed_in=False)
    desk.type("login_username", "weber")
    desk.type("login_password", "a long password 1")
    desk.type("login_repeat", "a long password 1", enter=True)
    assert not desk.is_shown("new_patient"), "one way at a time"
    desk.click("empty_action")
    desk.type("patient_family_name", "Nováková", enter=True)
    assert desk.text("patient_title") == "Nováková"


def test_a_new_patient_is_stored_as_typed_and_opened(small_desk: Desk) -> None:
    desk = small_desk
    desk.click("new_patient")
    desk.type("patient_family_name", "Dvořák")
    desk.type("patient_given_name", "Zoë")
    desk.type("patient_birth_date", "29.02.1984")
    desk.choose("patient_sex", "Female")
    desk.type("patient_clinic_number", "GD-2000")
    desk.type("patient_note", "Many naevi")
    desk.click("patient_save")
    assert desk.text("patient_title") == "Dvořák, Zoë"
    (found,) = desk.store.patients.search("dvorak")
    p = found.patient
    assert (p.family_name, p.given_name, p.birth_date, p.sex, p.clinic_number, p.note) == (
        "Dvořák",
        "Zoë",
        date(1984, 2, 29),
        "F",
        "GD-2000",
        "Many naevi",
    )
    assert p.created_by == desk.context.user_id
    assert not desk.is_shown("patient_sheet")
    desk.click("patient_back")
    assert "Dvořák, Zoë" in listed(desk)


@pytest.mark.parametrize(
    ("field", "text", "words"),
    [
        ("patient_family_name", "   ", "family name is needed"),
        ("patient_birth_date", "14/05/86", "1986-05-14"),
        ("patient_birth_date", "1987-02-29", "1986-05-14"),
        ("patient_birth_date", "01.01.1850", "not possible"),
        ("patient_birth_date", (date.today() + timedelta(days=1)).isoformat(), "not possible"),
    ],
)
def test_a_field_that_is_wrong_says_why_and_nothing_is_stored(
    small_desk: Desk, field: str, text: str, words: str
) -> None:
    desk = small_desk
    desk.click("new_patient")
    desk.type("patient_family_name", "Dvořák")
    desk.type(field, text, enter=True)
    assert words in desk.text(f"{field}_error")
    assert desk.is_shown("patient_sheet"), "what was typed is kept"
    assert desk.store.patients.count() == 4
    QTest.keyClick(desk.find(field), Qt.Key.Key_Backspace)
    assert not desk.is_shown(f"{field}_error")


def test_a_clinic_number_that_is_taken_is_told(small_desk: Desk) -> None:
    desk = small_desk
    desk.click("new_patient")
    desk.type("patient_family_name", "Dvořák")
    desk.type("patient_clinic_number", "gd 1042", enter=True)
    assert "clinic number" in desk.text("patient_error").lower()
    assert "Nov" not in desk.text("patient_error"), "another patient's name is not told"
    assert desk.store.patients.count() == 4
    desk.type("patient_clinic_number", "GD-3000", enter=True)
    assert desk.text("patient_title") == "Dvořák"


def test_a_patient_is_changed_and_every_place_shows_it(small_desk: Desk) -> None:
    desk = small_desk
    desk.open_patient("novak")
    desk.click("edit_patient")
    assert desk.find("patient_family_name", QLineEdit).text() == "Novák"
    assert desk.find("patient_birth_date", QLineEdit).text() == "1986-05-14"
    desk.type("patient_family_name", "")
    desk.click("patient_save")
    assert desk.is_shown("patient_family_name_error")
    desk.type("patient_family_name", "Novák-Šťastný")
    desk.type("patient_birth_date", "1986-05-15")
    desk.click("patient_save")
    assert desk.text("patient_title") == "Novák-Šťastný, Jiří"
    assert "15 May 1986" in desk.text("patient_details")
    assert desk.main.windowTitle() == "Novák-Šťastný, Jiří - GeoDerm"
    desk.click("patient_back")
    assert "Novák-Šťastný, Jiří" in listed(desk)
    (found,) = desk.store.patients.search("stastny")
    assert found.patient.sex == "M", "what was not touched is kept"


@pytest.mark.parametrize("way", ["escape", "patient_cancel", "patient_sheet_close"])
def test_a_form_that_is_left_changes_nothing(small_desk: Desk, way: str) -> None:
    desk = small_desk
    desk.click("new_patient")
    desk.type("patient_family_name", "Dvořák")
    if way == "escape":
        QTest.keyClick(desk.find("patient_family_name"), Qt.Key.Key_Escape)
    else:
        desk.click(way)
    desk.wait_until(lambda: not desk.is_shown("patient_sheet"), "the form to go")
    assert desk.is_shown("patients_page")
    assert desk.store.patients.count() == 4


def test_tab_stays_in_the_form(small_desk: Desk) -> None:
    small_desk.main.activateWindow()
    small_desk.click("new_patient")
    sheet = small_desk.find("patient_sheet")
    for _ in range(12):
        QTest.keyClick(small_desk.main.focusWidget(), Qt.Key.Key_Tab)
        assert sheet.isAncestorOf(small_desk.main.focusWidget())
