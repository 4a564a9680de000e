"""Two pictures of the same lesion: one zoom for both, laid over each other, in turn."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QSlider, QTabWidget, QWidget

from app.widgets.compare_view import FLICKER_MS, CompareView
from tests.gui.conftest import Show

LEFT = Qt.MouseButton.LeftButton
DARK, LIGHT = (60, 60, 60), (220, 220, 220)


def plain(color: tuple[int, int, int], width: int, height: int) -> np.ndarray:
    return np.full((height, width, 3), color, np.uint8)


@pytest.fixture
def view(show: Show) -> CompareView:
    made = CompareView()
    made.set_pictures(plain(DARK, 400, 300), plain(LIGHT, 800, 600), "Visit 1", "Visit 2")
    show(made, (1100, 640))
    QTest.qWait(20)
    return made


def press(view: CompareView, name: str) -> None:
    QTest.mouseClick(view.findChild(QPushButton, f"compare_{name}"), LEFT)
    QApplication.processEvents()


def shade(view: CompareView) -> int:
    """Brightness in the middle of the left picture."""
    image = view.left.grab().toImage()
    return image.pixelColor(image.width() // 2, image.height() // 2).lightness()


def test_both_pictures_stand_side_by_side_with_their_captions(view: CompareView) -> None:
    assert view.mode == "side"
    assert view.findChild(QLabel, "compare_left_caption").text() == "Visit 1"
    assert view.findChild(QLabel, "compare_right_caption").text() == "Visit 2"
    assert view.left.isVisible()
    assert view.right.isVisible()
    assert abs(view.left.width() - view.right.width()) <= 2
    assert not view.findChild(QSlider, "compare_slider").isVisible()


@pytest.mark.parametrize("leader", ["left", "right"])
def test_zoom_and_place_are_shared_whichever_is_moved(view: CompareView, leader: str) -> None:
    a = getattr(view, leader)
    b = view.right if leader == "left" else view.left
    a.zoom_by(2.0, QPointF(90, 200))
    QTest.mousePress(a.viewport(), LEFT, pos=QPoint(200, 200))
    QTest.mouseMove(a.viewport(), QPoint(230, 180))
    QTest.mouseMove(a.viewport(), QPoint(260, 170))
    QTest.mouseRelease(a.viewport(), LEFT, pos=QPoint(260, 170))
    QTest.keyClick(a, Qt.Key.Key_Plus)
    mine, other = a.view_state(), b.view_state()
    assert mine.zoom == pytest.approx(2.5)
    assert (other.zoom, other.x, other.y) == pytest.approx((mine.zoom, mine.x, mine.y), abs=0.005)
    QTest.keyClick(b, Qt.Key.Key_0)
    assert a.view_state().zoom == pytest.approx(1)


def test_overlay_lays_the_later_picture_over_the_earlier_as_far_as_the_slider_says(view: CompareView) -> None:
    press(view, "overlay")
    slider = view.findChild(QSlider, "compare_slider")
    assert slider.isVisible()
    assert not view.right.isVisible()
    assert 100 < shade(view) < 180, "half of each"
    QTest.keyClick(slider, Qt.Key.Key_End)
    assert shade(view) > 200
    QTest.keyClick(slider, Qt.Key.Key_Home)
    assert shade(view) < 80
    press(view, "side")
    assert view.right.isVisible()
    assert shade(view) < 80


def test_flicker_shows_one_after_the_other(view: CompareView) -> None:
    press(view, "flicker")
    assert shade(view) < 80
    QTest.qWait(FLICKER_MS + 150)
    assert shade(view) > 200


def test_flicker_rests_while_nobody_looks(view: CompareView, show: Show) -> None:
    tabs = QTabWidget()
    tabs.addTab(view, "Compare")
    tabs.addTab(QWidget(), "Other")
    show(tabs, (1100, 700))
    press(view, "flicker")
    timer = view._timer
    assert timer.isActive()
    tabs.setCurrentIndex(1)
    assert not timer.isActive()
    press(view, "side")
    press(view, "flicker")
    assert not timer.isActive(), "not even when it is asked for out of sight"
    tabs.setCurrentIndex(0)
    assert timer.isActive()
    press(view, "side")
    assert not timer.isActive()


def test_one_picture_alone_can_only_be_looked_at(view: CompareView) -> None:
    press(view, "overlay")
    view.set_pictures(plain(DARK, 400, 300), None, "Visit 1", "No image of another visit")
    assert view.mode == "side"
    for name in ("overlay", "flicker"):
        assert not view.findChild(QPushButton, f"compare_{name}").isEnabled()
    view.set_pictures(plain(DARK, 400, 300), plain(LIGHT, 400, 300), "Visit 1", "Visit 2")
    assert view.findChild(QPushButton, "compare_overlay").isEnabled()
    QTest.qWait(20)
