"""The main window: privacy, leaving, failures nobody else shows."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractItemView, QLabel, QLineEdit, QWidget

from app.settings import read_settings
from app.tasks import install_excepthook
from app.tasks.failures import BUG_MESSAGE
from app.widgets.tables import RowTable
from tests.gui.conftest import Desk, OpenDesk, World

NAMES = ("Nov", "Jiř", "Müll", "Jörg", "Åkes", "Maja", "Fourn", "Rémi", "1986", "1971")


def everything_shown(desk: Desk) -> str:
    """All text a person next to the doctor could read."""
    texts = [desk.main.windowTitle()]
    for widget in desk.main.findChildren(QWidget):
        if not widget.isVisible():
            continue
        texts.append(widget.toolTip())
        if isinstance(widget, QLabel | QLineEdit):
            texts.append(widget.text())
        if isinstance(widget, QAbstractItemView) and widget.model() is not None:
            model = widget.model()
            for row in range(model.rowCount()):
                for column in range(model.columnCount()):
                    for role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole):
                        texts.append(str(model.index(row, column).data(role) or ""))
    return "\n".join(texts)


def names_in(text: str) -> list[str]:
    return [name for name in NAMES if name in text]


def test_privacy_mode_hides_names_in_the_list_the_page_and_the_title(small_desk: Desk) -> None:
    desk = small_desk
    assert names_in(everything_shown(desk)) != []
    desk.click("privacy_mode")
    assert names_in(everything_shown(desk)) == []
    table = desk.find("patient_table", RowTable)
    assert {row.cells[0] for row in table.rows()} >= {"Patient GD-1042", "Patient GD-0998"}
    table.set_selected(next(row.key for row in table.rows() if row.cells[1] == "GD-1042"))
    QTest.keyClick(table, Qt.Key.Key_Return)
    desk.find("patient_page")
    assert desk.text("patient_title") == "Patient GD-1042"
    assert names_in(everything_shown(desk)) == []
    assert desk.main.windowTitle() == "GeoDerm"
    desk.click("privacy_mode")
    assert desk.text("patient_title") == "Novák, Jiří"
    assert desk.main.windowTitle() == "Novák, Jiří - GeoDerm"
    desk.click("start_visit")
    desk.find("visit_page")
    assert desk.main.windowTitle() == "Novák, Jiří - GeoDerm"
    desk.click("privacy_mode")
    assert desk.text("visit_patient") == "Patient GD-1042"
    assert names_in(everything_shown(desk)) == []
    desk.click("visit_back")
    assert names_in(everything_shown(desk)) == []


def test_privacy_mode_has_a_key_and_outlives_the_window(small_desk: Desk, open_desk: OpenDesk) -> None:
    desk = small_desk
    desk.main.activateWindow()
    desk.wait_until(desk.main.isActiveWindow, "the window to be active")
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    QTest.keyClick(desk.main, Qt.Key.Key_P, keys)
    assert desk.context.privacy_mode
    assert read_settings(desk.context.data_dir).privacy_mode
    desk.main.close()
    again = open_desk(desk.context.data_dir)
    assert names_in(everything_shown(again)) == []


def test_a_visit_outlives_signing_out_and_closing_the_window(
    world: World, tmp_path: Path, open_desk: OpenDesk
) -> None:
    shutil.copytree(world.root / "clinic", tmp_path / "clinic")
    desk = open_desk()
    patient = desk.store.patients.search("muller")[0].patient
    desk.open_patient("muller")
    desk.click("patient_pane_body")
    desk.idle()
    desk.click("start_visit")
    desk.page.captures.deck.choose_path(world.root / "psi")  # type: ignore[attr-defined]
    desk.idle()
    desk.click("stance_primary")
    desk.idle()
    desk.click("log_out")
    assert desk.is_shown("login_page")
    assert names_in(everything_shown(desk)) == []
    desk.sign_in()
    desk.open_patient("muller")
    assert desk.text("start_visit") == "Continue visit"
    desk.click("start_visit")
    desk.find("visit_page")
    desk.main.close()
    assert [v.is_open for v in desk.store.visits.list(patient.id)] == [False, True]


def test_signing_out_while_work_runs_ends_it(world: World, tmp_path: Path, open_desk: OpenDesk) -> None:
    shutil.copytree(world.root / "clinic", tmp_path / "clinic")
    desk = open_desk()
    desk.open_patient("novak")
    patient = desk.store.patients.search("novak")[0].patient
    desk.click("start_visit")
    desk.page.captures.deck.choose_path(world.root / "psi")  # type: ignore[attr-defined]
    desk.idle()
    QTest.mouseClick(desk.find("stance_primary"), Qt.MouseButton.LeftButton)
    assert desk.context.tasks.busy
    desk.main.log_out()
    desk.idle()
    assert desk.is_shown("login_page")
    assert all(not desk.store.captures.list(v.id) for v in desk.store.visits.list(patient.id))


def test_an_error_nobody_expected_is_told_without_a_trace(
    small_desk: Desk, capfd: pytest.CaptureFixture[str]
) -> None:
    install_excepthook(small_desk.main.tell_failure)

    def fail() -> None:
        raise ZeroDivisionError("Novák")

    small_desk.main.about.clicked.disconnect()
    small_desk.main.about.clicked.connect(fail)
    small_desk.click("about")
    small_desk.find("tell_sheet")
    assert small_desk.text("tell_sheet_title") == BUG_MESSAGE
    assert "log file" in small_desk.text("sheet_text")
    small_desk.click("sheet_ok")
    small_desk.wait_until(lambda: not small_desk.is_shown("tell_sheet"), "the message to go")
    sys.excepthook = sys.__excepthook__
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
    assert "Nov" not in out + err


def test_about_says_what_it_is_not(small_desk: Desk) -> None:
    small_desk.click("about")
    assert "does not diagnose" in small_desk.text("sheet_text")
    QTest.keyClick(small_desk.find("tell_sheet"), Qt.Key.Key_Escape)
    small_desk.wait_until(lambda: not small_desk.is_shown("tell_sheet"), "the message to go")


def test_only_the_demonstration_says_that_it_is_one(small_desk: Desk) -> None:
    assert not small_desk.is_shown("demo_badge")


def test_cameras_and_calibration_are_reached_from_the_bar(small_desk: Desk) -> None:
    desk = small_desk
    desk.click("cameras_calibration")
    wizard = desk.find("calibration_wizard")
    assert wizard.isVisible()
    QTest.keyClick(wizard, Qt.Key.Key_Escape)
    desk.wait_until(
        lambda: not any(w.isVisible() for w in desk.main.findChildren(QWidget, "calibration_wizard")),
        "the wizard to close",
        5,
    )
