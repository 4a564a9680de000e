"""The window "Hand joints", driven with mouse and keys: train, learn, track, export, look live."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QCheckBox, QFileDialog, QLabel, QSlider

from app.demo.driver import WindowDriver
from app.tasks import TaskRunner
from app.windows.hand.desk import HandDesk
from app.windows.hand.window import TITLE, HandWindow
from app.workflows.hand_log import pair_name
from core.capture import write_capture
from core.errors import WorkError
from core.hand.dataset import LABELS_FILE, read_labels, write_labels
from core.hand.labels import FrameLabels
from core.hand.names import POINT_NAMES, spoken
from core.hand.tracks import read_tracks
from devices.camera import DeviceInfo
from devices.live import LiveFrame, LiveState
from devices.recordings.played import PlayedCamera
from devices.simulator.hands.shots import Holder, shoot
from tests.gui.conftest import Desk, Show

CONFIGURATIONS = ("open", "point")
FRAMES_EACH = 4


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[FrameLabels]]:
    """Eight frames of one hand, open and pointing in turn, and the truth of them."""
    folder = tmp_path_factory.mktemp("hand") / "sequence"
    folder.mkdir()
    truth = []
    for k in range(FRAMES_EACH * len(CONFIGURATIONS)):
        name = CONFIGURATIONS[k % len(CONFIGURATIONS)]
        frame = shoot(Holder(), name, k)
        write_capture(frame.capture, folder / f"frame_{k + 1:04d}")
        truth.append(FrameLabels(name, dict(frame.points_m), dict(frame.visible)))
    return folder, truth


class UnpluggedCamera(PlayedCamera):
    """A recording in the place of a camera, of which the cable can be pulled."""

    gone = False

    def latest(self, after: int = 0, timeout_s: float = 0.0) -> LiveFrame | None:
        if self.gone:
            raise WorkError("The camera was unplugged.", "Plug it in again, then choose it again.")
        return super().latest(after, timeout_s)

    @property
    def state(self) -> LiveState:
        return LiveState.GONE if self.gone else super().state


class Corner:
    """The cameras of the computer of the tests: one, that shows the sequence."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.opened: list[UnpluggedCamera] = []

    def list(self) -> list[DeviceInfo]:
        return [DeviceInfo("openni:first", "Kinect on the stand", "openni", True)]

    def open(self, camera_id: str) -> UnpluggedCamera:
        camera = UnpluggedCamera(self.folder)
        camera.open()
        self.opened.append(camera)
        return camera


