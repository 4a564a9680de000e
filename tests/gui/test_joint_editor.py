"""Joints dragged on the photo by a real mouse."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.widgets.photo_view import PhotoView
from app.windows.visit.joint_editor import JointEditor
from app.windows.visit.joint_marks import LEFT_COLOR, RIGHT_COLOR, joint_color
from core.anchors import JOINT_NAMES, AnalysedCapture, Skeleton, analyse_capture, with_skeleton
from devices.simulator import SimulatedPatient, make_rig
from devices.trackers import default_tracker
from tests.gui.conftest import Show

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def analysed() -> AnalysedCapture:
    patient = SimulatedPatient(
        "m_young_avg", seed=5, moles=4, lesions=1, freckles=0, rig=make_rig((960, 720))
    )
    capture = patient.capture("A", frames=3, joints=True).capture
    return analyse_capture(capture, default_tracker(), find_spots=False)


class Bench(QWidget):
    """A photo with the editor under it."""

    def __init__(self) -> None:
        super().__init__()
        self.photo = PhotoView()
        self.editor = JointEditor(self.photo)
        column = QVBoxLayout(self)
        column.addWidget(self.photo, 1)
        column.addWidget(self.editor)
        self.skeletons: list[Skeleton] = []
        self.editing: list[bool] = []
        self.editor.corrected.connect(self.skeletons.append)
        self.editor.editing_changed.connect(self.editing.append)

    def click(self, widget: QWidget) -> None:
        QTest.mouseClick(widget, LEFT)
        QApplication.processEvents()

    def drag(self, name: str, by: QPoint, *, release: bool = True) -> None:
        port = self.photo.viewport()
        start = self.editor.joint_position(name).toPoint()
        QTest.mousePress(port, LEFT, pos=start)
        for share in (0.4, 0.8, 1.0):
            QTest.mouseMove(port, start + by * share)
        if release:
            QTest.mouseRelease(port, LEFT, pos=start + by)
        QApplication.processEvents()


@pytest.fixture
def bench(show: Show, analysed: AnalysedCapture) -> Bench:
    bench = show(Bench(), (900, 760))
    bench.editor.set_capture(analysed)
    bench.click(bench.editor.toggle)
    return bench


def test_the_joints_appear_only_while_they_are_corrected(show: Show, analysed: AnalysedCapture) -> None:
    bench = show(Bench(), (900, 760))
    assert not bench.editor.toggle.isEnabled()
    bench.editor.set_capture(analysed)
    assert not bench.editor.editing
    bench.click(bench.editor.toggle)
    assert bench.editor.editing
    assert bench.photo.image_size == (960, 720)
    assert bench.editor.hint.isVisible()
    assert set(bench.editor.skeleton.joints) == set(JOINT_NAMES)
    bench.click(bench.editor.toggle)
    assert bench.editing == [True, False]
    assert not bench.editor.undo_button.isVisible()


def test_a_dragged_joint_lies_under_the_mouse_and_in_the_body(
    bench: Bench, analysed: AnalysedCapture
) -> None:
    before = analysed.skeleton.joints["left_knee"]
    bench.drag("left_knee", QPoint(6, 12))
    (skeleton,) = bench.skeletons
    after = skeleton.joints["left_knee"]
    scale = bench.photo.transform().m11()
    np.testing.assert_allclose(after.pixel - before.pixel, np.array([6, 12]) / scale, atol=1.5 / scale)
    assert after.source == "hand"
    assert after.visibility == 1.0
    assert 0 < after.sigma_m < 0.015
    assert np.linalg.norm(after.point_m - before.point_m) < 0.12
    assert all(skeleton.joints[n] is analysed.skeleton.joints[n] for n in JOINT_NAMES if n != "left_knee")


def test_a_click_without_a_drag_changes_nothing(bench: Bench) -> None:
    place = bench.editor.joint_position("right_hip").toPoint()
    QTest.mouseClick(bench.photo.viewport(), LEFT, pos=place)
    assert bench.skeletons == []


def test_undo_takes_one_correction_back_and_reset_all(bench: Bench, analysed: AnalysedCapture) -> None:
    bench.drag("left_knee", QPoint(6, 12))
    bench.drag("right_hip", QPoint(-5, 4))
    bench.drag("left_hip", QPoint(5, 4))
    bench.click(bench.editor.undo_button)
    assert bench.skeletons[-1].joints["left_hip"].source != "hand"
    assert bench.skeletons[-1].joints["right_hip"].source == "hand"
    QTest.keyClick(bench.photo, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert bench.skeletons[-1].joints["right_hip"].source != "hand"
    bench.click(bench.editor.reset_button)
    assert bench.skeletons[-1] is analysed.skeleton
    assert not bench.editor.undo_button.isEnabled()


def test_a_joint_dropped_beside_the_body_goes_back_and_the_reason_is_said(bench: Bench) -> None:
    place = bench.editor.joint_position("left_knee").toPoint()
    away = bench.photo.viewport_position(20, 20)
    bench.drag("left_knee", away - place)
    assert bench.skeletons == []
    assert "must lie on the body" in bench.editor.hint.text()
    assert bench.editor.joint_position("left_knee").toPoint() == place


def test_escape_ends_a_drag(bench: Bench) -> None:
    place = bench.editor.joint_position("left_knee").toPoint()
    bench.drag("left_knee", QPoint(30, 30), release=False)
    assert bench.editor.joint_position("left_knee").toPoint() != place
    QTest.keyClick(bench.photo, Qt.Key.Key_Escape)
    assert bench.editor.joint_position("left_knee").toPoint() == place
    QTest.mouseRelease(bench.photo.viewport(), LEFT, pos=place)
    assert bench.skeletons == []


def test_the_photo_can_still_be_moved_and_zoomed(bench: Bench) -> None:
    port = bench.photo.viewport()
    start = bench.photo.viewport_position(60, 60)
    before = bench.photo.view_state()
    QTest.mousePress(port, LEFT, pos=start)
    for step in (10, 30, 50):
        QTest.mouseMove(port, start + QPoint(step, step))
    QTest.mouseRelease(port, LEFT, pos=start + QPoint(50, 50))
    assert bench.photo.view_state() != before
    bench.photo.zoom_by(2.0)
    bench.drag("torso", QPoint(8, 0))
    assert bench.skeletons[-1].joints["torso"].source == "hand"


def test_left_and_right_have_their_own_colours_and_names_show_on_hover(bench: Bench, qtbot: QtBot) -> None:
    assert joint_color("left_knee").name().upper() == LEFT_COLOR.upper()
    assert joint_color("right_knee").name().upper() == RIGHT_COLOR.upper()
    assert LEFT_COLOR != RIGHT_COLOR
    place = bench.editor.joint_position("right_knee").toPoint()
    QTest.mouseMove(bench.photo.viewport(), place + QPoint(90, 40))
    QTest.mouseMove(bench.photo.viewport(), place)
    qtbot.waitUntil(lambda: bench.editor.hovered == "right_knee", timeout=3000)
    QTest.mouseMove(bench.photo.viewport(), place + QPoint(90, 40))
    qtbot.waitUntil(lambda: bench.editor.hovered is None, timeout=3000)


def test_what_came_of_the_correction_keeps_the_history_and_another_capture_does_not(
    bench: Bench, analysed: AnalysedCapture
) -> None:
    bench.drag("left_knee", QPoint(6, 12))
    bench.editor.set_capture(with_skeleton(analysed.scan, bench.skeletons[-1]))
    assert bench.editor.editing
    assert bench.editor.undo_button.isEnabled()
    bench.editor.set_capture(None)
    assert not bench.editor.editing
    assert bench.editor.skeleton is None
