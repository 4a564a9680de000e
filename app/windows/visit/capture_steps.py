"""What happens in steps 1 and 2: from the camera to a stored, analysed capture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Slot

from app.tasks import TaskFailure
from app.windows.visit.camera_deck import CameraDeck
from app.windows.visit.capture_screen import CaptureScreen
from app.windows.visit.host import VisitHost
from app.windows.visit.pictures import stored_picture
from app.workflows.analysis import NewCapture, take
from app.workflows.search import SearchOutcome
from app.workflows.table import Event, State
from app.workflows.wording import when
from core.progress import Progress, ScaledProgress

if TYPE_CHECKING:
    from core.records import CaptureRecord

_STANCE_STATES = (State.STANCE, State.STANCE_CHECK, State.STANCE_DONE)


class CaptureSteps(QObject):
    """Drives the two capture screens and the camera they share."""

    def __init__(self, host: VisitHost, parent: QObject) -> None:
        super().__init__(parent)
        self._host = host
        self.deck = CameraDeck(host.context, self)
        self.stance = CaptureScreen("stance", self.deck)
        self.capture = CaptureScreen("capture", self.deck)
        self._current: CaptureScreen | None = None
        self._shown: tuple[object, ...] | None = None
        self.stance.set_stance("psi")
        self.stance.set_choices_visible(view=False)
        for screen in (self.stance, self.capture):
            screen.pose_changed.connect(self._on_pose)
            screen.live_toggled.connect(self._on_live)
        self.stance.primary_clicked.connect(self._stance_primary)
        self.stance.secondary_clicked.connect(self._stance_secondary)
        self.capture.primary_clicked.connect(self._capture_primary)
        self.capture.secondary_clicked.connect(self._take_working)
        self.deck.changed.connect(self.refresh)
        self.deck.failed.connect(self._on_camera_failed)

    # --- what is shown -------------------------------------------------------------------------------

    def enter(self, state: State) -> None:
        """Show the screen of a state; called whenever the session changes."""
        screen = self.stance if state in _STANCE_STATES else self.capture
        if screen is not self._current:
            self._current = screen
            self._shown = None
            screen.refresh_cameras()
            if not self.deck.camera_id:
                self._choose_default()
            self._stand()
        self.refresh()

    def leave(self) -> None:
        """Another step is shown: the camera may rest."""
        self._current = None
        self.deck.look(False)

    @Slot()
    def refresh(self) -> None:
        """Show the session's state on the current screen."""
        if self._current is self.stance:
            self._show_stance()
        elif self._current is self.capture:
            self._show_capture()

    def _show_stance(self) -> None:
        session, screen = self._host.session, self.stance
        screen.panel.show_state(session.info)
        candidate = session.stance_candidate
        screen.corrections.show_list("Ask the patient", () if candidate is None else candidate.corrections)
        ready = self.deck.camera is not None
        screen.panel.primary.setEnabled(ready or session.state is State.STANCE_DONE)
        screen.secondary.setVisible(session.state is not State.STANCE)
        screen.secondary.setEnabled(ready or session.state is State.STANCE_CHECK)
        if session.state is State.STANCE_CHECK and candidate is not None:
            screen.secondary.setText("Use as it is")
            screen.warnings.show_list("Please note", candidate.warnings)
            self._show_once(screen, ("candidate", id(candidate)), lambda: _show_new(screen, candidate))
        elif session.state is State.STANCE_DONE and session.snapshot.stance is not None:
            screen.secondary.setText("Capture again")
            self._show_record(screen, session.snapshot.stance)
        else:
            screen.warnings.show_list("", ())
            self._show_live(screen)

    def _show_capture(self) -> None:
        session, screen = self._host.session, self.capture
        views = session.snapshot.views
        done = session.state is State.CAPTURE_DONE
        pending = session.pending_count
        primary = None
        if done:
            primary = f"Find {pending} lesion{'s'[: pending > 1]}" if pending else "Continue to lesions"
        screen.panel.show_state(session.info, primary)
        ready = self.deck.camera is not None
        screen.set_choices_visible(view=self.deck.camera is None or self.deck.kind != "folder")
        screen.show_taken(tuple(views))
        screen.panel.primary.setEnabled(done or ready)
        screen.secondary.setVisible(done)
        screen.secondary.setEnabled(ready)
        taken = views.get(screen.view)
        screen.secondary.setText("Capture again" if taken is not None else f"Capture {screen.view}")
        if done and taken is not None:
            self._show_record(screen, session.snapshot.captures[taken])
        else:
            screen.warnings.show_list("", ())
            self._show_live(screen)

    def _show_live(self, screen: CaptureScreen) -> None:
        self._shown = None
        screen.offer_live(False)
        screen.show_preview()
        self.deck.look(True)

    def _show_record(self, screen: CaptureScreen, record: CaptureRecord) -> None:
        session = self._host.session
        ready = session.is_ready(record.id)

        def show() -> None:
            caption = f"Captured {when(record.taken_at)}, {record.frame_count} depth frames"
            if ready:
                analysed = session.analysed(record.id)
                seen, all_joints = len(analysed.skeleton.visible()), len(analysed.skeleton.joints)
                screen.warnings.show_list("Please note", analysed.warnings)
                screen.show_capture(analysed, f"{caption}. {seen} of {all_joints} joints seen.")
            else:
                screen.warnings.show_list("", ())
                screen.show_plain(stored_picture(session.store, record), caption)

        self._show_once(screen, (record.id, ready), show)

    def _show_once(self, screen: CaptureScreen, key: tuple[object, ...], show: Callable[[], None]) -> None:
        screen.offer_live(self.deck.camera is not None)
        if screen.live_wanted:
            self._shown = None
            screen.show_preview()
            self.deck.look(True)
            return
        self.deck.look(False)
        if self._shown != (screen, *key):
            self._shown = (screen, *key)
            show()

    # --- the camera ----------------------------------------------------------------------------------

    def _choose_default(self) -> None:
        """The camera used last; else one that is connected. A simulated patient only in a demonstration."""
        context = self._host.context
        choices = self._host.attempt(self.deck.choices) or []
        allowed = [c for c in choices if c.kind != "simulator" or context.demonstration]
        chosen = next((c for c in allowed if c.id == context.settings.camera_id), None)
        chosen = chosen or next(iter(allowed), None)
        if chosen is not None:
            self.deck.choose(chosen.id)

    @Slot()
    def _on_pose(self) -> None:
        self._stand()
        self.refresh()

    @Slot()
    def _on_live(self) -> None:
        self.refresh()

    def _stand(self) -> None:
        if self._current is not None:
            number = self._host.session.snapshot.visit.number
            view = "front" if self._current is self.stance else self._current.view
            self.deck.stand(self._current.stance, view, number)

    @Slot(object)
    def _on_camera_failed(self, failure: TaskFailure) -> None:
        self._host.banner.show_error(
            failure.message, failure.advice or "Choose another camera, capture folder or recording."
        )

    # --- capturing -----------------------------------------------------------------------------------

    @Slot()
    def _stance_primary(self) -> None:
        session = self._host.session
        if session.state is State.STANCE_DONE:
            self._host.attempt(lambda: session.fire(Event.GO_CAPTURE))
        else:
            self._take_stance()

    @Slot()
    def _stance_secondary(self) -> None:
        session = self._host.session
        candidate = session.stance_candidate
        if session.state is State.STANCE_CHECK and candidate is not None:
            self._host.run(
                "Saving the capture",
                lambda progress: session.store_capture(candidate, progress),
                lambda _: session.adopt_accepted_stance(),
            )
        else:
            self._take_stance()

    def _take_stance(self) -> None:
        camera, session, frames = self.deck.camera, self._host.session, self._host.frames
        if camera is None:
            self._host.banner.show_warning("No camera is open.", "Choose a camera or open a recording.")
            return

        def work(progress: Progress) -> NewCapture:
            capture = take(
                camera, view=None, stance="psi", frames=frames, progress=ScaledProgress(progress, 0.0, 0.4)
            )
            return session.take_stance(capture, ScaledProgress(progress, 0.4, 1.0))

        self._host.run("Capturing the stance", work, session.adopt_stance)

    @Slot()
    def _capture_primary(self) -> None:
        session = self._host.session
        if session.state is State.CAPTURE:
            self._take_working()
        elif session.pending_count:
            self._host.run("Finding the lesions", session.find_lesions, self._found)
        else:
            self._host.attempt(lambda: session.fire(Event.GO_LESIONS))

    def _found(self, outcome: SearchOutcome) -> None:
        session = self._host.session
        self._host.attempt(lambda: session.adopt_search(outcome))
        if outcome.warnings:
            self._host.banner.show_warning(outcome.warnings[0], " ".join(outcome.warnings[1:]))

    @Slot()
    def _take_working(self) -> None:
        camera, session, frames = self.deck.camera, self._host.session, self._host.frames
        if camera is None:
            self._host.banner.show_warning("No camera is open.", "Choose a camera or open a recording.")
            return
        view = None if self.deck.kind == "folder" else self.capture.view
        stance = self.capture.stance if self.deck.is_simulator else None

        def work(progress: Progress) -> NewCapture:
            capture = take(
                camera, view=view, stance=stance, frames=frames, progress=ScaledProgress(progress, 0.0, 0.4)
            )
            return session.take_working(capture, ScaledProgress(progress, 0.4, 1.0))

        self._host.run("Capturing the body", work, self._adopt_working)

    def _adopt_working(self, new: NewCapture) -> None:
        self.capture.stop_live()
        self.capture.set_view(new.analysed.capture.view)
        self._host.session.adopt_working(new)


def _show_new(screen: CaptureScreen, new: NewCapture) -> None:
    screen.show_capture(new.analysed, "The capture with the joints found in it. It is not saved yet.")
