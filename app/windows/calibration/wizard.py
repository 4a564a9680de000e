"""The sheet "Cameras and calibration": what happens on its pages."""

from __future__ import annotations

from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

from PySide6.QtCore import QStandardPaths, Slot
from PySide6.QtWidgets import QFileDialog, QWidget

from app.tasks import TaskFailure
from app.widgets.sheet import Sheet
from app.windows.calibration.board_choice import BoardChoice, store_choice
from app.windows.calibration.known_cameras import KnownCamera, ask_cameras
from app.windows.calibration.last_checks import load_checks, store_check
from app.windows.calibration.result_page import Solved
from app.windows.calibration.wizard_base import CLOSE_WAIT_S, CalibrationSheet, Opened
from app.windows.calibration.work import Checking, Collecting

if TYPE_CHECKING:
    from app.context import AppContext
    from core.calibration.profile import CalibrationProfile
    from core.progress import Progress


class CalibrationWizard(CalibrationSheet):
    """Choose a camera, print the board, collect views, judge, save; the daily check.

    Parameters
    ----------
    parent : QWidget
    context : AppContext
    """

    def __init__(self, parent: QWidget, context: AppContext) -> None:
        super().__init__(parent, context)
        self.feed.ticked.connect(self._on_tick)
        self._connect()
        self._show(self.choose)

    def _connect(self) -> None:
        self.choose.look_again.connect(self.look_for_cameras)
        self.choose.calibrate.connect(self._start_calibration)
        self.choose.check.connect(self._start_check)
        self.board.back.connect(lambda: self._show(self.choose))
        self.board.save_pdf.connect(self._save_pdf)
        self.board.ready.connect(self._board_ready)
        self.collect.back.connect(self._leave_collecting)
        self.collect.take_now.connect(self._take_now)
        self.collect.remove_view.connect(self._remove_view)
        self.collect.solve.connect(self._solve)
        self.collect.open_again.connect(self._open_again)
        self.result.go_on.connect(self._go_on)
        self.result.save.connect(self._save)
        self.result.done.connect(self.close_sheet)
        self.check.back.connect(self._leave_check)
        self.check.again.connect(self._check_again)
        self.check.calibrate.connect(self._calibrate_after_check)
        self.check.open_again.connect(self._open_again)
        self.check.done.connect(self._leave_check)
        for page in (self.collect, self.check):
            page.room_changed.connect(self.feed.set_room)

    # --- pages ------------------------------------------------------------------------------------------

    def open(self, focus: QWidget | None = None) -> Sheet:
        """Show the sheet and look for cameras."""
        super().open(focus or self.choose.again)
        self.look_for_cameras()
        return self

    @Slot()
    def look_for_cameras(self) -> None:
        """Ask what is connected; it may take seconds."""
        self.choose.set_looking()
        source, store = self._context.cameras, self._context.profiles
        task = self._context.tasks.start(
            "Looking for cameras", lambda progress: ask_cameras(source, store, progress)
        )
        task.finished.connect(self._cameras_found)
        task.failed.connect(self._looking_failed)

    @Slot(object)
    def _cameras_found(self, cameras: list[KnownCamera]) -> None:
        if not self._closing:
            self.choose.set_cameras(cameras, load_checks(self._folder))
            if self.stack.currentWidget() is self.choose:
                self.choose.table.setFocus()

    @Slot(object)
    def _looking_failed(self, failure: TaskFailure) -> None:
        if not self._closing:
            self.choose.set_cameras([], {})
            self.banner.show_failure(failure)

    @Slot(object)
    def _start_calibration(self, known: KnownCamera) -> None:
        self._known = known
        self.board.set_choice(self._choice)
        self._show(self.board)
        self.board.width_edit.setFocus()

    @Slot(object)
    def _start_check(self, known: KnownCamera) -> None:
        self._known = known
        if self._choice.width_m is None:
            self._show(self.choose)
            self.banner.show_warning(
                "The board of this workstation has not been measured.", "Calibrate the camera first."
            )
            return
        self._open_camera(self._begin_check)

    # --- the board --------------------------------------------------------------------------------------

    @Slot(str)
    def _save_pdf(self, paper: str) -> None:
        documents = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
        start = str(Path(documents) / f"geoderm-calibration-board-{paper}.pdf")
        path, _ = QFileDialog.getSaveFileName(self, "Save the board", start, "PDF (*.pdf)")
        if not path:
            return

        def work(progress: Progress) -> Path:
            from core.calibration.board_pdf import board_pdf

            target = Path(path)
            target.write_bytes(board_pdf(paper))
            return target

        task = self._context.tasks.start("Drawing the board", work, cancellable=False)
        task.finished.connect(
            lambda target: self.board.tell_saved(f"Saved as {target.name}. Print it at 100 %.")
        )
        task.failed.connect(self.banner.show_failure)

    @Slot(object)
    def _board_ready(self, choice: BoardChoice) -> None:
        self._choice = choice
        try:
            store_choice(self._folder, choice)
        except OSError as error:
            self.banner.show_error(
                f"The board could not be remembered ({error.strerror}).", "Check the free space of the disk."
            )
            return
        self._saved = False
        self._collecting = None
        self._open_camera(self._begin_collecting)

    @Slot()
    def _open_again(self) -> None:
        if self.stack.currentWidget() is self.check:
            self._open_camera(self._begin_check)
        else:
            self._open_camera(self._begin_collecting)

    @Slot()
    def _on_tick(self) -> None:
        tick = self.feed.take()
        if tick is None or self._closing:
            return
        page = self.stack.currentWidget()
        if page is self.collect:
            self.collect.show_tick(tick)
        elif page is self.check:
            before = self.check.result
            self.check.show_tick(tick)
            if before is None and self.check.result is not None:
                self._primary = self.check.primary
                self._check_ended()

    # --- collecting -------------------------------------------------------------------------------------

    def _begin_collecting(self, opened: Opened) -> None:
        from app.workflows.calibrating import CalibrationSession

        if self._collecting is None:
            session = CalibrationSession(
                opened.camera.identity, self._choice.spec, opened.together, opened.has_color
            )
            self._collecting = Collecting(session)
            self.collect.begin(has_color=opened.has_color, together=opened.together)
        self.collect.banner.clear()
        self._show(self.collect)
        self.feed.begin(opened.camera, self._collecting, opened.streams)

    @Slot()
    def _take_now(self) -> None:
        if self._collecting is not None:
            self.feed.ask(self._collecting.take)

    @Slot(int)
    def _remove_view(self, number: int) -> None:
        collecting = self._collecting
        if collecting is not None:
            self.feed.ask(lambda: collecting.remove(number))

    def _leave_collecting(self) -> None:
        def leave() -> None:
            self._collecting = None
            self._give_back()
            self._show(self.board)

        if self._unsaved_views:
            self._ask_to_drop("Go back to the board?", "Go back", leave)
        else:
            leave()

    # --- solving ----------------------------------------------------------------------------------------

    @Slot()
    def _solve(self) -> None:
        collecting, known = self._collecting, self._known
        if collecting is None or known is None:
            return
        session, store, paused = collecting.session, self._context.profiles, Event()
        self.feed.pause(paused.set)

        def work(progress: Progress) -> Solved:
            from app.windows.calibration.residuals import corner_residuals

            paused.wait(CLOSE_WAIT_S)  # the session belongs to one thread at a time
            result = session.solve(progress)
            depth, color = corner_residuals(result, session.views, session.spec)
            newest = store.newest(result.profile.depth_serial, result.profile.color_serial)
            return Solved(result, depth, color, 1 if newest is None else newest.version + 1)

        task = self._context.tasks.start("Calibrating", work)
        self.overlay.attach(task)
        task.finished.connect(self._on_solved)
        task.failed.connect(self._on_not_solved)
        task.cancelled.connect(self._go_on)

    @Slot(object)
    def _on_solved(self, solved: Solved) -> None:
        if not self._closing:
            self.result.show_result(solved)
            self._show(self.result)

    @Slot(object)
    def _on_not_solved(self, failure: TaskFailure) -> None:
        if not self._closing:
            self._go_on()
            self.banner.show_failure(failure)

    @Slot()
    def _go_on(self) -> None:
        opened, collecting = self._opened, self._collecting
        if self._closing or opened is None or collecting is None:
            return
        self._show(self.collect)
        self.feed.begin(opened.camera, collecting, frozenset())

    @Slot()
    def _save(self) -> None:
        solved, collecting = self.result.solved, self._collecting
        if solved is None or collecting is None:
            return
        store, session = self._context.profiles, collecting.session
        self.result.save_button.setEnabled(False)
        task = self._context.tasks.start(
            "Saving the calibration",
            lambda progress: session.save(store, solved.result),
            cancellable=False,
        )
        task.finished.connect(self._on_saved)
        task.failed.connect(self.banner.show_failure)
        task.ended.connect(lambda: self.result.save_button.setEnabled(True))

    @Slot(object)
    def _on_saved(self, profile: CalibrationProfile) -> None:
        self._saved = True
        if self._closing:
            return
        self.result.show_saved(profile)
        self._primary = self.result.primary
        self.result.done_button.setFocus()
        self._give_back()

    # --- the daily check --------------------------------------------------------------------------------

    def _begin_check(self, opened: Opened) -> None:
        from app.workflows.calibrating import CalibrationSession
        from core.calibration.daily_check import DailyCheck

        profile = opened.camera.profile
        if profile is None:
            self.banner.show_warning("This camera is not calibrated yet.", "Calibrate it first.")
            self._give_back()
            return
        spec = self._choice.spec
        session = CalibrationSession(
            opened.camera.identity, spec, opened.together, opened.has_color, repeats=True
        )
        self._checking = Checking(session, DailyCheck(profile, spec))
        self.check.begin(has_color=opened.has_color, together=opened.together)
        self._show(self.check)
        self.feed.begin(opened.camera, self._checking, opened.streams)

    def _check_ended(self) -> None:
        checking, result = self._checking, self.check.result
        self.feed.pause()
        if checking is None or result is None:
            return
        if result.verdict != "cannot tell":
            try:
                store_check(self._folder, checking.check.profile.id, result.verdict)
            except OSError as error:
                self.banner.show_error(
                    f"The check could not be remembered ({error.strerror}).",
                    "Check the free space of the disk.",
                )

    @Slot()
    def _check_again(self) -> None:
        if self._opened is None:
            self._open_camera(self._begin_check)
        else:
            opened = self._opened
            self._begin_check(Opened(opened.camera, opened.together, opened.has_color, frozenset()))

    @Slot()
    def _leave_check(self) -> None:
        self._checking = None
        self._give_back()
        self._show(self.choose)
        self.look_for_cameras()

    @Slot()
    def _calibrate_after_check(self) -> None:
        self._checking = None
        self._give_back()
        if self._known is not None:
            self._start_calibration(self._known)
