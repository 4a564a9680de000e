"""The capture assistant in the real window: live picture, readings, countdown, verdict, unplugged camera."""

from __future__ import annotations

import json
import shutil
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QCheckBox, QSlider

from app.context import AppContext
from app.demo.driver import WindowDriver
from app.live import Phase
from app.windows.visit.page import VisitPage
from app.workflows.table import State
from core.calibration.profile import CalibrationProfile
from core.records import ClinicStore
from devices.camera import DepthCamera, DeviceInfo
from devices.simulator import SimulatedPatient
from devices.simulator.camera_device import SimulatedCamera, SimulatedScene
from devices.simulator.live_faults import NO_FAULTS, Faults
from devices.simulator.room import STILL, make_rig
from devices.trackers import default_tracker
from tests.gui.conftest import PASSWORD, USER, Show, World

SLOW_S = 90.0


@pytest.fixture(scope="module")
def person() -> SimulatedPatient:
    """The patient of the test clinic, who stands like a post."""
    return SimulatedPatient(
        "m_young_avg", seed=4, moles=60, freckles=40, rig=make_rig((640, 480)), variation=STILL
    )


class Corner:
    """A camera source with one simulated patient; each opening gets the next list of faults."""

    def __init__(self, person: SimulatedPatient, *faults: Faults) -> None:
        self._person, self._faults = person, list(faults)
        self.cameras: list[SimulatedCamera] = []
        self.scene = SimulatedScene()

    def list(self) -> list[DeviceInfo]:
        return [SimulatedCamera(self._person).info]

    def open(self, camera_id: str) -> DepthCamera:
        fault = self._faults.pop(0) if self._faults else NO_FAULTS
        camera = SimulatedCamera(self._person, self.scene, sway="still", faults=fault)
        self.cameras.append(camera)
        return camera

    @property
    def camera(self) -> SimulatedCamera:
        return self.cameras[-1]


class Desk(WindowDriver):
    """The hands on a visit page."""

    def __init__(self, page: VisitPage, pictures: Path) -> None:
        super().__init__(page, pictures)
        self.page = page
        self.deck, self.assist = page.captures.deck, page.captures.assist

    @property
    def screen(self):  # type: ignore[no-untyped-def]
        return self.page.stack.currentWidget()

    @property
    def state(self) -> State:
        return self.page.session.state

    def live(self) -> None:
        """Wait for the live picture and the first readings."""
        self.wait_until(lambda: self.screen.live_view.image_size != (0, 0), "the live picture", SLOW_S)
        self.wait_until(lambda: self.deck.live.guidance is not None, "the readings", SLOW_S)

    def idle(self) -> None:
        self.wait_until(
            lambda: not self.page.context.tasks.busy and self.assist.assistant.phase is Phase.WATCHING,
            "the capture",
            SLOW_S,
        )

    def from_folder(self, folder: Path, button: str) -> None:
        self.deck.choose_path(folder)
        self.wait_until(lambda: not self.page.context.tasks.busy, "the folder", SLOW_S)
        self.click(button)
        self.idle()


OpenDesk = Callable[..., Desk]


@pytest.fixture
def open_desk(world: World, tmp_path: Path, show: Show) -> Iterator[OpenDesk]:
    """Opens a visit of the new patient, or a follow-up of the known one, before a simulated camera."""
    shutil.copytree(world.root / "clinic", tmp_path / "clinic")
    opened: list[tuple[AppContext, VisitPage]] = []

    def make(corner: Corner, *, follow_up: bool = False, profile: CalibrationProfile | None = None) -> Desk:
        store = ClinicStore.open(tmp_path / "clinic")
        context = AppContext(
            store, store.folder, cameras=corner, tracker_factory=default_tracker, demonstration=True
        )
        if profile is not None:
            context.profiles.add(profile)
        user = store.users.authenticate(USER, PASSWORD)
        assert user is not None
        context.log_in(user)
        patient = store.patients.search("Müller" if follow_up else "Nováková")[0].patient
        page = VisitPage(context, patient.id, frames=10)
        opened.append((context, page))
        show(page, (1440, 900))
        return Desk(page, tmp_path / "pictures")

    yield make
    for context, page in opened:
        page.leave()
        assert not [t.name for t in threading.enumerate() if t.name.startswith("live-")]
        context.tasks.shut_down()
        QApplication.processEvents()
        context.store.close()


