"""The demonstration by itself: first visit and follow-up through the real windows, results on disk."""

from __future__ import annotations

import csv
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.demo.clinic import FOLLOW_UP_STANCE, sample_lesions
from app.demo.driver import WORK_TIMEOUT_S, DriverError, WindowDriver
from app.demo.guide import write_guide_pictures
from app.demo.places import site_in_words
from app.demo.scene import DemoCameras
from app.gui import application, open_clinic, open_window
from app.logs import log_path, start_logging
from app.workflows.table import State

if TYPE_CHECKING:
    from PySide6.QtWidgets import QComboBox

    from app.windows.main_window import MainWindow
    from core.records import Observation
    from devices.simulator.truth import CaptureTruth

DEMO_USER = ("asommer", "Dr Ada Sommer", "demo-clinic-2026")
CORRECT_FROM_MM = 25.0
CALIBRATION_VIEWS = 5


@dataclass(frozen=True)
class LesionError:
    """How far a relocated lesion was from where it truly is."""

    lesion: str
    number: int
    status: str
    error_mm: float | None
    radius95_mm: float | None
    visible: bool


def run_unattended(
    out: Path, *, guide: Path | None = None, lesions: int = 8, data: Path | None = None
) -> int:
    """Drive the windows; leave pictures, the report and the error table in ``out``.

    Returns
    -------
    int
        0, or 3 if the windows did not do what they should.
    """
    start_logging()
    started = time.perf_counter()
    pictures = out / "pictures"
    shutil.rmtree(pictures, ignore_errors=True)
    pictures.mkdir(parents=True, exist_ok=True)
    clinic = data or Path(tempfile.mkdtemp(prefix="geoderm-demo-")) / "clinic"
    application()
    cameras = DemoCameras()
    context = open_clinic(clinic, cameras=cameras, demonstration=True)
    try:
        window = open_window(context)
        window.show()
        tour = Tour(window, cameras, WindowDriver(window, pictures), out, lesions)
        try:
            errors = tour.run()
        except DriverError as error:
            print(f"demo: {error}\ndemo: see {pictures / 'stuck.png'} and {log_path()}", flush=True)
            return 3
        finally:
            window.close()
    finally:
        context.close()
        if data is None:
            shutil.rmtree(clinic.parent, ignore_errors=True)
    table = _write_table(out / "relocation_errors.csv", errors)
    if guide is not None:
        write_guide_pictures(pictures, out / "report.pdf", guide)
    print(table)
    print(
        f"\nDone in {time.perf_counter() - started:.0f} s. In {out}/:\n"
        f"  pictures/               {len(list(pictures.glob('*.png')))} screenshots of the windows\n"
        "  report.pdf              the report of the follow-up\n"
        "  relocation_errors.csv   the table above\n"
        "The joints came from the skeleton tracker; the patient is simulated: no clinical figures.",
        flush=True,
    )
    return 0


