"""The photo with its markers under a real mouse and keyboard."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.theme import palette
from app.widgets.markers import Marker
from app.widgets.photo_view import PhotoView
from tests.gui.conftest import Show

LEFT = Qt.MouseButton.LeftButton
WIDTH, HEIGHT = 400, 300
PLACES = {"1": (100.0, 80.0), "2": (300.0, 90.0), "3": (200.0, 220.0)}


class Heard:
    """What a photo view emitted."""

    def __init__(self, view: PhotoView) -> None:
        self.events: list[tuple[object, ...]] = []
        for name in (
            "marker_clicked",
            "marker_activated",
            "marker_moved",
            "placed",
            "background_clicked",
            "delete_requested",
        ):
            getattr(view, name).connect(lambda *values, n=name: self.events.append((n, *values)))

    def take(self) -> list[tuple[object, ...]]:
        events, self.events = self.events, []
        return events


@pytest.fixture
def view(show: Show) -> PhotoView:
    photo = PhotoView()
    photo.set_image(np.full((HEIGHT, WIDTH, 3), (200, 170, 150), np.uint8))
    photo.set_markers([Marker(name, name, x, y) for name, (x, y) in PLACES.items()])
    return show(photo, (800, 640))


def turn_wheel(view: PhotoView, at: QPoint, steps: int) -> None:
    place = QPointF(at)
    event = QWheelEvent(
        place,
        QPointF(view.viewport().mapToGlobal(at)),
        QPoint(),
        QPoint(0, 120 * steps),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(view.viewport(), event)


def drag(view: PhotoView, start: QPoint, end: QPoint, *, release: bool = True) -> None:
    QTest.mousePress(view.viewport(), LEFT, pos=start)
    for share in (0.3, 0.7, 1.0):
        QTest.mouseMove(view.viewport(), start + (end - start) * share)
    if release:
        QTest.mouseRelease(view.viewport(), LEFT, pos=end)
    QApplication.processEvents()


def test_the_whole_picture_is_shown_and_stays_so_when_the_window_changes(view: PhotoView) -> None:
    for size in ((800, 640), (500, 700)):
        view.resize(*size)
        QApplication.processEvents()
        corners = [view.viewport_position(0, 0), view.viewport_position(WIDTH - 1, HEIGHT - 1)]
        assert all(view.viewport().rect().contains(c) for c in corners)
        assert view.view_state().zoom == pytest.approx(1)
        assert (view.view_state().x, view.view_state().y) == pytest.approx((0.5, 0.5), abs=0.01)


def test_a_zoomed_picture_keeps_its_middle_and_its_zoom_when_the_window_changes(view: PhotoView) -> None:
    view.center_on(100, 80, 5)
    for size in ((1000, 400), (420, 600)):
        view.resize(*size)
        QApplication.processEvents()
        assert view.view_state().zoom == pytest.approx(5)
        middle = QPoint(view.viewport().width() // 2, view.viewport().height() // 2)
        assert view.image_position(middle) == pytest.approx((100, 80), abs=1)


@pytest.mark.parametrize("steps", [1, 5, -2])
def test_the_wheel_zooms_around_the_cursor(view: PhotoView, steps: int) -> None:
    at = QPoint(530, 170)
    before = view.image_position(at)
    turn_wheel(view, at, steps)
    after = view.image_position(at)
    assert view.view_state().zoom == pytest.approx(max(1.25**steps, 0.5))
    scale = view.transform().m11()
    assert math.dist(before, after) * scale < 1.5, "the skin under the cursor stays there, to a pixel"


def test_the_zoom_has_ends(view: PhotoView) -> None:
    for _ in range(6):
        turn_wheel(view, QPoint(400, 300), 10)
    assert view.view_state().zoom == pytest.approx(40)
    for _ in range(6):
        turn_wheel(view, QPoint(400, 300), -10)
    assert view.view_state().zoom == pytest.approx(0.5)


def test_dragging_the_photo_moves_it_with_the_hand_and_marks_nothing(view: PhotoView) -> None:
    heard = Heard(view)
    view.set_placing(True)
    view.center_on(200, 150, 3)
    start, end = view.viewport_position(180, 150), view.viewport_position(180, 150) + QPoint(120, -60)
    before = view.image_position(start)
    drag(view, start, end)
    assert view.image_position(end) == pytest.approx(before, abs=1)
    assert heard.take() == []


def test_a_click_places_at_that_pixel_and_only_on_the_picture(view: PhotoView) -> None:
    heard = Heard(view)
    view.center_on(150.0, 140.0, 8)
    QTest.mouseClick(view.viewport(), LEFT, pos=view.viewport_position(150, 140))
    assert heard.take() == [("background_clicked",)], "a click marks nothing unless marking is on"
    view.set_placing(True)
    QTest.mouseClick(view.viewport(), LEFT, pos=view.viewport_position(150, 140))
    ((kind, x, y),) = heard.take()
    assert kind == "placed"
    assert (x, y) == pytest.approx((150, 140), abs=0.1)
    QTest.mouseClick(view.viewport(), Qt.MouseButton.RightButton, pos=view.viewport_position(150, 140))
    assert heard.take() == []
    view.fit()
    QTest.mouseClick(view.viewport(), LEFT, pos=QPoint(400, 3))
    assert heard.take() == [("background_clicked",)]


def test_a_click_on_a_marker_selects_it_alone_even_while_marking(view: PhotoView) -> None:
    heard = Heard(view)
    view.set_placing(True)
    for name, place in PLACES.items():
        QTest.mouseClick(view.viewport(), LEFT, pos=view.viewport_position(*place))
        assert view.selected() == name
    assert heard.take() == [("marker_clicked", name) for name in PLACES]
    badge = view.viewport_position(*PLACES["1"]) + QPoint(17, -17)
    QTest.mouseClick(view.viewport(), LEFT, pos=badge)
    assert heard.take() == [("marker_clicked", "1")], "the number is part of the marker"
    QTest.mouseDClick(view.viewport(), LEFT, pos=view.viewport_position(*PLACES["2"]))
    assert ("marker_activated", "2") in heard.take()


def test_of_two_markers_that_touch_the_nearer_one_is_taken(view: PhotoView) -> None:
    view.set_markers([Marker("a", "1", 200, 150), Marker("b", "2", 203, 150)])
    view.center_on(200, 150, 2)
    for name, x in (("a", 199), ("b", 204)):
        assert view.marker_at(view.viewport_position(x, 150)) == name


def test_selecting_by_program_does_not_speak_and_the_selection_outlives_new_markers(view: PhotoView) -> None:
    heard = Heard(view)
    view.set_selected("2")
    view.set_markers([Marker("2", "2", 301, 90), Marker("9", "9", 10, 10)])
    assert view.selected() == "2"
    view.set_markers([Marker("9", "9", 10, 10)])
    assert view.selected() is None
    view.set_selected("unknown")
    assert view.selected() is None
    assert heard.take() == []


def test_a_dragged_marker_leaves_a_ghost_where_it_was_proposed(view: PhotoView) -> None:
    heard = Heard(view)
    view.set_movable(True)
    start, goal = PLACES["1"], (130.0, 120.0)
    a, b = view.viewport_position(*start), view.viewport_position(*goal)
    drag(view, a, b, release=False)
    during = view.grab().toImage()
    assert near(during, view.viewport_position(*start), palette.AMBER), "the ghost shows during the drag"
    QTest.mouseRelease(view.viewport(), LEFT, pos=b)
    assert heard.take()[-1][0:2] == ("marker_moved", "1")
    moved = next(m for m in view.markers() if m.id == "1")
    assert (moved.x, moved.y) == pytest.approx(goal, abs=0.6)
    assert moved.ghost == start
    drag(view, b, b + QPoint(40, 0))
    again = next(m for m in view.markers() if m.id == "1")
    assert again.x > moved.x
    assert again.ghost == start, "the ghost stays at the first proposal"


def near(image: object, place: QPoint, color: str, reach: int = 14) -> bool:
    """Whether a colour is painted near a place of a grabbed picture."""
    from PySide6.QtGui import QColor, QImage

    assert isinstance(image, QImage)
    wanted = QColor(color)
    return any(
        abs(c.red() - wanted.red()) + abs(c.green() - wanted.green()) + abs(c.blue() - wanted.blue()) < 60
        for dx in range(-reach, reach + 1)
        for dy in range(-reach, reach + 1)
        for c in [image.pixelColor(place + QPoint(dx, dy))]
    )


def test_a_marker_that_may_not_move_does_not(view: PhotoView) -> None:
    heard = Heard(view)
    a = view.viewport_position(*PLACES["1"])
    drag(view, a, a + QPoint(60, 40))
    view.set_movable(True)
    view.set_markers([Marker("1", "1", *PLACES["1"], movable=False)])
    a = view.viewport_position(*PLACES["1"])
    drag(view, a, a + QPoint(60, 40))
    assert all(event[0] != "marker_moved" for event in heard.take())
    assert (view.markers()[0].x, view.markers()[0].y) == PLACES["1"]


def test_escape_ends_a_drag_and_a_drop_beside_the_picture_does_not_count(view: PhotoView) -> None:
    heard = Heard(view)
    view.set_movable(True)
    a = view.viewport_position(*PLACES["1"])
    drag(view, a, a + QPoint(60, 40), release=False)
    QTest.keyClick(view, Qt.Key.Key_Escape)
    QTest.mouseRelease(view.viewport(), LEFT, pos=a + QPoint(60, 40))
    drag(view, a, QPoint(a.x(), 2))
    assert all(event[0] != "marker_moved" for event in heard.take())
    assert (view.markers()[0].x, view.markers()[0].y) == PLACES["1"]
    assert view.markers()[0].ghost is None


def test_the_keyboard_does_what_the_mouse_does(view: PhotoView) -> None:
    heard = Heard(view)
    key = Qt.Key
    for _ in range(4):
        QTest.keyClick(view, key.Key_N)
    QTest.keyClick(view, key.Key_P)
    assert heard.take() == [("marker_clicked", name) for name in ("1", "2", "3", "1", "3")]
    QTest.keyClick(view, key.Key_Return)
    QTest.keyClick(view, key.Key_Delete)
    assert heard.take() == [("marker_activated", "3"), ("delete_requested", "3")]
    QTest.keyClick(view, key.Key_Plus)
    QTest.keyClick(view, key.Key_Plus)
    QTest.keyClick(view, key.Key_Minus)
    assert view.view_state().zoom == pytest.approx(1.25)
    x = view.view_state().x
    QTest.keyClick(view, key.Key_Right)
    assert view.view_state().x > x
    QTest.keyClick(view, key.Key_0)
    assert view.view_state().zoom == pytest.approx(1)


def test_going_to_a_marker_that_is_out_of_sight_brings_it_into_view(view: PhotoView) -> None:
    view.center_on(*PLACES["1"], 12)
    assert not view.viewport().rect().contains(view.viewport_position(*PLACES["3"]))
    view.set_selected("2")
    QTest.keyClick(view, Qt.Key.Key_N)
    assert view.viewport().rect().contains(view.viewport_position(*PLACES["3"]))


def test_a_view_without_a_picture_takes_clicks_keys_and_the_wheel_calmly(show: Show) -> None:
    view = show(PhotoView(), (400, 300))
    heard = Heard(view)
    view.set_placing(True)
    QTest.mouseClick(view.viewport(), LEFT, pos=QPoint(200, 150))
    turn_wheel(view, QPoint(200, 150), 3)
    for key in (Qt.Key.Key_Plus, Qt.Key.Key_N, Qt.Key.Key_0, Qt.Key.Key_Delete, Qt.Key.Key_Left):
        QTest.keyClick(view, key)
    assert view.image_size == (0, 0)
    assert heard.take() == [("background_clicked",)]


def test_a_scale_bar_of_a_round_length_is_drawn_where_the_scale_is_known(view: PhotoView) -> None:
    corner = QPoint(40, view.viewport().height() - 30)
    without = view.grab().toImage().pixelColor(corner)
    view.set_scale_mm(0.1)
    QApplication.processEvents()
    assert view.grab().toImage().pixelColor(corner) != without