def test_the_picture_moves_the_readings_follow_and_a_capture_waits_for_a_still_patient(
    open_desk: OpenDesk, person: SimulatedPatient
) -> None:
    corner = Corner(person)
    corner.scene = SimulatedScene("psi", distance_m=1.3)
    desk = open_desk(corner)
    desk.live()
    view, strip = desk.screen.live_view, desk.screen.strip

    painted = view.frames_painted
    desk.wait_until(lambda: view.frames_painted > painted + 30, "thirty more pictures", SLOW_S)
    desk.wait_until(lambda: view.pose is not None and bool(view.pose.bones()), "the skeleton", SLOW_S)
    desk.wait_until(lambda: strip.state("frame") == "bad", "the body to be cut off", SLOW_S)
    assert strip.text("frame") == "Cut off"
    desk.wait_until(lambda: view.sentence.startswith("Step back"), "the sentence", SLOW_S)

    desk.click("stance_auto")
    assert desk.find("stance_auto", QCheckBox).isChecked()
    seen = desk.deck.live.guidance
    desk.wait_until(lambda: desk.deck.live.guidance is not seen, "new readings", SLOW_S)
    desk.settle(1.5)
    assert desk.assist.assistant.phase is Phase.WATCHING, "no capture of a body that is cut off"

    corner.camera.step(distance_m=2.6)
    desk.wait_until(lambda: strip.state("frame") == "good", "the whole body", SLOW_S)
    desk.wait_until(lambda: desk.assist.counting, "the countdown to begin by itself", SLOW_S)
    assert strip.state("stillness") == "good"
    assert view.count in (1, 2, 3)
    assert desk.find("stance_primary").text() == "Cancel (Esc)"  # type: ignore[attr-defined]
    QTest.keyClick(view, Qt.Key.Key_Escape)
    assert not desk.assist.counting
    assert view.count == 0
    assert not desk.find("stance_auto", QCheckBox).isChecked(), "it does not begin again by itself"
    desk.settle(1.2)
    assert desk.assist.assistant.phase is Phase.WATCHING
    assert desk.state is State.STANCE
    assert desk.page.session.is_empty

    desk.click("stance_auto")
    desk.wait_until(lambda: desk.state is State.STANCE_DONE, "the capture of a still patient", SLOW_S)
    desk.idle()
    assert "A good capture" in desk.screen.verdict.text()
    assert not desk.deck.live._looking, "nobody looks while the capture is shown"


def test_a_camera_that_is_unplugged_is_told_and_opened_again(
    open_desk: OpenDesk, person: SimulatedPatient
) -> None:
    corner = Corner(person, Faults(unplug_s=2.0))
    desk = open_desk(corner)
    desk.live()
    desk.wait_until(lambda: "Nothing of the visit is lost" in desk.page.banner.text(), "the banner", SLOW_S)
    assert desk.page.banner.kind == "error"
    assert not desk.screen.panel.primary.isEnabled(), "there is nothing to capture with"
    assert desk.screen.live_view.image_size == (0, 0)
    desk.wait_until(lambda: len(corner.cameras) == 2, "the second opening", SLOW_S)
    desk.live()
    assert desk.deck.camera is corner.camera
    assert "The camera is back" in desk.page.banner.text()
    assert desk.screen.panel.primary.isEnabled()


def test_a_follow_up_shows_the_outline_of_the_last_visit_and_asks_about_a_doubtful_capture(
    open_desk: OpenDesk, person: SimulatedPatient, world: World
) -> None:
    corner = Corner(person)
    identity = SimulatedCamera(person).identity
    profile = CalibrationProfile(person.rig.rig, identity.depth_serial, identity.color_serial)
    desk = open_desk(corner, follow_up=True, profile=profile)
    desk.live()
    view = desk.screen.live_view
    desk.wait_until(lambda: view.has_ghost, "the outline", SLOW_S)
    assert desk.find("stance_ghost", QCheckBox).text() == "Outline of the last visit"
    assert "version 1" in desk.find("stance_calibration").text()  # type: ignore[attr-defined]
    shown = view.grab().toImage()
    desk.click("stance_ghost")
    assert not view.has_ghost
    assert view.grab().toImage() != shown
    desk.click("stance_ghost")
    desk.find("stance_ghost_opacity", QSlider).setValue(40)
    assert view.has_ghost

    desk.from_folder(world.root / "psi", "stance_primary")
    assert desk.state is State.STANCE_DONE
    desk.click("stance_primary")
    assert desk.state is State.CAPTURE
    desk.deck.choose(SimulatedCamera(person).info.id)
    desk.wait_until(lambda: desk.deck.camera is not None, "the camera", SLOW_S)
    corner.camera.step(distance_m=1.9)
    desk.live()
    desk.wait_until(lambda: desk.screen.strip.state("frame") == "bad", "the feet to be cut off", SLOW_S)
    desk.click("capture_primary")
    assert desk.assist.counting
    desk.idle()
    assert desk.state is State.CAPTURE, "a doubtful capture is not stored unasked"
    assert "Usable, with doubts" in desk.screen.verdict.text()
    assert "cut off" in desk.screen.verdict.text()
    desk.click("capture_secondary")
    assert desk.assist.counting, "Capture again counts down again"
    desk.idle()
    assert "Usable, with doubts" in desk.screen.verdict.text()
    desk.click("capture_primary")
    desk.idle()
    assert desk.state is State.CAPTURE_DONE
    assert "front" in desk.page.session.snapshot.views
    assert "back" in desk.find("capture_next_view").text()  # type: ignore[attr-defined]
    desk.click("capture_next_view")
    assert desk.screen.view == "back"
    assert desk.screen.live, "the next side is looked at through the camera"