class Tour:
    """The way of one patient through the windows.

    Parameters
    ----------
    window : MainWindow
    cameras : DemoCameras
    hands : WindowDriver
    out : Path
    lesions : int
        How many are marked.
    """

    def __init__(
        self, window: MainWindow, cameras: DemoCameras, hands: WindowDriver, out: Path, lesions: int
    ) -> None:
        self.window, self.cameras, self.hands, self.out, self.lesions = window, cameras, hands, out, lesions
        self.store = window.context.store
        self._marked: list[str] = []

    def run(self) -> list[LesionError]:
        """Everything; returns the relocation errors of the follow-up."""
        self._say("signing in")
        self._first_start()
        self._say("a new patient")
        self._new_patient()
        self._say("first visit: stance")
        self._visit_captures("psi", "psi")
        self._say("first visit: marking lesions")
        self._mark_lesions()
        self._close_visit("review")
        self._say("follow-up: stance and capture")
        self.hands.click("start_visit")
        self._visit_captures("psi", FOLLOW_UP_STANCE)
        self._say("follow-up: checking lesions")
        errors = self._check_lesions()
        self._close_visit("follow_up_review")
        self._say("comparison and report")
        self._look_back()
        self._say("calibrating cameras")
        self._calibrate()
        return errors

    def _say(self, what: str) -> None:
        print(f"demo: {what}", flush=True)

    def _idle(self, what: str) -> None:
        overlay = self.window.stack.currentWidget().overlay  # type: ignore[attr-defined]
        self.hands.settle(0.2)
        self.hands.wait_until(lambda: overlay.task is None, what, WORK_TIMEOUT_S)

    def _first_start(self) -> None:
        username, name, password = DEMO_USER
        self.hands.type("login_display_name", name)
        self.hands.type("login_username", username)
        self.hands.type("login_password", password)
        self.hands.shoot("first_start")
        self.hands.type("login_repeat", password, enter=True)
        self.hands.find("patients_page")
        self.hands.click("log_out")
        self.hands.type("login_password", password)
        self.hands.shoot("login")
        self.hands.click("login_submit")
        self.hands.find("patients_page")

    def _new_patient(self) -> None:
        from core.records import PatientDraft

        user = self.window.context.user_id
        for draft in (
            PatientDraft("Åkesson", "Maja", clinic_number="GD-0871", sex="F"),
            PatientDraft("Fournier", "Rémi", clinic_number="GD-0915", sex="M"),
            PatientDraft("Papadopoulou", "Eleni", clinic_number="GD-0998", sex="F"),
        ):
            self.store.patients.create(draft, by=user)
        self.window.show_patients()
        self.hands.click("new_patient")
        self.hands.type("patient_family_name", "Novák")
        self.hands.type("patient_given_name", "Jiří")
        self.hands.type("patient_birth_date", "1986-05-14")
        self.hands.choose("patient_sex", "Male")
        self.hands.type("patient_clinic_number", "GD-1042")
        self.hands.shoot("new_patient")
        self.hands.click("patient_save")
        self.hands.find("patient_page")
        self.hands.shoot("patient_new")
        self.hands.click("nav_patients")
        self.hands.type("patient_search", "novak")
        self.hands.settle(0.4)
        self.hands.shoot("patients_search")
        self.hands.type("patient_search", "", enter=False)
        self.hands.settle(0.4)
        self.hands.shoot("patients")
        self.hands.type("patient_search", "novak", enter=True)
        self.hands.find("patient_page")
        self.hands.click("start_visit")

    # -- a visit -----------------------------------------------------------------------------------

    @property
    def _page(self):  # type: ignore[no-untyped-def]
        from app.windows.visit.page import VisitPage

        page = self.window.stack.currentWidget()
        if not isinstance(page, VisitPage):
            raise DriverError("the page of the visit is not shown")
        return page

    def _visit_captures(self, stance: str, working: str) -> None:
        self.hands.find("visit_page")
        page = self._page
        self.hands.wait_until(lambda: page.captures.deck.camera is not None, "the camera to open", 60)
        self._choose_stance("stance_stance", stance)
        self.hands.wait_until(
            lambda: page.captures.stance.live_view.image_size[0] > 0, "the live picture", 60
        )
        self.hands.settle(0.5)
        self.hands.shoot("stance_live")
        self._take("stance_primary", State.STANCE_DONE)
        self.hands.shoot("stance")
        self.hands.click("stance_primary")
        self._choose_stance("capture_stance", working)
        self._take("capture_primary", State.CAPTURE_DONE)
        self.hands.shoot("capture")
        self.hands.click("capture_primary")
        self._idle("the lesions step")

    def _take(self, button: str, done: State) -> None:
        """Place the patient, count down, capture; a capture with doubts is used as it is."""
        page = self._page
        live = page.captures.deck.live
        self.hands.wait_until(lambda: live.guidance is not None, "the readings", 60)
        camera = page.captures.deck.camera
        self.hands.wait_until(lambda: not camera.changing, "the patient to stand", 60)
        self.hands.settle(2.0)
        self.hands.shoot(f"{button.partition('_')[0]}_assistant")
        self.hands.click(button)
        self.hands.settle(0.3)
        self.hands.shoot("countdown")
        self.hands.wait_until(lambda: not page.captures.assist.busy, "the capture", WORK_TIMEOUT_S)
        self._idle("the capture")
        if page.session.state is State.STANCE_CHECK:
            self.hands.click("stance_secondary")
            self._idle("the stance to be stored")
        elif page.session.state is not done:
            self.hands.click(button)
            self._idle("the capture to be stored")
        self.hands.wait_until(lambda: page.session.state is done, "the stored capture")

    def _choose_stance(self, name: str, stance: str) -> None:
        from PySide6.QtWidgets import QComboBox

        box: QComboBox = self.hands.find(name, QComboBox)
        row = box.findData(stance)
        if row < 0:
            raise DriverError(f"the simulated patient has no stance '{stance}'")
        self.hands.choose(name, box.itemText(row))

    @property
    def _truth(self) -> CaptureTruth:
        last = self.cameras.camera.last
        if last is None:
            raise DriverError("the simulated camera took no capture")
        return last.truth

    def _mark_lesions(self) -> None:
        truth, patient = self._truth, self.cameras.camera.patient
        page = self._page
        with tempfile.TemporaryDirectory() as folder:
            for i, name in enumerate(sample_lesions(truth, patient.lesion_ids, self.lesions)):
                u, v = truth.mole_pixels[truth.mole_ids.index(name)]
                before = len(page.session.snapshot.lesions)
                self.hands.click_photo("lesion_photo", float(u), float(v))
                self.hands.wait_until(
                    lambda n=before: len(page.session.snapshot.lesions) == n + 1,
                    f"lesion {i + 1} to be marked",
                )
                self._marked.append(name)
                if i < 4:
                    image = Path(folder) / f"{name}.png"
                    image.write_bytes(patient.dermoscopy_png(name, 1))
                    page.attach_dermoscopy([image])
                self._describe(name, i)
            page.lesions.screen.photo.fit()
            self.hands.settle(0.5)
            self.hands.shoot("mark")
            bad = Path(folder) / "notes.png"
            bad.write_bytes(b"this is not a picture")
            page.attach_dermoscopy([bad])
            self.hands.shoot("mark_bad_image")
            page.banner.clear()
        self.hands.click_photo("lesion_photo", 30.0, 30.0)
        page.lesions.screen.photo.fit()
        self.hands.shoot("mark_background")
        page.banner.clear()
        self.hands.click("pane_body")
        self.hands.settle(3.0)
        self.hands.shoot("mark_body")
        self.hands.click("pane_photo")
        self.hands.click("lesions_primary")

    def _describe(self, name: str, i: int) -> None:
        site, side = site_in_words(self._truth, name)
        self.hands.type("site_search", site[:-2])
        self.hands.settle(0.3)
        if i == 0:
            self.hands.shoot("mark_site")
        self.hands.type("site_search", site, enter=True)
        if side:
            self.hands.choose("site_side", side)

    def _close_visit(self, picture: str) -> None:
        self.hands.find("review_screen")
        self.hands.type("visit_note", "Next look in three months.")
        self.hands.shoot(picture)
        self.hands.click("review_primary")
        self.hands.settle(0.5)
        self.hands.shoot(f"{picture}_closed")
        self.hands.click("review_secondary")
        self.hands.find("patient_page")

    # -- the follow-up -----------------------------------------------------------------------------

    def _check_lesions(self) -> list[LesionError]:
        page, truth = self._page, self._truth
        lesions = sorted(page.session.snapshot.lesions, key=lambda lesion: lesion.number)
        errors = []
        page.lesions.select(lesions[0].id)
        page.lesions.screen.photo.fit()
        self.hands.settle(3.0)
        self.hands.shoot("follow_up")
        self.hands.click("explain_lesion")
        self._idle("the explanation")
        self.hands.settle(0.5)
        self.hands.shoot("explain")
        self.hands.click("explain_sheet_close")
        self.hands.click("pane_compare")
        self.hands.settle(0.5)
        self.hands.shoot("follow_up_previous")
        for lesion, name in zip(lesions, self._marked, strict=True):
            o: Observation | None = page.session.snapshot.in_force(lesion.id)
            errors.append(_error(lesion.number, name, o, truth))
            page.lesions.select(lesion.id)
            self._decide(page, lesion.id, name, o, errors[-1], truth)
        self._mark_new(page, truth)
        image = self.cameras.camera.patient.dermoscopy_png(self._marked[0], 2)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "second.png"
            file.write_bytes(image)
            page.lesions.select(lesions[0].id)
            page.attach_dermoscopy([file])
        self.hands.click("pane_photo")
        page.lesions.screen.photo.fit()
        self.hands.settle(0.5)
        self.hands.shoot("follow_up_decided")
        self.hands.click("lesions_primary")
        return errors

    def _decide(
        self,
        page,  # type: ignore[no-untyped-def]
        lesion_id: int,
        name: str,
        o: Observation | None,
        error: LesionError,
        truth: CaptureTruth,
    ) -> None:
        """As a doctor would: drag a wrong marker onto the mole, say what is not in view, confirm the rest."""
        if not page.session.status(lesion_id).needs_doctor:
            return
        i = truth.mole_ids.index(name)
        placed = o is not None and o.pixel is not None
        u, v = (float(c) for c in truth.mole_pixels[i])
        if not truth.mole_visible[i]:
            self.hands.click("lesion_not_in_view" if placed else "confirm_lesion")
        elif not placed:
            self.hands.click("place_lesion")
            self.hands.click_photo("lesion_photo", u, v)
        elif (error.error_mm or 0.0) > CORRECT_FROM_MM:
            self.hands.drag_photo("lesion_photo", o.pixel, (u, v))  # type: ignore[union-attr, arg-type]
        else:
            self.hands.click("confirm_lesion")
        self.hands.wait_until(
            lambda: not page.session.status(lesion_id).needs_doctor, f"the decision on lesion {error.number}"
        )

    def _mark_new(self, page, truth: CaptureTruth) -> None:  # type: ignore[no-untyped-def]
        new = [i for i, name in enumerate(truth.mole_ids) if name.startswith("N") and truth.mole_visible[i]]
        others = [
            i for i, name in enumerate(truth.mole_ids) if name not in self._marked and truth.mole_visible[i]
        ]
        chosen = (new or others)[0]
        before = len(page.session.snapshot.lesions)
        self.hands.click("mark_new_lesion")
        self.hands.click_photo("lesion_photo", *(float(c) for c in truth.mole_pixels[chosen]))
        self.hands.wait_until(lambda: len(page.session.snapshot.lesions) == before + 1, "the new lesion")

    def _look_back(self) -> None:
        page = self.window.stack.currentWidget()
        first = self.store.lesions.list(page.patient_id)[0]  # type: ignore[attr-defined]
        page.select(str(first.id))  # type: ignore[attr-defined]
        self.hands.settle(0.5)
        self.hands.shoot("patient_photo")
        self.hands.click("patient_pane_body")
        self.hands.wait_until(lambda: not self.window.context.tasks.busy, "the 3D body", 60)
        self.hands.settle(1.5)
        self.hands.shoot("patient")
        self.hands.click("compare_dermoscopy")
        self.hands.settle(0.8)
        self.hands.shoot("compare")
        self.hands.click("compare_overlay")
        self.hands.settle(0.5)
        self.hands.shoot("compare_overlay")
        self.hands.click("compare_sheet_close")
        report = self.out / "report.pdf"
        visit = self.store.visits.list(page.patient_id)[-1]  # type: ignore[attr-defined]
        page.export_report(visit.id, report)  # type: ignore[attr-defined]
        self.hands.wait_until(
            lambda: report.exists() and not self.window.context.tasks.busy, "the report", WORK_TIMEOUT_S
        )
        self.hands.shoot("patient_report")
        self.hands.click("privacy_mode")
        self.hands.shoot("patient_privacy")
        if "Nov" in self.window.windowTitle():
            raise DriverError("the window's title names the patient in privacy mode")
        self.hands.click("privacy_mode")

    def _calibrate(self) -> None:
        """Collect some views of the simulated board, and leave without a calibration."""
        from app.windows.calibration.wizard import CalibrationWizard

        self.hands.click("cameras_calibration")
        wizard = self.hands.find("calibration_wizard", CalibrationWizard)
        start = self.hands.find("calibration_start")
        self.hands.wait_until(lambda: start.isEnabled(), "the list of cameras", 60)
        self.hands.click("calibration_start")
        self.hands.type("board_width", "378")
        self.hands.click("board_next")
        page = wizard.collect

        def enough() -> bool:
            return page.findings is not None and len(page.findings.rows) >= CALIBRATION_VIEWS

        self.hands.wait_until(enough, f"{CALIBRATION_VIEWS} views of the board", WORK_TIMEOUT_S)
        self.hands.shoot("calibration")
        self.hands.click("calibration_wizard_close")
        self.hands.click("sheet_confirm")
        self.hands.settle(0.5)


