"""The first start and signing in."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit

from core.records import ClinicStore
from tests.gui.conftest import DISPLAY_NAME, PASSWORD, USER, Desk, OpenDesk


@pytest.fixture
def first_start(open_desk: OpenDesk) -> Desk:
    """The window on a clinic that has no user."""
    return open_desk(signed_in=False)


@pytest.fixture
def desk(open_desk: OpenDesk, tmp_path: Path) -> Desk:
    """The window on a clinic that has one."""
    with ClinicStore.open(tmp_path / "clinic") as store:
        store.users.create(USER, DISPLAY_NAME, PASSWORD)
    return open_desk(signed_in=False)


def test_the_first_start_makes_the_user_and_opens_the_patients(first_start: Desk) -> None:
    desk = first_start
    assert desk.text("login_submit") == "Create user"
    assert not desk.main.bar.isVisible(), "nothing but the form"
    desk.type("login_display_name", "Dr Jörg Müller")
    desk.type("login_username", "JMueller")
    desk.type("login_password", PASSWORD)
    desk.type("login_repeat", PASSWORD)
    desk.click("login_submit")
    desk.find("patients_page")
    (user,) = desk.store.users.list()
    assert (user.username, user.display_name) == ("jmueller", "Dr Jörg Müller")
    assert desk.context.user == user
    assert desk.text("user_name") == "Dr Jörg Müller"


@pytest.mark.parametrize(
    ("username", "password", "repeated", "told_in", "words"),
    [
        ("weber", PASSWORD, "another password", "login_repeat_error", "differ"),
        ("weber", "short", "short", "login_error", "password"),
        ("", PASSWORD, PASSWORD, "login_error", "user name"),
    ],
)
def test_a_user_that_cannot_be_made_is_told_in_words_and_not_stored(
    first_start: Desk, username: str, password: str, repeated: str, told_in: str, words: str
) -> None:
    desk = first_start
    if username:
        desk.type("login_username", username)
    desk.type("login_password", password)
    desk.type("login_repeat", repeated, enter=True)
    assert words in desk.text(told_in).lower()
    assert desk.store.users.count() == 0
    assert desk.context.user is None
    assert desk.is_shown("login_page")


def test_a_wrong_password_is_refused_and_the_right_one_is_not(desk: Desk) -> None:
    assert desk.text("login_submit") == "Sign in"
    assert not desk.is_shown("login_repeat")
    desk.type("login_username", USER)
    desk.type("login_password", "a wrong password")
    desk.click("login_submit")
    first = desk.text("login_error")
    assert first == "User name or password is wrong."
    assert desk.context.user is None
    field = desk.find("login_password", QLineEdit)
    assert field.echoMode() == QLineEdit.EchoMode.Password
    desk.type("login_username", "nobody")
    desk.click("login_submit")
    assert desk.text("login_error") == first, "it does not say which of the two is wrong"
    desk.type("login_username", USER.upper())
    desk.type("login_password", PASSWORD, enter=True)
    desk.find("patients_page")
    assert desk.text("user_name") == DISPLAY_NAME


def test_an_error_goes_away_when_the_field_is_changed(first_start: Desk) -> None:
    desk = first_start
    desk.type("login_username", "weber")
    desk.type("login_password", PASSWORD)
    desk.type("login_repeat", "another", enter=True)
    assert desk.is_shown("login_repeat_error")
    QTest.keyClick(desk.find("login_repeat"), Qt.Key.Key_Backspace)
    assert not desk.is_shown("login_repeat_error")


def test_signing_out_forgets_the_user_and_the_password_and_keeps_the_name(desk: Desk) -> None:
    desk.sign_in()
    desk.click("log_out")
    assert desk.context.user is None
    assert desk.is_shown("login_page")
    assert not desk.main.bar.isVisible()
    assert desk.find("login_username", QLineEdit).text() == USER
    assert desk.find("login_password", QLineEdit).text() == ""
    assert desk.main.windowTitle() == "GeoDerm"
    desk.main.show_patients()
    assert desk.is_shown("login_page"), "nothing of the clinic is shown without a user"
    desk.type("login_password", PASSWORD, enter=True)
    desk.find("patients_page")


def test_the_next_start_offers_who_signed_in_last(desk: Desk, open_desk: OpenDesk) -> None:
    desk.sign_in()
    desk.main.close()
    again = open_desk(desk.context.data_dir, signed_in=False)
    assert again.find("login_username", QLineEdit).text() == USER
    again.type("login_password", PASSWORD, enter=True)
    again.find("patients_page")
