"""The 3D body under a real mouse: what it shows, what a click means, how often it draws, how it ends."""

from __future__ import annotations

import gc
import time
import weakref

import numpy as np
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton, QTabWidget, QToolButton, QWidget

from app.widgets.body_view import BodyLesion, BodyView, surface_colors
from tests.gui.conftest import Show, World

LEFT = Qt.MouseButton.LeftButton
CENTER = np.array([0.05, 0.1, 2.4])
HALF = np.array([0.25, 0.8, 0.15])


def body(rows: int = 90, columns: int = 90) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A closed ellipsoid of the size of a body, before the camera."""
    polar = np.linspace(0.02, np.pi - 0.02, rows)
    around = np.linspace(0, 2 * np.pi, columns, endpoint=False)
    a, b = np.meshgrid(polar, around, indexing="ij")
    ring = np.stack([np.sin(a) * np.cos(b), -np.cos(a), np.sin(a) * np.sin(b)], axis=-1).reshape(-1, 3)
    poles = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    p, q = i * columns + j, i * columns + (j + 1) % columns
    quads = [np.stack([p, q, p + columns], -1), np.stack([q, q + columns, p + columns], -1)]
    top, bottom, k = rows * columns, rows * columns + 1, np.arange(columns)
    last = (rows - 1) * columns
    caps = [
        np.stack([np.full(columns, top), (k + 1) % columns, k], -1),
        np.stack([np.full(columns, bottom), last + k, last + (k + 1) % columns], -1),
    ]
    triangles = np.concatenate([t.reshape(-1, 3) for t in (*quads, *caps)])
    return CENTER + HALF * np.concatenate([ring, poles]), triangles.astype(np.int32)


def on_skin(x: float, y: float, *, front: bool = True) -> tuple[float, float, float]:
    """A point of the ellipsoid: ``x`` and ``y`` as shares of its half axes."""
    z = np.sqrt(1 - x * x - y * y) * (-1 if front else 1)
    px, py, pz = CENTER + HALF * np.array([x, y, z])
    return float(px), float(py), float(pz)


LESIONS = [
    BodyLesion("11", "1", on_skin(-0.4, -0.5)),
    BodyLesion("12", "2", on_skin(0.5, 0.1)),
    BodyLesion("13", "3", on_skin(0.0, 0.6)),
    BodyLesion("14", "4", on_skin(0.1, -0.2, front=False)),
]


class Heard:
    """What a body view emitted."""

    def __init__(self, view: BodyView) -> None:
        self.events: list[tuple[object, ...]] = []
        for name in ("lesion_clicked", "lesion_activated", "placed", "background_clicked"):
            getattr(view, name).connect(lambda *values, n=name: self.events.append((n, *values)))

    def take(self) -> list[tuple[object, ...]]:
        events, self.events = self.events, []
        return events


@pytest.fixture
def view(show: Show) -> BodyView:
    made = show(BodyView(), (700, 760))
    made.set_surface(*body())
    made.set_lesions(LESIONS)
    QTest.qWait(50)
    yield made
    made.close_view()


def canvas(view: BodyView) -> QWidget:
    found = view.canvas()
    assert found is not None
    return found


def place(view: BodyView, lesion_id: str) -> QPoint:
    found = view.display_position(lesion_id)
    assert found is not None, f"lesion {lesion_id} is hidden"
    return found


def picture(view: BodyView) -> NDArray[np.uint8]:
    image = (
        canvas(view)
        .grabFramebuffer()
        .convertToFormat(  # type: ignore[attr-defined]
            canvas(view).grabFramebuffer().Format.Format_RGB888  # type: ignore[attr-defined]
        )
    )
    data = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    return data[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()


def test_the_body_is_drawn_in_its_colours_with_the_markers_in_front_of_it(show: Show) -> None:
    view = show(BodyView(), (700, 760))
    empty = picture(view)
    assert np.ptp(empty.reshape(-1, 3), axis=0).max() < 12, "nothing is drawn before there is a body"
    vertices, triangles = body()
    view.set_surface(vertices, triangles, np.tile(np.array([60, 130, 70], np.uint8), (len(vertices), 1)))
    view.set_lesions(LESIONS)
    QTest.qWait(50)
    shown = picture(view)
    middle = shown[shown.shape[0] // 2, shown.shape[1] // 2].astype(int)
    assert middle[1] > middle[0] + 20
    assert middle[1] > middle[2] + 20
    assert np.array_equal(shown[5, 5], empty[5, 5])
    spot = place(view, "12")
    around = shown[spot.y() - 14 : spot.y() + 15, spot.x() - 14 : spot.x() + 15].reshape(-1, 3).astype(int)
    assert (around.min(axis=1) > 200).any(), "the ring has a white border"
    view.clear()
    QTest.qWait(20)
    assert np.array_equal(picture(view), empty)
    view.close_view()


def test_markers_on_the_far_side_are_hidden_until_the_body_is_turned(view: BodyView) -> None:
    assert view.display_position("14") is None
    assert view.display_position("unknown") is None
    QTest.mouseClick(view.findChild(QPushButton, "body_view_back"), LEFT)
    assert [view.display_position(x.id) is not None for x in LESIONS] == [False, False, False, True]
    QTest.mouseClick(view.findChild(QPushButton, "body_view_front"), LEFT)
    assert [view.display_position(x.id) is not None for x in LESIONS] == [True, True, True, False]


def test_left_and_right_are_the_patients_own(view: BodyView) -> None:
    assert place(view, "12").x() > canvas(view).width() / 2 > place(view, "11").x()
    QTest.mouseClick(view.findChild(QPushButton, "body_view_left"), LEFT)
    assert view.display_position("12") is not None, "+x of the camera is the patient's left"
    assert view.display_position("11") is None


def test_a_click_picks_the_right_lesion_from_every_side(view: BodyView) -> None:
    heard = Heard(view)
    for side in ("front", "left", "right", "back"):
        view.set_view(side)
        for lesion in LESIONS:
            spot = view.display_position(lesion.id)
            if spot is not None:
                QTest.mouseClick(canvas(view), LEFT, pos=spot)
                assert heard.take() == [("lesion_clicked", lesion.id)], (side, lesion.id)
                assert view.selected() == lesion.id
    view.turn_to("14")
    center = QPoint(canvas(view).width() // 2, canvas(view).height() // 2)
    assert (place(view, "14") - center).manhattanLength() < 12
    QTest.mouseDClick(canvas(view), LEFT, pos=place(view, "14"))
    assert ("lesion_activated", "14") in heard.take()


def test_selecting_by_program_does_not_speak_and_unknown_lesions_select_nothing(view: BodyView) -> None:
    heard = Heard(view)
    view.set_selected("12")
    assert view.selected() == "12"
    view.set_lesions(LESIONS[:1])
    assert view.selected() is None
    view.set_selected("unknown")
    assert view.selected() is None
    assert heard.take() == []


def test_a_click_on_the_skin_places_there_and_only_when_asked_to(view: BodyView) -> None:
    heard = Heard(view)
    view.set_selected("13")
    spot = place(view, "13") + QPoint(60, 30)
    QTest.mouseClick(canvas(view), LEFT, pos=spot)
    assert heard.take() == [("background_clicked",)]
    view.set_placing(True)
    QTest.mouseClick(canvas(view), LEFT, pos=spot)
    ((kind, *point),) = heard.take()
    assert kind == "placed"
    assert (((np.array(point) - CENTER) / HALF) ** 2).sum() == pytest.approx(1, abs=0.01), "it is on the skin"
    assert point[2] < CENTER[2], "and on the near side"
    view.set_lesions([BodyLesion("new", "5", (point[0], point[1], point[2]))])
    assert (place(view, "new") - spot).manhattanLength() <= 6, "and under the cursor"
    QTest.mouseClick(canvas(view), LEFT, pos=QPoint(4, 4))
    assert heard.take() == [("background_clicked",)]


def test_a_drag_turns_the_body_and_is_no_click(view: BodyView) -> None:
    heard = Heard(view)
    start = QPoint(350, 300)
    before = place(view, "13")
    QTest.mousePress(canvas(view), LEFT, pos=start)
    for i in range(1, 6):
        QTest.mouseMove(canvas(view), start + QPoint(8 * i, 0))
    QTest.mouseRelease(canvas(view), LEFT, pos=start + QPoint(40, 0))
    after = place(view, "13")
    assert after.x() > before.x(), "the near side follows the hand"
    assert abs(after.y() - before.y()) < 12
    assert heard.take() == []


def test_the_wheel_and_the_buttons_zoom(view: BodyView) -> None:
    def spread() -> float:
        return float((place(view, "13") - place(view, "11")).manhattanLength())

    first = spread()
    QTest.mouseClick(view.findChild(QToolButton, "body_zoom_in"), LEFT)
    second = spread()
    assert second > 1.1 * first
    at = QPointF(300, 300)
    none = Qt.MouseButton.NoButton
    event = QWheelEvent(
        at,
        QPointF(canvas(view).mapToGlobal(at.toPoint())),
        QPoint(),
        QPoint(0, -240),
        none,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(canvas(view), event)
    assert spread() < second


class Renders:
    """Counts the frames VTK draws."""

    def __init__(self, view: BodyView) -> None:
        self.count = 0
        self._window = canvas(view).render_window  # type: ignore[attr-defined]
        self._tag = self._window.AddObserver("StartEvent", self._on_start)

    def _on_start(self, *_: object) -> None:
        self.count += 1

    def stop(self) -> int:
        self._window.RemoveObserver(self._tag)
        return self.count


def test_while_dragging_every_painted_frame_is_rendered_once(view: BodyView) -> None:
    view.set_surface(*body(150, 110))
    QTest.qWait(100)
    paints: list[float] = []
    canvas(view).frameSwapped.connect(lambda: paints.append(time.monotonic()))  # type: ignore[attr-defined]
    start = QPoint(350, 300)
    renders = Renders(view)
    QTest.mousePress(canvas(view), LEFT, pos=start)
    for i in range(1, 13):
        for step in range(4):
            QTest.mouseMove(canvas(view), start + QPoint(4 * i + step, i))
        QApplication.processEvents()
    moves = renders.count
    QTest.mouseRelease(canvas(view), LEFT, pos=start + QPoint(51, 12))
    QTest.qWait(100)
    total = renders.stop()
    assert 1 <= moves <= 12, "many moves between two frames cost one render"
    assert total <= moves + 2
    assert total <= len(paints) + 1, "nothing is rendered that is not painted"


def test_a_body_at_rest_is_not_drawn_again(view: BodyView) -> None:
    QTest.qWait(300)
    renders = Renders(view)
    QTest.qWait(300)
    assert renders.stop() == 0


def test_while_it_turns_a_light_mesh_is_shown_and_then_the_full_one(view: BodyView) -> None:
    def triangles() -> int:
        actors = canvas(view).renderer.GetActors()  # type: ignore[attr-defined]
        return sum(
            a.GetMapper().GetInput().GetNumberOfCells()
            for a in (actors.GetItemAsObject(i) for i in range(actors.GetNumberOfItems()))
            if a.GetVisibility()
        )

    vertices, faces = body(150, 110)
    view.set_surface(vertices, faces)
    full = len(faces)
    assert triangles() == full
    QTest.mousePress(canvas(view), LEFT, pos=QPoint(350, 300))
    QTest.mouseMove(canvas(view), QPoint(380, 300))
    assert triangles() <= 30_000
    QTest.mouseRelease(canvas(view), LEFT, pos=QPoint(380, 300))
    assert triangles() == full


def test_what_was_set_before_the_view_was_shown_is_there_when_it_is(show: Show) -> None:
    tabs = QTabWidget()
    view = BodyView()
    tabs.addTab(QWidget(), "Photo")
    tabs.addTab(view, "Body")
    view.set_surface(*body(60, 60))
    view.set_lesions(LESIONS)
    view.set_selected("11")
    show(tabs, (700, 760))
    assert view.canvas() is None, "no OpenGL before anyone looks"
    tabs.setCurrentIndex(1)
    QTest.qWait(50)
    assert place(view, "11")
    assert view.selected() == "11"
    first = view.canvas()
    for index in (0, 1, 0, 1):
        tabs.setCurrentIndex(index)
        QTest.qWait(20)
    assert view.canvas() is first, "hiding keeps it"
    view.close_view()


@pytest.mark.parametrize("moment", ["at rest", "in a drag", "after the wheel", "never shown", "twice"])
def test_closing_is_safe_at_any_moment_and_frees_opengl(show: Show, moment: str) -> None:
    view = BodyView()
    if moment != "never shown":
        show(view, (500, 500))
        view.set_surface(*(body(150, 110) if moment == "in a drag" else body(40, 40)))
        view.set_lesions(LESIONS)
        QApplication.processEvents()
        window = weakref.ref(canvas(view).render_window)  # type: ignore[attr-defined]
    if moment == "in a drag":
        QTest.mousePress(canvas(view), LEFT, pos=QPoint(250, 200))
        QTest.mouseMove(canvas(view), QPoint(280, 200))
    if moment == "after the wheel":
        canvas(view)._calm.start()  # type: ignore[attr-defined]
    view.close_view()
    if moment == "twice":
        view.close_view()
    view.set_surface(*body(20, 20))
    view.set_lesions(LESIONS)
    view.set_view("back")
    view.turn_to("11")
    view.set_placing(True)
    QTest.qWait(250)
    assert view.canvas() is None
    assert view.display_position("11") is None
    if moment != "never shown":
        QApplication.processEvents()
        gc.collect()
        assert window() is None
    view.deleteLater()


def test_closing_a_window_that_is_deleted_on_close_frees_opengl(show: Show) -> None:
    window = QTabWidget()
    window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    view = BodyView()
    window.addTab(view, "Body")
    show(window, (500, 500))
    view.set_surface(*body(40, 40))
    QTest.qWait(30)
    assert view.canvas() is not None
    window.close()
    assert view.canvas() is None


def test_two_bodies_are_shown_and_closed_one_after_the_other(show: Show) -> None:
    first, second = show(BodyView(), (400, 400)), show(BodyView(), (400, 400))
    for view in (first, second):
        view.set_surface(*body(60, 60))
        view.set_lesions(LESIONS)
    QTest.qWait(50)
    first.close_view()
    QTest.qWait(30)
    heard = Heard(second)
    QTest.mouseClick(canvas(second), LEFT, pos=place(second, "12"))
    assert heard.take() == [("lesion_clicked", "12")]
    second.close_view()


def test_colours_come_from_the_photo(world: World) -> None:
    capture = world.captures["A1"].capture
    assert capture.color is not None
    points = np.array([p for p in world.captures["A1"].truth.mole_points_m if np.isfinite(p).all()])
    colors = surface_colors(capture, points)
    assert colors is not None
    u, v = np.round(capture.rig.project_to_picture(points[:1])[0]).astype(int)
    height, width = capture.color.shape[:2]
    if 0 <= u < width and 0 <= v < height:
        assert np.array_equal(colors[0], capture.color[v, u])
    assert len(colors) == len(points)