def _error(number: int, name: str, o: Observation | None, truth: CaptureTruth) -> LesionError:
    i = truth.mole_ids.index(name)
    point = None if o is None else o.proposed_point_m
    distance = None
    if point is not None:
        distance = float(1000 * np.linalg.norm(np.array(point) - truth.mole_points_m[i]))
    radius = None if o is None or o.radius95_m is None else 1000 * o.radius95_m
    status = "not looked for" if o is None else o.status
    return LesionError(name, number, status, distance, radius, bool(truth.mole_visible[i]))


def _write_table(path: Path, errors: list[LesionError]) -> str:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["lesion", "simulated_id", "status", "error_mm", "radius95_mm", "visible"])
        for e in errors:
            writer.writerow(
                [e.number, e.lesion, e.status, _mm(e.error_mm), _mm(e.radius95_mm), int(e.visible)]
            )
    lines = ["", "lesion  status        error mm  radius95 mm  in view"]
    lines += [
        f"{e.number:>6}  {e.status:<12}  {_mm(e.error_mm):>8}  {_mm(e.radius95_mm):>11}  "
        f"{'yes' if e.visible else 'no'}"
        for e in errors
    ]
    found = [e.error_mm for e in errors if e.error_mm is not None]
    if found:
        lines.append(
            f"mean {np.mean(found):.1f} mm, median {np.median(found):.1f} mm, {len(found)} of {len(errors)}"
        )
    return "\n".join(lines)


def _mm(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
