"""The page of one visit: who, which step, the screen of the step, messages, progress.

Public API
----------
``VisitPage(context, patient_id, visit_id=None, *, frames=30)``  without a visit: goes on with the open one,
    or opens a new one. Signals ``finished()`` (closed and done with), ``closed()`` (left; all is saved).
``page.session``  the `VisitSession` (a Qt-free model); ``page.attach_dermoscopy(paths)``,
    ``page.export_report(path)`` do without a file dialog what the buttons do with one.
``page.leave()``  what the back button does; call it before the page is taken away.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QSize, Signal, Slot
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.tasks import TaskFailure
from app.theme import icon, palette, style_class
from app.widgets.body_view import BodyView
from app.widgets.status import MessageBanner, ProgressOverlay, StepBar
from app.windows.compare_sheet import CompareSheet
from app.windows.visit.capture_steps import CaptureSteps
from app.windows.visit.explain_sheet import show_explanation
from app.windows.visit.lesion_step import LesionStep
from app.windows.visit.review_step import ReviewStep
from app.workflows.session import VisitSession
from app.workflows.table import Event, Refused, State
from core.errors import GeodermError
from core.progress import Progress
from devices.camera import DEFAULT_FRAMES

if TYPE_CHECKING:
    from app.context import AppContext

STEPS = ("stance", "capture", "lesions", "review")
_GO = {
    "stance": Event.GO_STANCE,
    "capture": Event.GO_CAPTURE,
    "lesions": Event.GO_LESIONS,
    "review": Event.GO_REVIEW,
}


class VisitPage(QWidget):
    """See the module's documentation."""

    finished = Signal()
    closed = Signal()

    def __init__(
        self,
        context: AppContext,
        patient_id: int,
        visit_id: int | None = None,
        *,
        frames: int = DEFAULT_FRAMES,
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("visit_page")
        style_class(self, "page")
        self.context = context
        self.frames = frames
        self.session = (
            VisitSession.begin(
                context.store, context.user_id, patient_id, context.tracker, method=context.method
            )
            if visit_id is None
            else VisitSession(
                context.store, context.user_id, visit_id, context.tracker, method=context.method
            )
        )
        self._left = False
        self.banner = MessageBanner()
        self.banner.action_triggered.connect(self._on_banner_action)
        self.stack = QStackedWidget()
        self.captures = CaptureSteps(self, self)
        self.lesions = LesionStep(self, self)
        self.review = ReviewStep(self, self)
        self.review.done.connect(self._finish)
        for screen in (
            self.captures.stance,
            self.captures.capture,
            self.lesions.screen,
            self.review.screen,
        ):
            self.stack.addWidget(screen)
        self._build()
        self.overlay = ProgressOverlay(self)
        context.privacy_changed.connect(self._show_title)
        self.session.changed.connect(self._on_changed)
        self._show_title()
        self._refresh()

    def _build(self) -> None:
        bar = QFrame()
        style_class(bar, "bar")
        self.back = QToolButton()
        self.back.setObjectName("visit_back")
        self.back.setIcon(icon("back", palette.TEXT))
        self.back.setIconSize(QSize(22, 22))
        self.back.setToolTip("Back to the patient. Everything is saved; the visit stays open.")
        style_class(self.back, "icon")
        self.back.clicked.connect(self.leave)
        self.patient = QLabel()
        self.patient.setObjectName("visit_patient")
        style_class(self.patient, "heading")
        self.subtitle = QLabel()
        self.subtitle.setObjectName("visit_subtitle")
        style_class(self.subtitle, "caption")
        self.steps = StepBar(tuple(zip(STEPS, self.session.table.steps, strict=True)))
        self.steps.step_clicked.connect(lambda key: self.attempt(lambda: self.session.fire(_GO[key])))
        self.discard_button = QPushButton("Discard visit")
        self.discard_button.setObjectName("discard_visit")
        style_class(self.discard_button, "quiet")
        self.discard_button.clicked.connect(self._ask_discard)
        names = QVBoxLayout()
        names.setSpacing(0)
        names.addWidget(self.patient)
        names.addWidget(self.subtitle)
        row = QHBoxLayout(bar)
        row.setContentsMargins(16, 8, 24, 8)
        row.setSpacing(12)
        row.addWidget(self.back)
        row.addLayout(names)
        row.addSpacing(24)
        row.addWidget(self.steps, 1)
        row.addWidget(self.discard_button)
        messages = QVBoxLayout()
        messages.setContentsMargins(24, 16, 24, 0)
        messages.addWidget(self.banner)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(bar)
        column.addLayout(messages)
        column.addWidget(self.stack, 1)

    # --- what is shown -------------------------------------------------------------------------------

    @Slot()
    def _show_title(self) -> None:
        snapshot = self.session.snapshot
        kind = "follow-up" if self.session.is_follow_up else "first visit"
        self.patient.setText(self.context.patient_title(snapshot.patient))
        self.subtitle.setText(f"Visit {snapshot.visit.number}, {kind}")

    def _on_changed(self) -> None:
        self._refresh()
        self.context.touch(self.session.snapshot.patient.id)

    def _refresh(self) -> None:
        session = self.session
        state = session.state
        if state is State.DISCARDED:
            self._left = True
            self.captures.deck.close()
            self.context.touch(session.snapshot.patient.id)
            self.closed.emit()
            return
        current = STEPS[session.info.step]
        facts = session.snapshot.facts()
        self.steps.set_current(current)
        self.steps.set_enabled_steps(key for key, event in _GO.items() if session.allows(event))
        looked = facts.has_capture and not facts.pending and (facts.lesions > 0)
        done = {
            "stance": facts.has_stance,
            "capture": facts.has_capture,
            "lesions": facts.closed or (looked and not facts.undecided and state is State.REVIEW),
            "review": facts.closed,
        }
        self.steps.set_done(key for key, is_done in done.items() if is_done)
        self.discard_button.setVisible(session.allows(Event.DISCARD))
        shown = self.stack.currentWidget()
        screen = {
            "stance": self.captures.stance,
            "capture": self.captures.capture,
            "lesions": self.lesions.screen,
            "review": self.review.screen,
        }[current]
        if screen is not shown:
            self.banner.clear()
            self._leave_step(shown)
        self.stack.setCurrentWidget(screen)
        if current in ("stance", "capture"):
            self.captures.enter(state)
        else:
            self.captures.leave()
            (self.lesions if current == "lesions" else self.review).enter()

    def _leave_step(self, screen: QWidget) -> None:
        if screen is self.lesions.screen:
            self.lesions.leave()
        elif screen is self.review.screen:
            self.review.leave()

    # --- work ----------------------------------------------------------------------------------------

    def run(
        self,
        title: str,
        work: Callable[[Progress], Any],
        done: Callable[[Any], None],
        *,
        stopped: Callable[[], None] | None = None,
    ) -> None:
        """Do long work behind the progress overlay; the records are read again if it is stopped.

        What ends after the page was left is dropped, as if it had been cancelled in time.
        """
        self.banner.clear()
        task = self.context.tasks.start(title, work)

        def finished(result: Any) -> None:
            if not self._left:
                self.attempt(lambda: done(result))

        def failed(failure: TaskFailure) -> None:
            if self._left:
                return
            self.session.reload()
            if stopped is not None:
                stopped()
            self.banner.show_failure(failure)

        def cancelled() -> None:
            if self._left:
                return
            self.session.reload()
            if stopped is not None:
                stopped()
            else:
                self.banner.show_info("Cancelled. Nothing was changed.")

        task.finished.connect(finished)
        task.failed.connect(failed)
        task.cancelled.connect(cancelled)
        self.overlay.attach(task)

    def attempt(self, act: Callable[[], Any]) -> Any:
        """Do quick work; an error of the world goes to the banner and None is returned."""
        try:
            return act()
        except Refused as refusal:
            self.banner.show_warning(refusal.message, refusal.advice)
        except GeodermError as error:
            self.banner.show_error(error.message, error.advice)
        if not self._left:
            self.session.reload()
        return None

    def show_dermoscopy(self, lesion_id: int | None, image_id: int) -> None:
        """Show the dermoscopic images of a lesion; one of this visit may be taken away again."""
        session = self.session
        lesion = next((x for x in session.snapshot.lesions if x.id == lesion_id), None)
        if lesion is not None:
            may_remove = session.snapshot.visit.is_open
            sheet = CompareSheet(
                self,
                session.store,
                lesion,
                chosen=image_id,
                remove=self._remove_image if may_remove else None,
                removable_visit=session.visit_id,
            )
            sheet.open()

    def _remove_image(self, image_id: int) -> None:
        self.attempt(lambda: self.session.detach_dermoscopy(image_id))

    def explain(self, lesion_id: int) -> None:
        """Show how the proposed place of a lesion came about."""
        number = next(x.number for x in self.session.snapshot.lesions if x.id == lesion_id)
        self.run(
            "Explaining the place",
            lambda progress: self.session.explain(lesion_id, progress),
            lambda found: show_explanation(self, number, *found),
        )

    def attach_dermoscopy(self, paths: list[Path]) -> None:
        """Attach image files to the selected lesion."""
        self.lesions.attach(paths)

    def export_report(self, path: Path) -> None:
        """Write the PDF report of the visit."""
        self.review.export_report(path)

    # --- leaving -------------------------------------------------------------------------------------

    @Slot()
    def _ask_discard(self) -> None:
        self.banner.show_warning(
            "Discard this visit?",
            "Every capture, lesion and image recorded in it will be removed.",
            actions=[("discard", "Discard visit"), ("keep", "Keep it")],
        )

    @Slot(str)
    def _on_banner_action(self, key: str) -> None:
        self.banner.clear()
        if key == "discard":
            self.attempt(self.session.discard)
        elif key == "prepare":
            self.lesions.prepare()

    @Slot()
    def leave(self) -> None:
        """Leave the page; everything is saved, and an empty visit is not kept."""
        if self._left:
            return
        self._left = True
        self._leave_step(self.stack.currentWidget())
        if self.overlay.task is not None:
            self.overlay.task.cancel()
        self.captures.leave()
        self.captures.deck.close()
        if self.session.is_empty and self.session.state is not State.DISCARDED:
            self.attempt(self.session.discard)
        self.closed.emit()

    @Slot()
    def _finish(self) -> None:
        self._left = True
        self.captures.deck.close()
        self.finished.emit()

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: D102
        self.leave()
        for view in self.findChildren(BodyView):
            view.close_view()
        super().closeEvent(event)
