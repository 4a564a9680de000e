"""What happens in steps 1 and 2: from the camera to a judged, stored, analysed capture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Slot

from app.windows.visit.camera_deck import CameraDeck
from app.windows.visit.camera_news import CameraNews
from app.windows.visit.capture_screen import CaptureScreen
from app.windows.visit.host import VisitHost
from app.windows.visit.joint_corrections import JointCorrections
from app.windows.visit.live_assist import LiveAssist
from app.windows.visit.live_capture import Judged, capture_and_judge
from app.windows.visit.live_ghost import GhostLayer
from app.windows.visit.live_verdict import verdict_picture
from app.windows.visit.pictures import joints_picture, stored_picture
from app.workflows.analysis import NewCapture, Role
from app.workflows.search import SearchOutcome
from app.workflows.table import Event, State
from app.workflows.wording import when
from core.progress import Progress

if TYPE_CHECKING:
    from core.records import CaptureRecord

_STANCE_STATES = (State.STANCE, State.STANCE_CHECK, State.STANCE_DONE)
_CANCEL = "Cancel (Esc)"


class CaptureSteps(QObject):
    """Drives the two capture screens and the camera they share."""

    def __init__(self, host: VisitHost, parent: QObject) -> None:
        super().__init__(parent)
        self._host = host
        self.deck = CameraDeck(host.context, self)
        self.stance = CaptureScreen("stance", self.deck)
        self.capture = CaptureScreen("capture", self.deck)
        self.assist = LiveAssist(self.deck, self)
        self._current: CaptureScreen | None = None
        self._shown: tuple[object, ...] | None = None
        self._pending: Judged | None = None
        self._latest: Judged | None = None
        self._notes: dict[int, Judged] = {}
        self._ghost = GhostLayer(host, self.deck, self)
        self.stance.set_stance("psi")
        self.stance.set_choices_visible(view=False)
        for screen in (self.stance, self.capture):
            screen.pose_changed.connect(self._on_pose)
            screen.live_toggled.connect(self.refresh)
            screen.escaped.connect(self._on_escape)
            screen.controls.automatic_toggled.connect(self._on_automatic)
            screen.controls.ghost_changed.connect(self._ghost.show_opacity)
        self._joints = JointCorrections(host, (self.stance, self.capture), self._unsaved, self)
        self._joints.editing_changed.connect(self._editing_changed)
        self._joints.judged.connect(self._adopt_corrected)
        self.stance.primary_clicked.connect(self._stance_primary)
        self.stance.secondary_clicked.connect(self._stance_secondary)
        self.capture.primary_clicked.connect(self._capture_primary)
        self.capture.secondary_clicked.connect(self._capture_secondary)
        self.deck.changed.connect(self.refresh)
        self._news = CameraNews(host, self.deck, self)
        self.deck.status_changed.connect(lambda _: self.refresh())
        self.assist.take.connect(self._take)
        self.assist.phase_changed.connect(self.refresh)

    # --- what is shown -------------------------------------------------------------------------------

    def enter(self, state: State) -> None:
        """Show the screen of a state; called whenever the session changes."""
        screen = self.stance if state in _STANCE_STATES else self.capture
        if screen is not self._current:
            self._current = screen
            self._shown = self._pending = None
            self._ghost.forget()
            screen.refresh_cameras()
            if not self.deck.camera_id:
                self._choose_default()
            self._stand()
        self.refresh()

    def leave(self) -> None:
        """Another step is shown: the camera may rest."""
        self._current = None
        self.assist.attach(None)

    @Slot()
    def refresh(self) -> None:
        """Show the session's state on the current screen."""
        screen = self._current
        if screen is None:
            return
        screen.controls.set_automatic(self.assist.assistant.automatic)
        if self._pending is not None and not self.assist.busy:
            self._show_pending(screen, self._pending)
        elif screen is self.stance:
            self._show_stance()
        else:
            self._show_capture()
        if self.assist.counting:
            screen.panel.primary.setText(_CANCEL)
            screen.panel.primary.setEnabled(True)
            screen.secondary.setVisible(False)
            screen.live_view.setFocus()
        elif self._joints.editing:
            screen.panel.primary.setEnabled(False)
            screen.secondary.setEnabled(False)

    def _show_stance(self) -> None:
        session, screen = self._host.session, self.stance
        screen.panel.show_state(session.info)
        candidate = session.stance_candidate
        screen.corrections.show_list("Ask the patient", () if candidate is None else candidate.corrections)
        ready = self.deck.ready
        screen.panel.primary.setEnabled(ready or session.state is State.STANCE_DONE)
        screen.secondary.setVisible(session.state is not State.STANCE)
        screen.secondary.setEnabled(ready or session.state is State.STANCE_CHECK)
        if session.state is State.STANCE_CHECK and candidate is not None:
            screen.secondary.setText("Use as it is")
            latest = self._latest
            notes = latest.sentences if latest is not None and latest.new is candidate else candidate.warnings
            screen.warnings.show_list("Please note", notes)
            self._show_once(screen, ("candidate", id(candidate)), lambda: _show_new(screen, candidate))
        elif session.state is State.STANCE_DONE and session.snapshot.stance is not None:
            screen.secondary.setText("Capture again")
            self._show_record(screen, session.snapshot.stance)
        else:
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
        ready = self.deck.ready
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
            self._show_live(screen)

    def _show_pending(self, screen: CaptureScreen, judged: Judged) -> None:
        """The verdict of a capture that was not stored."""
        refused = judged.quality.grade == "refused"
        screen.panel.primary.setText("Capture again" if refused else "Use it")
        screen.panel.primary.setEnabled(self.deck.ready or not refused)
        screen.secondary.setVisible(not refused)
        screen.secondary.setText("Capture again")
        screen.secondary.setEnabled(self.deck.ready)
        screen.corrections.show_list("", ())
        screen.warnings.show_list("", ())
        screen.verdict.show_quality(judged.quality, judged.sentences)

        def show() -> None:
            screen.show_unsaved(
                judged.new.analysed,
                verdict_picture(judged.new.analysed, judged.quality),
                "The capture. It is not saved yet.",
            )

        self._show_once(screen, ("judged", id(judged)), show)

    def _show_live(self, screen: CaptureScreen) -> None:
        self._shown = None
        screen.verdict.show_quality(None)
        screen.warnings.show_list("", ())
        screen.offer_live(False)
        self._look(screen)

    def _look(self, screen: CaptureScreen) -> None:
        screen.show_preview()
        self.assist.attach(screen, psi=screen is self.stance)
        self._ghost.lay(screen, "psi" if screen is self.stance else "working")

    def _show_record(self, screen: CaptureScreen, record: CaptureRecord) -> None:
        session = self._host.session
        ready = session.is_ready(record.id)
        judged = self._notes.get(record.id)

        def show() -> None:
            caption = f"Captured {when(record.taken_at)}, {record.frame_count} depth frames"
            if ready:
                analysed = session.analysed(record.id)
                seen, all_joints = len(analysed.skeleton.visible()), len(analysed.skeleton.joints)
                screen.show_capture(analysed, f"{caption}. {seen} of {all_joints} joints seen.")
                self._joints.offer(screen, record.id, analysed)
            else:
                screen.show_plain(stored_picture(session.store, record), caption)

        if judged is not None:
            screen.verdict.show_quality(judged.quality, judged.sentences)
            screen.warnings.show_list("", ())
        else:
            screen.verdict.show_quality(None)
            screen.warnings.show_list("Please note", session.analysed(record.id).warnings if ready else ())
        self._show_once(screen, (record.id, ready), show)

    def _show_once(self, screen: CaptureScreen, key: tuple[object, ...], show: Callable[[], None]) -> None:
        screen.offer_live(self.deck.camera is not None)
        if screen.live_wanted or self.assist.busy:
            self._shown = None
            self._look(screen)
            return
        self.assist.attach(None)
        if self._shown != (screen, *key):
            self._shown = (screen, *key)
            show()

    # --- joints placed by hand -----------------------------------------------------------------------

    def _editing_changed(self) -> None:
        if not self._joints.editing:
            self._shown = None  # the capture's own picture again, with the corrected joints in it
        self.refresh()

    def _unsaved(self) -> NewCapture | None:
        return self._host.session.stance_candidate if self._pending is None else self._pending.new

    def _adopt_corrected(self, judged: Judged) -> None:
        self._latest = judged
        if judged.new.good or judged.quality.grade == "refused":
            self._pending = judged
            self.refresh()
        else:
            self._pending = None
            self._host.session.adopt_stance(judged.new)

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
        if self._pending is None:
            self.refresh()

    def _stand(self) -> None:
        if self._current is not None:
            number = self._host.session.snapshot.visit.number
            view = "front" if self._current is self.stance else self._current.view
            self.deck.stand(self._current.stance, view, number)

    @Slot(bool)
    def _on_automatic(self, on: bool) -> None:
        self.assist.set_automatic(on)

    @Slot()
    def _on_escape(self) -> None:
        if self.assist.cancel():
            self._host.banner.show_info("Cancelled. No capture was taken.")

    # --- capturing -----------------------------------------------------------------------------------

    @Slot()
    def _stance_primary(self) -> None:
        session = self._host.session
        if self._answer_pending(primary=True):
            return
        if session.state is State.STANCE_DONE and not self.assist.counting:
            self._host.attempt(lambda: session.fire(Event.GO_CAPTURE))
        else:
            self._begin()

    @Slot()
    def _stance_secondary(self) -> None:
        session = self._host.session
        candidate = session.stance_candidate
        if self._answer_pending(primary=False):
            return
        if session.state is State.STANCE_CHECK and candidate is not None:
            self._host.run(
                "Saving the capture",
                lambda progress: session.store_capture(candidate, progress),
                lambda _: session.adopt_accepted_stance(),
            )
        else:
            self._begin()

    @Slot()
    def _capture_primary(self) -> None:
        session = self._host.session
        if self._answer_pending(primary=True):
            return
        if session.state is State.CAPTURE or self.assist.counting:
            self._begin()
        elif session.pending_count:
            self._host.run("Finding the lesions", session.find_lesions, self._found)
        else:
            self._host.attempt(lambda: session.fire(Event.GO_LESIONS))

    @Slot()
    def _capture_secondary(self) -> None:
        if not self._answer_pending(primary=False):
            self._begin()

    def _found(self, outcome: SearchOutcome) -> None:
        session = self._host.session
        self._host.attempt(lambda: session.adopt_search(outcome))
        if outcome.warnings:
            self._host.banner.show_warning(outcome.warnings[0], " ".join(outcome.warnings[1:]))

    def _answer_pending(self, *, primary: bool) -> bool:
        """The buttons under a verdict; False if there is none."""
        judged = self._pending
        if judged is None or self.assist.busy:
            return False
        if primary and judged.quality.grade != "refused":
            self._use(judged)
        else:
            self._pending = None
            self._begin()
        return True

    def _use(self, judged: Judged) -> None:
        session = self._host.session

        def adopt(record: CaptureRecord) -> None:
            self._pending = None
            self._adopt(Judged(judged.new, judged.quality, record.id))

        self._host.run(
            "Saving the capture", lambda progress: session.store_capture(judged.new, progress), adopt
        )

    def _begin(self) -> None:
        """Count down before a live camera, capture at once from a recording; a second press stops it."""
        if self.deck.camera is None:
            self._host.banner.show_warning("No camera is open.", "Choose a camera or open a recording.")
        elif self.deck.is_live and self.deck.kind != "recording":
            self._host.banner.clear()
            self.assist.press()
        else:
            self._take()

    @Slot()
    def _take(self) -> None:
        camera, session, frames = self.deck.camera, self._host.session, self._host.frames
        screen = self._current
        if camera is None or screen is None:
            self.assist.done()
            return
        role: Role = "psi" if screen is self.stance else "working"
        view = None if role == "psi" or self.deck.kind == "folder" else screen.view
        stance = "psi" if role == "psi" else screen.stance if self.deck.is_simulator else None
        strict = self.deck.is_live and self.deck.kind != "recording"

        def work(progress: Progress) -> Judged:
            return capture_and_judge(
                camera,
                session,
                role,
                view=view,
                stance=stance,
                frames=frames,
                strict=strict,
                progress=progress,
            )

        title = "Capturing the stance" if role == "psi" else "Capturing the body"
        self._host.run(title, work, self._on_judged, stopped=self._on_stopped)

    def _on_stopped(self) -> None:
        self.assist.done()
        self._host.banner.show_info("Cancelled. Nothing was changed.")

    def _on_judged(self, judged: Judged) -> None:
        self.assist.done()
        screen = self._current
        if screen is not None:
            screen.stop_live()
        self._latest = judged
        to_correct = not judged.new.good and judged.quality.grade != "refused"
        if judged.stored is not None or to_correct:
            self._adopt(judged)
        else:
            self._pending = judged
            self.refresh()

    def _adopt(self, judged: Judged) -> None:
        session = self._host.session
        if judged.stored is not None:
            self._notes[judged.stored] = judged
        if judged.new.role == "psi":
            session.adopt_stance(judged.new)
        else:
            self.capture.set_view(judged.new.analysed.capture.view)
            session.adopt_working(judged.new)


def _show_new(screen: CaptureScreen, new: NewCapture) -> None:
    screen.verdict.show_quality(None)
    screen.show_unsaved(
        new.analysed,
        joints_picture(new.analysed),
        "The capture with the joints found in it. It is not saved yet.",
    )