class Hands(WindowDriver):
    """The hand window, and the hands on it."""

    window: HandWindow

    def press(self, key: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        QTest.keyClick(self.window.picture, key, modifier)
        self.settle(0.05)

    def text(self, name: str) -> str:
        return self.find(name, QLabel).text()

    def said(self, words: str) -> None:
        self.wait_until(lambda: words in self.window.banner.text(), f"the words '{words}'")

    def open_sequence(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(folder))
        self.click("hand_open_folder")
        self.wait_until(lambda: self.window.picture.image_size[0] > 0, "the first picture")

    def train(self) -> None:
        self.click("hand_mode_train")
        self.wait_for_skin()

    def wait_for_skin(self) -> None:
        self.wait_until(lambda: self.window.training.labelling.skin is not None, "the skin to be measured")

    def click_pixel(self, u: float, v: float) -> None:
        """Where the picture is, at the zoom it has."""
        self._move_and_click(self.window.picture, self.window.picture.viewport_position(u, v))

    def label(self, truth: FrameLabels) -> None:
        """Click what is visible in its order, skip the rest with S."""
        lab = self.window.training.labelling
        assert lab.shot is not None
        pixels = lab.shot.rig.project_to_picture(np.array([truth.points_m[n] for n in POINT_NAMES]))
        for name, (u, v) in zip(POINT_NAMES, pixels, strict=True):
            assert lab.current == name
            if truth.visible[name]:
                self.click_pixel(u, v)
            if lab.current == name:
                self.press(Qt.Key.Key_S)
        seen = sum(truth.visible.values())
        assert len(lab.places_m) >= seen - 2, "depth is missing at a nail now and then, not more often"

    def number(self) -> int:
        return self.find("hand_seek", QSlider).value()

    def idle(self) -> None:
        self.wait_until(lambda: not self.window._desk.tasks.busy, "the work to end")


Open = Callable[[], Hands]


@pytest.fixture
def hands(
    sequence: tuple[Path, list[FrameLabels]], tmp_path: Path, show: Show, qapp: QApplication
) -> Iterator[Hands]:
    """The window with one camera before it."""
    tasks = TaskRunner()
    corner = Corner(sequence[0])
    window = HandWindow(HandDesk(tasks, corner, corner.open))
    show(window, (1280, 800))
    window.activateWindow()
    driver = Hands(window, tmp_path / "pictures")
    driver.wait_until(window.isActiveWindow, "the window to be active")
    driver.corner = corner  # type: ignore[attr-defined]
    yield driver
    window.training.labelling.begin(None)
    window.close()
    tasks.shut_down()
    QApplication.processEvents()


def labelled(folder: Path, truth: list[FrameLabels], target: Path, leave: tuple[int, ...] = ()) -> Path:
    """A copy of the sequence with the truth as labels."""
    shutil.copytree(folder, target)
    for k, labels in enumerate(truth):
        if k not in leave:
            write_labels(target / f"frame_{k + 1:04d}", labels)
    return target


def test_clicks_become_labels_labels_a_model_and_the_model_tracks(
    hands: Hands,
    sequence: tuple[Path, list[FrameLabels]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder, truth = sequence
    dataset = labelled(folder, truth, tmp_path / "dataset", leave=(0, 1))
    hands.open_sequence(dataset, monkeypatch)
    assert hands.window.windowTitle() == TITLE, "no name of a folder in the title"
    assert hands.text("hand_configuration") == "No model"
    hands.train()
    lab = hands.window.training.labelling
    assert "thumb, nail" in hands.text("hand_train_next")

    hands.click_pixel(20, 20)
    assert "not on the hand" in hands.text("hand_train_next")
    assert lab.current == "thumb_tip"
    hands.label(truth[0])
    assert lab.current is None
    hands.press(Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert lab.current == POINT_NAMES[-1]
    hands.press(Qt.Key.Key_S)
    assert POINT_NAMES[-1] in lab.hidden
    placed = len(lab.places_m)

    hands.click("hand_train_save")
    assert "empty" in hands.text("hand_train_configuration_error"), "a frame has a name"
    hands.type("hand_train_configuration", "open")
    hands.press(Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    hands.wait_until(lambda: hands.number() == 1, "the next frame")
    stored = read_labels(dataset / "frame_0001")
    assert stored is not None
    assert stored.configuration == "open"
    off_mm = [1000 * np.linalg.norm(p - truth[0].points_m[n]) for n, p in stored.points_m.items()]
    assert len(off_mm) == placed >= 8
    assert np.median(off_mm) < 3.0, "a click in a picture of 1.6 mm a pixel"

    hands.wait_for_skin()
    hands.label(truth[1])
    hands.type("hand_train_configuration", "point")
    name = next(n for n in POINT_NAMES if truth[1].visible[n])
    before, place = lab.places_m[name], hands.window.picture.drawn_points()[name]
    viewport = hands.window.picture.viewport()
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=place)
    for k in (6, 12, 14):
        QTest.mouseMove(viewport, place + QPoint(0, k))
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=place + QPoint(0, 14))
    hands.settle(0.05)
    assert 2 < 1000 * np.linalg.norm(lab.places_m[name] - before) < 20, "dragging corrects"
    hands.press(Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert np.array_equal(lab.places_m[name], before)
    hands.click("hand_train_save")
    hands.wait_until(lambda: hands.number() == 2, "the next frame")
    assert hands.text("hand_train_counts") == "open: 4   point: 4"

    hands.click("hand_train_learn")
    hands.find("hand_lesson_use", timeout_s=60)
    assert "8 frames" in hands.text("hand_lesson_used")
    assert "8 frames" in hands.text("hand_lesson_accuracy")
    table: Any = hands.find("hand_lesson_confusion")
    assert sum(int(table.item(r, c).text()) for r in range(2) for c in range(3)) == 8
    model = tmp_path / "model.json"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(model), ""))
    hands.click("hand_lesson_save")
    hands.idle()
    assert json.loads(model.read_text())["format"] == "geoderm-hand-model/1"
    hands.click("hand_lesson_use")

    window = hands.window
    hands.wait_until(lambda: len(window.engine.log) > 0, "the first tracked frame")
    hands.wait_until(lambda: hands.text("hand_configuration") == "open", "the configuration of frame 3")
    assert set(window.status.bars.shown()) == set(CONFIGURATIONS)
    assert len(window.picture.drawn_points()) >= 8
    for _ in range(2):
        hands.press(Qt.Key.Key_PageDown)
    hands.wait_until(lambda: hands.number() == 4, "two frames on")
    hands.wait_until(lambda: len(window.engine.log) >= 3, "their answers")
    pair = window.watch.pairs.ticked()[0]
    hands.wait_until(lambda: len(window.watch.chart.curves()[0].time_s) >= 3, "the chart")
    assert window.watch.chart.curves()[0].name == pair_name(pair)
    told = [window.watch.pairs.cells(row)[1] for row in range(105)]
    assert sum(cell != "–" for cell in told) > 20

    for ending, read in ((".json", lambda p: len(read_tracks(p).frames)), (".csv", _table_frames)):
        target = tmp_path / f"tracks{ending}"
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, t=target: (str(t), ""))
        hands.click("hand_export")
        hands.said(f"8 frames exported as tracks{ending}")
        assert read(target) == 8


def _table_frames(path: Path) -> int:
    rows = path.read_text().splitlines()
    return len({row.split(",")[0] for row in rows[1:]})


def test_a_recording_is_played_stepped_and_sought(
    hands: Hands, sequence: tuple[Path, list[FrameLabels]], monkeypatch: pytest.MonkeyPatch
) -> None:
    hands.open_sequence(sequence[0], monkeypatch)
    last = len(sequence[1]) - 1
    assert hands.number() == 0
    assert "frame 1 of 8" in hands.text("hand_place")
    hands.click("hand_play")
    hands.wait_until(lambda: hands.number() == last, "the end")
    hands.wait_until(lambda: not hands.window.transport.playing, "it stops there")
    assert "0.23 s" in hands.text("hand_place")
    hands.click("hand_step_back")
    hands.wait_until(lambda: hands.number() == last - 1, "one frame back")
    slider = hands.find("hand_seek", QSlider)
    slider.setFocus()
    QTest.keyClick(slider, Qt.Key.Key_Home)
    hands.wait_until(lambda: "frame 1 of 8" in hands.text("hand_place"), "the first frame")
    hands.press(Qt.Key.Key_Space, Qt.KeyboardModifier.ControlModifier)
    hands.wait_until(lambda: hands.number() == last, "playing by the keyboard")

    view = hands.window.watch.view
    hands.wait_until(lambda: view.canvas() is not None and view.canvas().renders > 0, "the 3D view")  # type: ignore[union-attr]
    assert view.mesh is not None
    assert len(view.mesh.triangles) > 1000
    canvas = view.canvas()
    assert canvas is not None
    eye = np.array(canvas.camera.position)
    middle = canvas.rect().center()
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=middle)
    for k in (10, 30, 60):
        QTest.mouseMove(canvas, middle + QPoint(k, 0))
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=middle + QPoint(60, 0))
    assert np.linalg.norm(np.array(canvas.camera.position) - eye) > 0.05, "it turns"
    for name in ("hand_layer_marker", "hand_3d_skin"):
        hands.click(name)
        assert not hands.find(name, QCheckBox).isChecked()


