"""The visit page driven with the mouse, on the real session, tracker, relocation and store."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QWidget
from pytestqt.qtbot import QtBot

from app.context import AppContext
from app.demo.scene import DemoCameras
from app.theme import apply_theme
from app.widgets.photo_view import PhotoView
from app.windows.visit.page import VisitPage
from app.workflows.table import State
from core.records import ClinicStore
from core.records.sites import find_site
from devices.trackers import default_tracker
from tests.gui.conftest import PASSWORD, USER, NoCameras, World, seen

LEFT = Qt.MouseButton.LeftButton


class Hands:
    """What a person does on the page."""

    def __init__(self, page: VisitPage, context: AppContext, qtbot: QtBot) -> None:
        self.page, self.context, self._bot = page, context, qtbot

    def find(self, name: str) -> QWidget:
        found = self.page.findChild(QWidget, name)
        assert found is not None, name
        return found

    def click(self, name: str) -> None:
        widget = self.find(name)
        assert widget.isVisible(), f"{name} is hidden"
        assert widget.isEnabled(), f"{name} is disabled"
        QTest.mouseClick(widget, LEFT)
        self.wait()

    def wait(self) -> None:
        self._bot.waitUntil(lambda: not self.context.tasks.busy, timeout=60_000)
        QApplication.processEvents()

    def open(self, folder: Path) -> None:
        self.page.captures.deck.choose_path(folder)
        self.wait()

    def click_photo(self, name: str, pixel: tuple[float, float]) -> None:
        photo = self.find(name)
        assert isinstance(photo, PhotoView)
        photo.center_on(*pixel, 5.0)
        QTest.mouseClick(photo.viewport(), LEFT, pos=photo.viewport_position(*pixel))
        QApplication.processEvents()

    def drag_photo(self, name: str, start: tuple[float, float], end: tuple[float, float]) -> None:
        photo = self.find(name)
        assert isinstance(photo, PhotoView)
        photo.center_on(*start, 3.0)
        a, b = photo.viewport_position(*start), photo.viewport_position(*end)
        QTest.mousePress(photo.viewport(), LEFT, pos=a)
        for share in (0.4, 0.8, 1.0):
            QTest.mouseMove(photo.viewport(), a + (b - a) * share + QPoint(0, 0 if share == 1 else 8))
        QTest.mouseRelease(photo.viewport(), LEFT, pos=b)
        QApplication.processEvents()

    @property
    def banner(self) -> str:
        return self.page.banner.text()

    @property
    def state(self) -> State:
        return self.page.session.state


Open = Callable[..., Hands]


@pytest.fixture
def open_page(world: World, tmp_path: Path, qapp: QApplication, qtbot: QtBot) -> Iterator[Open]:
    """Opens a visit page on a copy of the clinic: of the known patient, or of the new one."""
    apply_theme(qapp)
    folder = tmp_path / "clinic"
    shutil.copytree(world.root / "clinic", folder)
    contexts: list[AppContext] = []
    pages: list[VisitPage] = []

    def make(*, follow_up: bool) -> Hands:
        if not contexts:
            store = ClinicStore.open(folder)
            context = AppContext(store, folder, cameras=NoCameras(), tracker_factory=default_tracker)
            user = store.users.authenticate(USER, PASSWORD)
            assert user is not None
            context.log_in(user)
            contexts.append(context)
        context = contexts[0]
        name = "Müller" if follow_up else "Nováková"
        patient = context.store.patients.search(name)[0].patient
        page = VisitPage(context, patient.id, frames=2)
        pages.append(page)
        page.resize(1440, 900)
        page.show()
        qtbot.waitExposed(page)
        hands = Hands(page, context, qtbot)
        hands.wait()
        return hands

    yield make
    for page in pages:
        page.leave()
        page.close()
        page.deleteLater()
    for context in contexts:
        context.tasks.shut_down()
        QApplication.processEvents()
        context.store.close()


def capture_both(hands: Hands, world: World, body: str) -> None:
    hands.open(world.root / "psi")
    hands.click("stance_primary")
    assert hands.state is State.STANCE_DONE
    hands.click("stance_primary")
    hands.open(world.root / body)
    hands.click("capture_primary")
    assert hands.state is State.CAPTURE_DONE


def test_a_first_visit_by_mouse(open_page: Open, world: World, tmp_path: Path) -> None:
    hands = open_page(follow_up=False)
    assert hands.find("visit_subtitle").text() == "Visit 1, first visit"
    assert not hands.find("stance_primary").isEnabled(), "without a camera there is nothing to capture"

    hands.open(world.root / "down")
    hands.click("stance_primary")
    assert hands.state is State.STANCE_CHECK
    assert "elbow" in hands.page.captures.stance.corrections.text()
    capture_both(hands, world, "A1")
    assert "15 of 15 joints" in hands.find("capture_photo_caption").text()

    hands.click("capture_primary")
    assert hands.state is State.MARK
    first, second = list(seen(world.captures["A1"]).values())[:2]
    hands.click_photo("lesion_photo", first)
    hands.click_photo("lesion_photo", second)
    lesions = hands.page.session.snapshot.shown_lesions()
    assert [x.number for x in lesions] == [1, 2]
    assert hands.page.lesions.screen.list.selected() == str(lesions[1].id)

    hands.click_photo("lesion_photo", first)
    assert hands.page.lesions.screen.list.selected() == str(lesions[0].id), "a click on a mark selects it"
    hands.find("site_search").setFocus()
    QTest.keyClicks(hands.find("site_search"), find_site("45981001").name)
    QTest.keyClick(hands.find("site_search"), Qt.Key.Key_Return)
    QTest.keyClicks(hands.find("lesion_note"), "irregular")
    QTest.keyClick(hands.find("lesion_note"), Qt.Key.Key_Return)
    hands.page.attach_dermoscopy([world.root / "dermoscopy.png"])
    stored = hands.context.store.lesions.get(lesions[0].id)
    assert stored.site is not None
    assert stored.site.code == "45981001"
    assert stored.note == "irregular"
    assert len(hands.context.store.dermoscopy.for_lesion(lesions[0].id)) == 1

    hands.click("lesions_primary")
    hands.find("visit_note").setPlainText("All quiet.")
    hands.click("review_primary")
    assert hands.state is State.CLOSED
    assert hands.page.session.snapshot.visit.note == "All quiet."
    report = tmp_path / "report.pdf"
    hands.page.export_report(report)
    hands.wait()
    assert report.read_bytes().startswith(b"%PDF")
    finished = []
    hands.page.finished.connect(lambda: finished.append(True))
    hands.click("review_secondary")
    assert finished


def test_a_follow_up_by_mouse(open_page: Open, world: World) -> None:
    hands = open_page(follow_up=True)
    assert hands.find("visit_subtitle").text() == "Visit 2, follow-up"
    capture_both(hands, world, "A2")
    assert hands.find("capture_primary").text() == "Find 3 lesions"
    hands.click("capture_primary")
    assert hands.state is State.CHECK
    session, screen = hands.page.session, hands.page.lesions.screen
    ids = [int(i) for i in screen.list.ids()]
    assert len(ids) == 3
    status = screen.list.item(0, 2).text()
    assert re.fullmatch(r"Proposed, ±\d+( x \d+)? mm(: check)?", status), status
    assert hands.page.lesions.selected_id == ids[0], "the first one that waits is at hand"

    hands.click("pane_compare")
    assert {m.id for m in screen.previous.markers()} == {str(i) for i in ids}
    hands.click("confirm_lesion")
    confirmed = session.snapshot.in_force(ids[0])
    assert confirmed is not None
    assert confirmed.decision == "confirmed"
    assert hands.page.lesions.selected_id == ids[1], "the next one that waits is at hand"

    hands.click("pane_photo")
    marker = next(m for m in screen.photo.markers() if m.id == str(ids[1]))
    hands.drag_photo("lesion_photo", (marker.x, marker.y), (marker.x + 2, marker.y - 6))
    corrected = session.snapshot.in_force(ids[1])
    assert corrected is not None
    assert corrected.decision == "corrected"
    assert corrected.decided_by == hands.context.user_id
    assert corrected.proposed_pixel == pytest.approx((marker.x, marker.y))

    hands.click("lesions_primary")
    hands.click("review_primary")
    assert "confirm each place" in hands.banner
    assert hands.state is State.REVIEW
    hands.click("review_secondary")
    hands.page.lesions.select(ids[2])
    hands.click("lesion_not_in_view")
    assert session.status(ids[2]).label == "Not in view"

    hands.click("mark_new_lesion")
    free = list(seen(world.captures["A2"]).values())[-1]
    hands.click_photo("lesion_photo", free)
    assert len(session.snapshot.shown_lesions()) == 4
    hands.click("lesions_primary")
    hands.click("review_primary")
    assert hands.state is State.CLOSED


@pytest.mark.parametrize(
    ("folder", "word"),
    [
        ("empty", "body"),
        ("truncated", "depth"),
        ("missing", "missing"),
        ("sizes", "colo"),
        ("calibration", "intrinsics"),
        ("units", "unit"),
    ],
)
def test_a_capture_that_cannot_be_used_is_told_in_words_and_not_stored(
    open_page: Open, world: World, folder: str, word: str
) -> None:
    hands = open_page(follow_up=False)
    hands.open(world.root / folder)
    if hands.find("stance_primary").isEnabled():
        hands.click("stance_primary")
    assert word in hands.banner.lower()
    assert "Traceback" not in hands.banner
    assert hands.find("banner_advice").text(), "the message says what to do"
    assert hands.state is State.STANCE
    assert hands.page.session.is_empty


def test_clicks_beside_the_body_and_files_that_are_no_image_are_refused_in_words(
    open_page: Open, world: World
) -> None:
    hands = open_page(follow_up=False)
    capture_both(hands, world, "A1")
    hands.click("capture_primary")
    hands.click_photo("lesion_photo", (120.0, 200.0))
    assert "not on the body" in hands.banner
    assert hands.page.session.snapshot.facts().lesions == 0

    hands.click_photo("lesion_photo", next(iter(seen(world.captures["A1"]).values())))
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile(str(world.root / "holiday.jpg"))])
    copy = Qt.DropAction.CopyAction
    drop = QDropEvent(QPointF(5, 5), copy, mime, LEFT, Qt.KeyboardModifier.NoModifier)
    hands.page.lesions.screen.details.strip.dropEvent(drop)
    assert "holiday.jpg" in hands.banner
    assert not hands.page.session.snapshot.dermoscopy


def test_cancelling_keeps_the_visit_and_a_reopened_visit_goes_on(open_page: Open, world: World) -> None:
    hands = open_page(follow_up=False)
    hands.open(world.root / "psi")
    QTest.mouseClick(hands.find("stance_primary"), LEFT)
    assert hands.page.overlay.task is not None
    hands.page.overlay.task.cancel()
    hands.wait()
    assert hands.state is State.STANCE
    assert "Cancelled" in hands.banner
    assert hands.page.session.is_empty

    capture_both(hands, world, "A1")
    hands.click("capture_primary")
    first, second = list(seen(world.captures["A1"]).values())[:2]
    hands.click_photo("lesion_photo", first)
    visit_id = hands.page.session.visit_id
    hands.page.leave()

    again = open_page(follow_up=False)
    assert again.page.session.visit_id == visit_id
    assert again.state is State.MARK
    again.click_photo("lesion_photo", second)
    assert again.page.session.snapshot.facts().lesions == 2


def test_an_empty_visit_is_not_kept_and_a_discarded_one_is_gone(open_page: Open, world: World) -> None:
    hands = open_page(follow_up=False)
    patient_id = hands.page.session.snapshot.patient.id
    hands.click("visit_back")
    assert hands.context.store.visits.list(patient_id) == []

    hands = open_page(follow_up=False)
    hands.open(world.root / "psi")
    hands.click("stance_primary")
    hands.click("discard_visit")
    assert "Discard this visit?" in hands.banner
    hands.click("banner_action_discard")
    assert hands.context.store.visits.list(patient_id) == []


def test_the_lesion_step_has_one_filled_button_no_cut_text_one_selection_and_an_explanation(
    open_page: Open, world: World
) -> None:
    hands = open_page(follow_up=True)
    capture_both(hands, world, "A2")
    for step in ("capture_primary", "lesions_primary"):
        shown = [w for w in hands.page.findChildren(QWidget) if w.isVisible()]
        assert [w.objectName() for w in shown if w.property("class") == "primary"] == [step]
        if step == "capture_primary":
            hands.click(step)
    assert hands.page.minimumSizeHint().height() <= 900
    for label in hands.page.findChildren(QLabel):
        if label.isVisible() and label.text() and not label.wordWrap():
            assert label.width() >= label.sizeHint().width() - 1, label.text()

    screen = hands.page.lesions.screen
    other = screen.list.ids()[1]
    screen.body.lesion_clicked.emit(other)
    assert screen.list.selected() == other
    assert screen.photo.selected() == other
    hands.click("explain_lesion")
    sheet = hands.page.window().findChild(QWidget, "explain_sheet")
    assert sheet is not None
    assert sheet.isVisible()
    assert len(sheet.findChildren(PhotoView)) == 5
    sheet.close_sheet()


def test_the_demonstration_looks_through_the_simulated_camera_at_once(
    world: World, tmp_path: Path, qapp: QApplication, qtbot: QtBot
) -> None:
    apply_theme(qapp)
    shutil.copytree(world.root / "clinic", tmp_path / "clinic")
    store = ClinicStore.open(tmp_path / "clinic")
    context = AppContext(
        store, store.folder, cameras=DemoCameras(), tracker_factory=default_tracker, demonstration=True
    )
    user = store.users.authenticate(USER, PASSWORD)
    assert user is not None
    context.log_in(user)
    page = VisitPage(context, store.patients.search("Nováková")[0].patient.id)
    page.resize(1440, 900)
    page.show()
    screen = page.captures.stance
    qtbot.waitUntil(lambda: screen.live_view.image_size != (0, 0), timeout=60_000)
    assert screen.stance_box.isVisible()
    assert screen.stance_box.currentData() == "psi"
    assert screen.panel.primary.isEnabled()
    page.leave()
    page.close()
    page.deleteLater()
    context.tasks.shut_down()
    QApplication.processEvents()
    store.close()


def test_a_joint_of_a_stored_capture_is_corrected_by_mouse(open_page: Open, world: World) -> None:
    hands = open_page(follow_up=False)
    capture_both(hands, world, "A1")
    session, screen = hands.page.session, hands.page.captures.capture
    number = session.snapshot.views["front"]
    hands.click("capture_correct")
    at = screen.joints.joint_position("left_knee").toPoint()
    port = screen.photo.viewport()
    QTest.mousePress(port, Qt.MouseButton.LeftButton, pos=at)
    for step in (4, 9, 14):
        QTest.mouseMove(port, at + QPoint(2, step))
    QTest.mouseRelease(port, Qt.MouseButton.LeftButton, pos=at + QPoint(2, 14))
    hands.click("capture_correct")
    hands.wait()
    assert {a.name: a.source for a in hands.context.store.anchors.list(number)}["left_knee"] == "hand"
    assert session.analysed(number).skeleton.joints["left_knee"].source == "hand"
    assert not screen.joints.editing
