"""The page of a patient: one selection in every view, the report, the visits."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton

from app.widgets.body_view import BodyView
from app.widgets.compare_view import CompareView
from app.widgets.photo_view import PhotoView
from app.widgets.tables import LesionTable, RowTable
from app.windows.patient_page import PatientPage
from app.windows.visit.page import VisitPage
from tests.gui.conftest import Desk, OpenDesk, World

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def desk(world: World, tmp_path: Path, open_desk: OpenDesk) -> Desk:
    """The page of the patient whose first visit is closed, with three lesions."""
    shutil.copytree(world.root / "clinic", tmp_path / "clinic")
    made = open_desk()
    made.open_patient("muller")
    return made


def patient_page(desk: Desk) -> PatientPage:
    page = desk.page
    assert isinstance(page, PatientPage)
    return page


def click_row(table: RowTable, row: int) -> None:
    QTest.mouseClick(table.viewport(), LEFT, pos=table.visualRect(table.model().index(row, 1)).center())


def test_the_page_shows_visits_lesions_and_the_newest_photo(desk: Desk) -> None:
    assert [row.cells[0] for row in desk.find("visit_table", RowTable).rows()] == ["1"]
    rows = desk.find("lesion_table", LesionTable).rows()
    assert [row.cells[0] for row in rows] == ["1", "2", "3"]
    photo = desk.find("patient_photo", PhotoView)
    assert photo.image_size[0] > 0
    assert {m.id for m in photo.markers()} == {row.key for row in rows}
    assert desk.text("patient_picture_caption").startswith("Front view, ")
    assert desk.text("start_visit") == "Start follow-up"


def test_a_click_on_a_lesion_in_any_view_selects_it_in_all(desk: Desk) -> None:
    desk.click("patient_pane_body")
    desk.idle()
    body, table = desk.find("patient_body", BodyView), desk.find("lesion_table", LesionTable)
    photo = desk.main.findChild(PhotoView, "patient_photo")
    keys = [row.key for row in table.rows()]

    def selected() -> set[str | None]:
        return {body.selected(), table.selected(), photo.selected()}

    click_row(table, 1)
    assert selected() == {keys[1]}
    desk.wait_until(lambda: body.display_position(keys[0]) is not None, "the marker to be seen on the body")
    canvas = body.canvas()
    assert canvas is not None
    QTest.mouseClick(canvas, LEFT, pos=body.display_position(keys[0]))
    assert selected() == {keys[0]}
    desk.click("patient_pane_photo")
    marker = next(m for m in photo.markers() if m.id == keys[2])
    desk.click_photo("patient_photo", marker.x, marker.y)
    assert selected() == {keys[2]}
    QTest.keyClick(photo, Qt.Key.Key_N)
    assert selected() == {keys[0]}
    click_row(table, 2)
    assert selected() == {keys[2]}
    desk.click("patient_pane_body")
    assert selected() == {keys[2]}, "changing the view keeps it"
    desk.click("nav_patients")
    desk.open_patient("novak")
    desk.click("nav_patients")
    desk.open_patient("muller")
    assert selected() == {None}, "another patient begins anew"


def test_the_report_is_written_where_the_user_says_or_it_is_told_why_not_and_no_file_is_left(
    desk: Desk, tmp_path: Path
) -> None:
    page = patient_page(desk)
    visit = desk.store.visits.list(page.patient_id or 0)[0]
    path = tmp_path / "Bericht Müller.pdf"
    page.export_report(visit.id, path)
    desk.idle()
    assert path.read_bytes().startswith(b"%PDF")
    assert page.banner.kind == "success"
    assert str(path) in page.banner.text()

    out = tmp_path / "out"
    out.mkdir()
    (out / "file").write_text("not a folder")
    (out / "report.pdf").mkdir()
    before = sorted(out.rglob("*"))
    for unwritable in (
        out / "missing" / "report.pdf",
        out / "file" / "report.pdf",
        out / "report.pdf",
        Path("/dev/full/report.pdf"),
    ):
        page.export_report(visit.id, unwritable)
        desk.idle()
        assert page.banner.kind == "error", unwritable
        assert desk.text("banner_message")
        assert desk.text("banner_advice"), "it says what to do"
        assert "Something went wrong" not in page.banner.text(), "this is no bug"
        assert sorted(out.rglob("*")) == before
        desk.click("banner_close")
        assert not desk.is_shown("message_banner")


def test_dermoscopy_is_compared_two_visits_at_a_time(desk: Desk) -> None:
    page = patient_page(desk)
    table = desk.find("lesion_table", LesionTable)
    click_row(table, 0)
    compare = page.findChild(QPushButton, "compare_dermoscopy")
    assert not compare.isEnabled(), "there is no image yet"
    QTest.keyClick(table, Qt.Key.Key_Return)
    assert "no dermoscopic image" in page.banner.text()
    lesion = int(table.rows()[0].key)
    visit = desk.store.visits.list(page.patient_id or 0)[0]
    for shade in (90, 200):
        ok, data = cv2.imencode(".png", np.full((90, 120, 3), shade, np.uint8))
        assert ok
        desk.store.dermoscopy.add(lesion, visit.id, data.tobytes(), by=desk.context.user_id)
    desk.context.touch(page.patient_id or 0)
    assert table.selected() == str(lesion)
    desk.click("compare_dermoscopy")
    view = desk.find("compare_sheet").findChild(CompareView)
    assert view.left.image_size == view.right.image_size == (120, 90)
    desk.click("compare_flicker")
    QTest.keyClick(desk.find("compare_sheet"), Qt.Key.Key_Escape)
    desk.wait_until(lambda: not desk.is_shown("compare_sheet"), "the comparison to go")


def test_a_visit_cannot_be_opened_twice(desk: Desk, world: World) -> None:
    page = patient_page(desk)
    patient_id = page.patient_id or 0
    start = desk.find("start_visit")
    for _ in range(2):
        QTest.mouseClick(start, LEFT)
    assert len(desk.main.findChildren(VisitPage)) == 1
    visit_page = desk.page
    assert isinstance(visit_page, VisitPage)
    assert visit_page.isVisible()
    visit_id = visit_page.session.visit_id
    visit_page.captures.deck.choose_path(world.root / "psi")
    desk.idle()
    desk.click("stance_primary")
    desk.idle()
    desk.click("visit_back")
    desk.find("patient_page")
    QTest.qWait(0)
    assert desk.main.findChildren(VisitPage) == []
    assert [v.is_open for v in desk.store.visits.list(patient_id)] == [False, True]
    assert desk.text("start_visit") == "Continue visit"
    desk.click("start_visit")
    again = desk.page
    assert isinstance(again, VisitPage)
    assert again.session.visit_id == visit_id
    desk.click("nav_patients")
    assert [v.is_open for v in desk.store.visits.list(patient_id)] == [False, True]


def test_a_closed_visit_is_opened_for_reading(desk: Desk) -> None:
    desk.click("open_visit")
    page = desk.page
    assert isinstance(page, VisitPage)
    assert page.session.snapshot.visit.number == 1
    assert desk.text("review_primary") == "Export report"
    desk.click("review_secondary")
    desk.find("patient_page")
    assert len(desk.store.visits.list(patient_page(desk).patient_id or 0)) == 1


def test_a_patient_never_seen_is_told_what_comes_next(small_desk: Desk) -> None:
    small_desk.open_patient("fournier")
    assert small_desk.text("start_visit") == "Start first visit"
    page = patient_page(small_desk)
    for name in ("open_visit", "visit_report", "compare_dermoscopy", "patient_pane_body"):
        assert not page.findChild(QPushButton, name).isEnabled(), name