def test_a_capture_that_is_useless_is_refused_with_its_reason(
    open_desk: OpenDesk, person: SimulatedPatient, world: World, tmp_path: Path
) -> None:
    folder = tmp_path / "black"
    shutil.copytree(world.root / "psi", folder)
    document = json.loads((folder / "capture.json").read_text())
    photo = folder / document["color"]["file"]
    picture = cv2.imread(str(photo))
    cv2.imwrite(str(photo), (picture * 0.02).astype(np.uint8))
    desk = open_desk(Corner(person))
    desk.from_folder(folder, "stance_primary")
    assert desk.state is State.STANCE
    assert "cannot be used" in desk.screen.verdict.text()
    assert "too dark" in desk.screen.verdict.text()
    assert desk.find("stance_primary").text() == "Capture again"  # type: ignore[attr-defined]
    assert desk.page.session.is_empty

    joints = desk.screen.joints
    desk.click("stance_correct")
    assert not desk.screen.panel.primary.isEnabled(), "first the correction, then the verdict"
    photo, before = desk.screen.photo, joints.skeleton
    start = joints.joint_position("left_hand").toPoint()
    QTest.mousePress(photo.viewport(), Qt.MouseButton.LeftButton, pos=start)
    for step in (4, 8, 10):
        QTest.mouseMove(photo.viewport(), start + QPoint(0, step))
    QTest.mouseRelease(photo.viewport(), Qt.MouseButton.LeftButton, pos=start + QPoint(0, 10))
    assert joints.skeleton is not before
    moved = joints.skeleton.joints["left_hand"].pixel
    desk.click("stance_correct")
    desk.idle()
    assert "cannot be used" in desk.screen.verdict.text(), "it is judged anew, and still dark"
    judged = desk.page.captures._pending
    assert judged is not None
    hand = judged.new.analysed.skeleton.joints["left_hand"]
    assert hand.source == "hand"
    assert np.hypot(*(hand.pixel - moved)) < 2.0

    desk.from_folder(world.root / "psi", "stance_primary")
    assert desk.state is State.STANCE_DONE


def test_a_hidden_view_costs_nothing(open_desk: OpenDesk, person: SimulatedPatient) -> None:
    desk = open_desk(Corner(person))
    desk.live()
    desk.page.hide()
    QApplication.processEvents()
    desk.settle(0.4)
    guidance, painted = desk.deck.live.guidance, desk.screen.live_view.frames_painted
    number = desk.deck.live._pictures.take()
    desk.settle(0.8)
    assert desk.deck.live.guidance is guidance
    assert desk.screen.live_view.frames_painted == painted
    assert desk.deck.live._pictures.take() is number is None
    desk.page.show()
    desk.wait_until(lambda: desk.screen.live_view.frames_painted > painted + 5, "the picture again", SLOW_S)


def test_a_still_patient_does_not_count_as_still_without_readings() -> None:
    from app.live import CaptureAssistant
    from core.guidance import Guidance, Reading

    good = Guidance(0.0, {"stillness": Reading("stillness", 1.0, "mm", "good")}, person=True)
    moving = replace(good, readings={"stillness": Reading("stillness", 30.0, "mm", "bad", "Hold still.")})
    assistant = CaptureAssistant()
    assistant.look(good, 0.0)
    assistant.look(good, 5.0)
    assert assistant.phase is Phase.WATCHING, "by hand only, unless it was asked for"
    assistant.set_automatic(True)
    assistant.look(moving, 6.0)
    assistant.look(good, 7.0)
    assistant.look(good, 7.5)
    assert assistant.phase is Phase.WATCHING, "not still for long enough"
    assistant.look(good, 7.9)
    assert assistant.phase is Phase.COUNTDOWN
    assert assistant.count(7.9) == 3
    assistant.look(moving, 8.4)
    assert assistant.phase is Phase.WATCHING, "the patient moved within the countdown"
    assert assistant.message
    assistant.press(9.0)
    assistant.look(moving, 9.5)
    assert assistant.phase is Phase.COUNTDOWN, "what was asked for by hand goes on"
    assert not assistant.tick(11.9)
    assert assistant.tick(12.0)
    assert not assistant.tick(12.1), "once"
    assistant.done()
    assert assistant.phase is Phase.WATCHING