def test_a_live_camera_is_frozen_labelled_into_a_folder_and_its_loss_is_told(
    hands: Hands,
    sequence: tuple[Path, list[FrameLabels]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    hands.idle()
    hands.choose("hand_camera", "Kinect on the stand")
    hands.wait_until(lambda: "live, frame" in hands.text("hand_place"), "the live picture")
    painted = hands.window.picture.frames_painted
    hands.wait_until(lambda: hands.window.picture.frames_painted > painted + 5, "more pictures")
    hands.click("hand_mode_train")
    assert "freeze" in hands.text("hand_train_next")
    hands.click("hand_play")
    hands.wait_for_skin()
    lab = hands.window.training.labelling
    assert lab.shot is not None
    assert lab.skin is not None
    u, v = lab.skin.pixels.mean(axis=0)
    hands.click_pixel(u, v)
    assert "thumb_tip" in lab.places_m
    hands.type("hand_train_configuration", "open")

    hands.click("hand_play")
    hands.said("not saved")
    folder = tmp_path / "new dataset"
    folder.mkdir()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(folder))
    hands.click("banner_action_hand_save")
    hands.wait_until(lambda: hands.window.transport.playing, "the picture to go on")
    stored = read_labels(folder / "frame_0001")
    assert stored is not None
    assert list(stored.points_m) == ["thumb_tip"]
    assert hands.text("hand_train_counts").startswith("open: 1")

    assert len(hands.corner.opened) == 1  # type: ignore[attr-defined]
    hands.corner.opened[0].gone = True  # type: ignore[attr-defined]
    hands.said("The camera was unplugged. Plug it in again")
    assert hands.window.banner.kind == "error"
    assert hands.find("hand_notice").isVisible()


def test_wrong_input_is_told_in_sentences(
    hands: Hands, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "empty").mkdir()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path / "empty"))
    hands.click("hand_open_folder")
    hands.said("Give a folder of capture folders")
    wrong = tmp_path / "model.json"
    wrong.write_text('{"format": "something else"}')
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(wrong), ""))
    hands.click("hand_open_model")
    hands.said("format")
    assert hands.window.model is None
    assert not hands.window.bar.export.isEnabled(), "there is nothing to export"

    hands.click("hand_options_open")
    for name, text in (("hand_marker_side", "3.6"), ("hand_threshold", "much"), ("hand_lost_frames", "-1")):
        hands.type(name, text)
    hands.type("hand_dictionary", "DICT_9X9")
    hands.click("hand_options_use")
    assert "between 5 and 300 mm" in hands.text("hand_marker_side_error")
    assert "not a number" in hands.text("hand_threshold_error")
    assert "between 0 and 300" in hands.text("hand_lost_frames_error")
    assert "no ArUco dictionary 'DICT_9X9'" in hands.text("hand_dictionary_error")
    for name, text in (("hand_marker_side", "40 mm"), ("hand_threshold", "15"), ("hand_lost_frames", "5")):
        hands.type(name, text)
    hands.type("hand_dictionary", "DICT_5X5_100")
    hands.choose("hand_refinement", "One after the other")
    hands.click("hand_options_use")
    settings = hands.window.settings
    assert (settings.marker_m, settings.threshold_m, settings.lost_frames) == (0.04, 0.015, 5)
    assert (settings.dictionary, settings.refinement) == ("DICT_5X5_100", "sequential")


