"""The calibration wizard, driven with mouse and keys on a simulated board, to a saved calibration."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog

from app.windows.calibration import known_cameras
from app.windows.calibration.board_choice import BoardChoice, load_choice, read_width, store_choice
from app.windows.calibration.last_checks import load_checks
from app.windows.calibration.pictures import BoardPicture, CoverageGauge
from app.windows.calibration.wizard import CalibrationWizard
from core.calibration.profile import ProfileStore
from core.capture.transform import RigidTransform
from core.errors import WorkError
from core.progress import no_progress
from devices.camera import DeviceInfo
from devices.live import LiveFrame, LiveState
from devices.simulator import SimulatedCamera
from devices.simulator.board_device import FRAMES_PER_S, BoardScene, SimulatedBoardCamera
from devices.simulator.boards import good_poses
from tests.gui.conftest import Desk

SEED = 3
HELD = 5
"""Frames for which the hand of the tests holds each pose of the board."""

POSES = 40


class HeldBoard:
    """The board held still in one good pose after the other, without the ways between them."""

    def __init__(self, poses: list[RigidTransform], held: int) -> None:
        self.poses, self.held = poses, held

    def at(self, time_s: float, *_: float) -> RigidTransform:
        return self.poses[int(time_s * FRAMES_PER_S + 0.5) // self.held % len(self.poses)]


class QuickBoardCamera(SimulatedBoardCamera):
    """The simulated board before a camera that delivers as fast as one looks, and can be unplugged."""

    def __init__(self, scene: BoardScene, poses: int = POSES) -> None:
        super().__init__(scene)
        self._count = poses
        self.gone = False
        self.closed_in: str | None = None

    def open(self) -> None:
        super().open()
        poses = good_poses(self.truth, self.spec, self._count, self._scene.seed)
        held = 3 * HELD if self._scene.exclusive else HELD
        self._motion = HeldBoard(poses, held)  # type: ignore[assignment]

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        if self.gone:
            raise WorkError("The camera was unplugged.", "Plug it in again.")
        return super().latest(after, timeout_s)

    @property
    def state(self) -> LiveState:
        return LiveState.GONE if self.gone else super().state

    def close(self) -> None:
        self.closed_in = threading.current_thread().name
        super().close()


class Rigs:
    """What is connected to the computer of the tests."""

    def __init__(self) -> None:
        self.make: Callable[[], QuickBoardCamera] = lambda: QuickBoardCamera(BoardScene(seed=SEED, free=True))
        self.opened: list[QuickBoardCamera] = []

    def list(self) -> list[DeviceInfo]:
        board = DeviceInfo("simulator-board:kinect", "Kinect on the stand", "simulator", True)
        broken = DeviceInfo("openni:broken", "Xtion at the window", "openni", True)
        return [board, SimulatedCamera("child10").info, broken]

    def open(self, camera_id: str) -> Any:
        if camera_id == "openni:broken":
            raise WorkError("The camera is used by another program.", "Close that program.")
        camera = self.make()
        camera.open()
        self.opened.append(camera)
        return camera


class Wizard:
    """The wizard over the main window, and the hands on it."""

    def __init__(self, desk: Desk, rigs: Rigs) -> None:
        self.desk, self.rigs = desk, rigs
        desk.context.cameras = rigs
        self.sheet = CalibrationWizard(desk.main, desk.context)
        self.gone: list[bool] = []
        self.sheet.gone.connect(lambda: self.gone.append(True))
        self.feed = self.sheet.feed
        self.sheet.open()
        desk.wait_until(lambda: len(self.table("calibration_cameras")) > 0, "the cameras to be found")

    @property
    def folder(self) -> Path:
        return self.desk.context.profiles.folder

    def table(self, name: str) -> list[tuple[str, ...]]:
        return [row.cells for row in self.desk.find(name).rows()]  # type: ignore[attr-defined]

    def shoot(self, name: str) -> None:
        self.desk.shoot(name)

    def to_collecting(self, width: str = "378.0") -> None:
        self.desk.click("calibration_start")
        self.desk.type("board_width", width)
        self.desk.click("board_next")
        self.desk.find("calibration_collect", timeout_s=60)

    def collect(self, count: int) -> None:
        broken = self.sheet.collect.banner
        self.desk.wait_until(lambda: self.views >= count or broken.isVisible(), f"{count} views", 150)
        assert not broken.isVisible(), broken.text()

    @property
    def views(self) -> int:
        found = self.sheet.collect.findings
        return 0 if found is None else len(found.rows)

    def thread_ended(self) -> None:
        self.desk.wait_until(lambda: not running(), "the thread to end", 20)


def running() -> list[str]:
    return [t.name for t in threading.enumerate() if t.name == "calibration-feed"]


@pytest.fixture
def wizard(small_desk: Desk) -> Iterator[Wizard]:
    made = Wizard(small_desk, Rigs())
    yield made
    if not made.gone:
        made.sheet._close_now()
    made.thread_ended()
    small_desk.idle()


def test_from_the_list_of_cameras_to_a_saved_calibration_that_the_next_capture_uses(
    wizard: Wizard, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    desk = wizard.desk
    # who is there: the broken one says why, simulated patients need no calibration
    cameras = wizard.table("calibration_cameras")
    assert [row[0] for row in cameras] == ["Kinect on the stand", "Xtion at the window"]
    serial = wizard.rigs.opened[0].identity.depth_serial
    assert cameras[0][1:] == (serial, "kinect-v1", "Not calibrated")
    assert cameras[1][3] == "Cannot be opened"
    assert not desk.is_shown("calibration_check")
    wizard.shoot("1-cameras")

    # print the board and measure it: a wrong width is refused with the reason
    desk.click("calibration_start")
    target = tmp_path / "board.pdf"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *a, **k: (str(target), ""))
    desk.click("board_save_pdf")
    desk.wait_until(lambda: "board.pdf" in desk.text("board_saved"), "the PDF")
    assert target.read_bytes().startswith(b"%PDF")
    desk.type("board_width", "297")
    desk.click("board_next")
    assert "Print it at 100 %" in desk.text("board_width_error")
    wizard.shoot("2-board")
    desk.type("board_width", "378,0", enter=True)

    # collect: corners are drawn, regions fill, the counter counts, a view can be taken and removed by hand
    desk.find("calibration_collect", timeout_s=60)
    wizard.collect(3)
    color = desk.find("calibration_color", BoardPicture)
    desk.wait_until(lambda: color.corner_count > 20, "corners in the colour picture")
    assert desk.find("calibration_infrared", BoardPicture).showing
    wizard.shoot("3-collecting-first")
    before = wizard.views
    desk.find("collect_message")
    QTest.keyClick(wizard.sheet.collect, Qt.Key.Key_Space)
    desk.wait_until(lambda: wizard.views > before, "the view taken by hand")
    table = desk.find("collect_views")
    table.selectRow(0)  # type: ignore[attr-defined]
    desk.click("collect_remove")
    removed = wizard.views
    wizard.collect(15)
    assert removed < 15
    assert desk.find("calibration_color_gauge", CoverageGauge).filled() >= 12
    assert "px" in desk.text("collect_rms")
    wizard.shoot("3-collecting")

    # solve, read the verdict, save
    desk.click("collect_solve")
    desk.find("calibration_result", timeout_s=120)
    wizard.shoot("4-result")
    assert desk.text("result_headline") in ("This calibration is good", "This calibration can be used")
    rows = {cells[0]: cells[1:] for cells in wizard.table("result_parameters")}
    focal, bound = rows["Depth: focal length, across"]
    truth = wizard.rigs.opened[-1].truth.rig
    assert float(focal.split()[0]) == pytest.approx(truth.depth.fx, rel=0.003)
    assert bound.startswith("± ")
    assert bound.endswith("px")
    assert desk.text("result_save") == "Save as version 1"
    desk.click("result_save")
    desk.wait_until(lambda: desk.is_shown("result_done"), "the calibration to be saved")
    wizard.shoot("4-saved")
    kept = ProfileStore(wizard.folder).newest(serial, serial)
    assert kept is not None
    assert kept.version == 1
    desk.wait_until(lambda: wizard.rigs.opened[-1].closed_in is not None, "the camera to be closed")
    assert wizard.rigs.opened[-1].closed_in == "calibration-feed"
    desk.click("result_done")
    desk.wait_until(lambda: bool(wizard.gone), "the sheet to go")
    wizard.thread_ended()

    # the board is remembered, the list knows the calibration, the camera uses it, the check is offered
    assert load_choice(wizard.folder) == BoardChoice("A3", 0.378)
    again = Wizard(desk, wizard.rigs)
    assert again.table("calibration_cameras")[0][3].startswith("Version 1 of ")
    again.shoot("1-cameras-calibrated")
    desk.click("calibration_check")
    desk.find("calibration_check_page", timeout_s=60)
    desk.wait_until(lambda: again.sheet.check.result is not None, "the check", 60)
    again.shoot("5-check-ok")
    assert desk.text("check_headline") == "OK, nothing has moved"
    assert load_checks(again.folder)[kept.id].verdict == "ok"

    # the same rig after a knock: the check says so, and so does the list
    desk.click("check_done")
    knocked = BoardScene(seed=SEED, free=True, moved_deg=0.8)
    wizard.rigs.make = lambda: QuickBoardCamera(knocked)
    desk.wait_until(lambda: desk.is_shown("calibration_check"), "the list")
    desk.click("calibration_check")
    desk.wait_until(lambda: "was moved" in again.sheet.check.headline.text(), "the check", 60)
    again.shoot("5-check-moved")
    desk.click("check_back")
    desk.wait_until(lambda: "was moved" in again.table("calibration_cameras")[0][3], "the warning")
    again.shoot("1-cameras-moved")
    QTest.keyClick(again.sheet, Qt.Key.Key_Escape)
    desk.wait_until(lambda: bool(again.gone), "the sheet to go")
    again.thread_ended()
    desk.idle()


def test_a_weak_set_is_refused_with_what_is_missing_and_collecting_goes_on(wizard: Wizard) -> None:
    desk = wizard.desk
    assert not desk.is_shown("collect_solve")
    wizard.rigs.make = lambda: QuickBoardCamera(BoardScene(seed=SEED, free=True), poses=8)
    wizard.to_collecting()
    wizard.collect(6)
    desk.click("collect_solve")
    desk.find("calibration_result", timeout_s=120)
    assert "not good enough" in desk.text("result_headline")
    assert "views" in desk.text("result_reasons")
    assert desk.text("result_missing")
    assert not desk.is_shown("result_save")
    wizard.shoot("4-refused")
    before = wizard.views
    desk.click("result_go_on")
    desk.find("calibration_collect")
    wizard.collect(before)
    assert ProfileStore(wizard.folder).all() == []
    desk.click("collect_back")  # asks, because the views are not saved
    desk.click("sheet_confirm")
    desk.find("calibration_board")


def test_a_camera_unplugged_while_collecting_costs_no_view(wizard: Wizard) -> None:
    desk = wizard.desk
    wizard.to_collecting()
    wizard.collect(2)
    wizard.rigs.opened[-1].gone = True
    desk.wait_until(lambda: "unplugged" in desk.banner_text(), "the message")
    wizard.shoot("3-unplugged")
    before = wizard.views
    desk.click("banner_action_open_again")
    desk.wait_until(lambda: wizard.views > before, "further views", 60)
    assert "unplugged" not in desk.banner_text()


def test_closing_while_collecting_asks_first_and_leaves_no_thread(wizard: Wizard) -> None:
    desk = wizard.desk
    wizard.to_collecting()
    wizard.collect(1)
    QTest.keyClick(wizard.sheet, Qt.Key.Key_Escape)
    desk.click("sheet_cancel")
    assert not wizard.gone
    assert running()
    QTest.keyClick(wizard.sheet, Qt.Key.Key_Escape)
    wizard.shoot("3-close")
    began = time.monotonic()
    desk.click("sheet_confirm")
    assert wizard.gone
    assert time.monotonic() - began < 5.0
    wizard.thread_ended()
    assert wizard.rigs.opened[-1].closed_in == "calibration-feed"


def test_a_camera_that_shows_infrared_or_colour_is_guided_through_the_change(wizard: Wizard) -> None:
    desk = wizard.desk
    wizard.rigs.make = lambda: QuickBoardCamera(BoardScene(seed=SEED, free=True, exclusive=True))
    wizard.to_collecting()
    assert "infrared or colour, not both" in desk.text("collect_wish")
    assert not desk.is_shown("collect_take")
    desk.main.resize(desk.main.minimumSize())
    infrared = desk.find("calibration_infrared", BoardPicture)
    desk.wait_until(lambda: infrared.showing, "the infrared picture", 60)
    wizard.shoot("3-exclusive")
    wizard.collect(2)  # colour, infrared and colour again, for each of them


def test_closing_the_window_while_collecting_ends_the_thread(wizard: Wizard) -> None:
    wizard.to_collecting()
    wizard.desk.main.close()
    QApplication.processEvents()
    assert not running()
    wizard.gone.append(True)


def test_the_window_goes_on_while_the_board_is_looked_for(wizard: Wizard) -> None:
    """No turn of the event loop is held up by the camera, the search for corners or the quick calibration."""
    wizard.to_collecting()
    wizard.collect(1)
    turns: list[float] = []
    end = time.perf_counter() + 4.0
    last = time.thread_time()
    while time.perf_counter() < end:
        QApplication.processEvents()
        now = time.thread_time()
        turns.append(now - last)
        last = now
        time.sleep(0.002)
    assert wizard.views > 1
    assert max(turns) < 0.05, f"{1e3 * np.array(sorted(turns)[-5:])} ms of processor time in one turn"


def test_the_registry_is_asked_itself_and_a_kind_that_fails_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from app.context import RegisteredCameras
    from devices import registry

    def listed(kind: str) -> list[DeviceInfo]:
        if kind == "openni":
            raise WorkError("The runtime is not installed.", "Install it.")
        ids = {"simulator-board": ["simulator-board:kinect"], "simulator": ["simulator:child10"]}.get(
            kind, []
        )
        return [DeviceInfo(device_id, device_id, "simulator", True) for device_id in ids]

    monkeypatch.setattr(registry, "list_devices", listed)
    found = known_cameras.ask_cameras(RegisteredCameras(), ProfileStore(tmp_path), no_progress)
    assert [(camera.info.id, camera.problem) for camera in found] == [("simulator-board:kinect", "")]


# --- without a window ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "good"), [("378", True), ("377,6", True), ("297", False), ("wide", False)])
def test_a_width_is_read_in_millimetres_with_point_or_comma(text: str, good: bool) -> None:
    read = read_width(text, 0.378)
    assert isinstance(read, float) is good
    if isinstance(read, float):
        assert read == pytest.approx(float(text.replace(",", ".")) / 1000)


def test_a_remembered_board_that_cannot_be_read_is_the_usual_one(tmp_path: Path) -> None:
    assert load_choice(tmp_path) == BoardChoice()
    store_choice(tmp_path, BoardChoice("A4", 0.2612))
    assert load_choice(tmp_path) == BoardChoice("A4", 0.2612)
    assert load_choice(tmp_path).spec.square_m == pytest.approx(0.2612 / 9)
    (tmp_path / "board" / "board.json").write_text('{"paper": "A4", "width_m": 0.378}')
    assert load_choice(tmp_path) == BoardChoice("A4")
    (tmp_path / "board" / "board.json").write_text("[")
    assert load_choice(tmp_path) == BoardChoice()
    assert ProfileStore(tmp_path).damaged() == []
