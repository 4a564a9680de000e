"""What happens in step 4: the last look, closing the visit, the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QStandardPaths, Signal, Slot
from PySide6.QtWidgets import QFileDialog

from app.widgets.markers import Marker
from app.windows.visit.host import VisitHost
from app.windows.visit.pictures import stored_picture
from app.windows.visit.review_screen import ReviewScreen
from app.windows.visit.shown import lesion_line, photo_markers
from app.workflows.snapshot import has_place
from app.workflows.table import Event, State
from app.workflows.wording import when
from core.progress import Progress
from core.records import Lesion

if TYPE_CHECKING:
    from core.relocation.site_check import SiteCheck


class ReviewStep(QObject):
    """Shows the visit for review and, once closed, for reading.

    Signals
    -------
    done()
        The user has finished with a closed visit.
    """

    done = Signal()

    def __init__(self, host: VisitHost, parent: QObject) -> None:
        super().__init__(parent)
        self._host = host
        self.screen = ReviewScreen()
        self._capture_id: int | None = None
        self._picture_id: int | None = None
        self._selected: int | None = None
        self.screen.primary_clicked.connect(self._primary)
        self.screen.secondary_clicked.connect(self._secondary)
        self.screen.note_changed.connect(
            lambda text: self._host.attempt(lambda: self._host.session.set_visit_note(text))
        )
        self.screen.selected.connect(self._on_selected)
        self.screen.capture_chosen.connect(self._on_capture)
        self.screen.check_site.connect(self._ask_site)
        self.screen.site_clicked.connect(self._check_site)
        self._site: tuple[int, float, float] | None = None

    def enter(self) -> None:
        """Show the step; called whenever the session changes while it is current."""
        session, screen = self._host.session, self.screen
        snapshot = session.snapshot
        lesions = snapshot.shown_lesions()
        if self._capture_id not in snapshot.views.values():
            self._capture_id = next(iter(snapshot.views.values()), None)
        screen.show_state(session.info, self._summary(), closed=session.state is State.CLOSED)
        screen.show_note(snapshot.visit.note)
        screen.set_captures(snapshot.views, self._capture_id)
        if self._capture_id is not None and self._capture_id != self._picture_id:
            self._picture_id = self._capture_id
            record = snapshot.captures[self._capture_id]
            caption = f"{record.view.capitalize()} view, {when(record.taken_at)}"
            screen.show_capture(stored_picture(session.store, record), caption)
        screen.show_lesions(
            [lesion_line(session, lesion) for lesion in lesions],
            [*photo_markers(session, lesions, self._capture_id, movable=False), *self._site_markers()],
            None if self._selected is None else str(self._selected),
        )

    def leave(self) -> None:
        """Another step is shown, or the page is left."""
        if self._host.session.state is State.REVIEW:
            self.screen.send_note()
        self._site = None
        self.screen.show_checking(False)
        self.screen.site.hide()

    def _summary(self) -> str:
        session = self._host.session
        facts = session.snapshot.facts()
        new = sum(x.visit_id == session.visit_id for x in session.snapshot.shown_lesions())
        images = sum(
            i.visit_id == session.visit_id for own in session.snapshot.dermoscopy.values() for i in own
        )
        parts = [
            f"{facts.lesions} lesion{'' if facts.lesions == 1 else 's'}",
            f"{new} new" if session.is_follow_up else "",
            f"{images} dermoscopic image{'' if images == 1 else 's'}",
            f"{facts.undecided} still to check" if facts.undecided else "",
        ]
        return ", ".join(p for p in parts if p) + "."

    @Slot(str)
    def _on_selected(self, name: str) -> None:
        if int(name) != self._selected:
            self._site = None
            self.screen.show_checking(False)
            self.screen.site.hide()
        self._selected = int(name)
        observation = self._host.session.snapshot.in_force(self._selected)
        if observation is not None and has_place(observation):
            self._capture_id = observation.capture_id
        self.enter()

    # --- the site of a lesion ------------------------------------------------------------------------

    def _site_markers(self) -> list[Marker]:
        """The site that was clicked, on the capture that shows it."""
        if self._site is None or self._site[0] != self._capture_id:
            return []
        return [Marker("site", "site", self._site[1], self._site[2], "marked", movable=False)]

    @Slot(bool)
    def _ask_site(self, on: bool) -> None:
        lesion = self._selected_lesion()
        if on and lesion is None:
            self.screen.show_checking(False)
            self._host.banner.show_info("Which lesion?", "Select a lesion in the list, then check its site.")
            return
        self.screen.show_checking(on)
        self._site = None
        if on and lesion is not None:
            self.screen.site.ask(lesion.number)
        else:
            self.screen.site.hide()
        self.enter()

    @Slot(float, float)
    def _check_site(self, u: float, v: float) -> None:
        lesion, capture_id = self._selected_lesion(), self._capture_id
        if lesion is None or capture_id is None:
            return
        session = self._host.session

        def checked(check: SiteCheck) -> None:
            self._site = capture_id, u, v
            self.screen.site.show_check(lesion.number, check)
            self.enter()

        self._host.run(
            "Checking the site",
            lambda progress: session.check_site(lesion.id, capture_id, (u, v), progress),
            checked,
        )

    def _selected_lesion(self) -> Lesion | None:
        lesions = self._host.session.snapshot.lesions
        return next((x for x in lesions if x.id == self._selected), None)

    @Slot(int)
    def _on_capture(self, capture_id: int) -> None:
        self._capture_id = capture_id
        self.enter()

    @Slot()
    def _primary(self) -> None:
        if self._host.session.state is State.CLOSED:
            self._ask_report()
            return
        self.screen.send_note()
        self._host.attempt(self._host.session.close)
        if self._host.session.state is State.CLOSED:
            self._host.banner.show_success("The visit is closed.", "Export the report, or choose Done.")

    @Slot()
    def _secondary(self) -> None:
        if self._host.session.state is State.CLOSED:
            self.done.emit()
        else:
            self._host.attempt(lambda: self._host.session.fire(Event.GO_LESIONS))

    def _ask_report(self) -> None:
        context, snapshot = self._host.context, self._host.session.snapshot
        folder = context.settings.export_folder or QStandardPaths.writableLocation(
            QStandardPaths.StandardLocation.DocumentsLocation
        )
        number = snapshot.patient.clinic_number or f"patient-{snapshot.patient.id}"
        name = f"{number}-visit-{snapshot.visit.number}.pdf".replace("/", "-")
        path, _ = QFileDialog.getSaveFileName(
            self.screen, "Export report", str(Path(folder) / name), "PDF (*.pdf)"
        )
        if path:
            self.export_report(Path(path))

    def export_report(self, path: Path) -> None:
        """Write the PDF report, behind the progress overlay."""
        session, context = self._host.session, self._host.context
        user = session.store.users.get(session.user_id)

        def work(progress: Progress) -> Path:
            from core.exchange.report import write_visit_report

            progress(0.1, "Writing the report")
            write_visit_report(session.store, session.visit_id, path, created_by=user)
            return path

        def written(result: Path) -> None:
            context.change_settings(export_folder=str(result.parent))
            self._host.banner.show_success("The report is written.", str(result))

        self._host.run("Writing the report", work, written)