def test_a_frame_whose_marker_is_of_another_dictionary_is_said_to_be(
    hands: Hands, sequence: tuple[Path, list[FrameLabels]], monkeypatch: pytest.MonkeyPatch
) -> None:
    hands.click("hand_options_open")
    hands.type("hand_dictionary", "DICT_6X6_50")
    hands.click("hand_options_use")
    hands.open_sequence(sequence[0], monkeypatch)
    hands.wait_until(lambda: hands.text("hand_marker") == "Marker lost", "the badge")
    assert "DICT_4X4_50" in hands.text("hand_reason")
    hands.train()
    assert "cannot be labelled" in hands.text("hand_train_next")
    hands.click_pixel(*np.array(hands.window.picture.image_size) / 2)
    assert "cannot be labelled" in hands.text("hand_train_next")
    assert not (sequence[0] / "frame_0001" / LABELS_FILE).exists()


def test_the_window_reads_out_its_points(hands: Hands) -> None:
    names = [hands.window.training.panel.list.item(row).text() for row in range(15)]
    assert names == [spoken(name).capitalize() for name in POINT_NAMES]
    unnamed = [
        w
        for w in hands.window.findChildren(QLabel)
        if w.text() and w.width() < w.minimumSizeHint().width() and not w.wordWrap() and w.isVisible()
    ]
    assert not unnamed, [w.text() for w in unnamed]


def test_the_main_window_opens_it_and_takes_it_along_when_it_closes(small_desk: Desk) -> None:
    small_desk.click("hand_joints")
    small_desk.wait_until(lambda: small_desk.is_shown("hand_window"), "the hand window")
    first = small_desk.main._hand
    small_desk.click("hand_joints")
    assert small_desk.main._hand is first, "one window, brought to the front"
    small_desk.idle()
    assert first is not None
    first.close()
    small_desk.wait_until(lambda: small_desk.main._hand is None, "it to be gone")
    small_desk.click("hand_joints")
    assert small_desk.main._hand is not first
    small_desk.idle()
    small_desk.main.close()
    small_desk.wait_until(lambda: not small_desk.is_shown("hand_window"), "it to be closed too")
