"""What happens in step 3: marking, checking, correcting, describing lesions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Slot

from app.widgets.markers import Marker
from app.windows.visit.dermoscopy_strip import Thumbnail
from app.windows.visit.earlier_photo import EarlierPhoto
from app.windows.visit.host import VisitHost
from app.windows.visit.lesion_screen import LesionScreen
from app.windows.visit.pictures import capture_picture, stored_picture
from app.windows.visit.shown import (
    CANDIDATE,
    body_lesions,
    candidate_markers,
    lesion_line,
    photo_markers,
)
from app.windows.visit.spots_corner import SpotsCorner
from app.workflows.search import SearchOutcome
from app.workflows.snapshot import has_place
from app.workflows.table import Event, State
from app.workflows.wording import when
from core.progress import Progress
from core.records import Lesion


class LesionStep(QObject):
    """Shows the session's lesions on the lesion screen and does what the doctor asks there."""

    def __init__(self, host: VisitHost, parent: QObject) -> None:
        super().__init__(parent)
        self._host = host
        self.screen = LesionScreen()
        self._capture_id: int | None = None
        self._selected: int | None = None
        self._placing: int | None = None
        self._marking = False
        self._picture_key: tuple[int, bool] | None = None
        self._entered = False
        s = self.screen
        s.selected.connect(self._on_marker)
        s.refine.connect(self._refine)
        s.show_earlier_capture.connect(lambda i: self._earlier.show_capture(i, self._selected))
        s.placed.connect(self._on_placed)
        s.moved.connect(self._on_moved)
        s.delete_requested.connect(lambda i: self._delete(int(i)))
        s.capture_chosen.connect(self._show_capture)
        s.confirm_all.connect(self._confirm_all)
        s.accept_unseen.connect(self._accept_unseen)
        s.mark_new.connect(self._set_marking)
        s.primary_clicked.connect(lambda: self._attempt(lambda: self._session.fire(Event.GO_REVIEW)))
        s.pane_changed.connect(lambda _: self._earlier.show(self._selected))
        d = s.details
        self._spots = SpotsCorner(host, s, self._show_capture, self._mark)
        self._earlier = EarlierPhoto(host, s, self._spots)
        d.confirm.connect(lambda: self._decide(self._session.confirm))
        d.not_in_view.connect(lambda: self._decide(self._session.not_in_view))
        d.undo.connect(lambda: self._on_selected(self._session.reopen))
        d.place.connect(self._set_placing)
        d.delete.connect(lambda: self._delete(self._selected))
        d.explain.connect(self._explain)
        d.site_changed.connect(lambda site: self._on_selected(lambda i: self._session.set_site(i, site)))
        d.size_changed.connect(lambda mm: self._on_selected(lambda i: self._session.set_size(i, mm)))
        d.note_changed.connect(lambda text: self._on_selected(lambda i: self._session.set_note(i, text)))
        d.removed_changed.connect(lambda on: self._on_selected(lambda i: self._session.set_removed(i, on)))
        d.strip.files_chosen.connect(self.attach)
        d.strip.image_clicked.connect(self._show_image)

    @property
    def _session(self):
        return self._host.session

    @property
    def selected_id(self) -> int | None:
        """The selected lesion."""
        return self._selected

    def _attempt(self, act: Callable[[], Any]) -> Any:
        return self._host.attempt(act)

    # --- what is shown -------------------------------------------------------------------------------

    def enter(self) -> None:
        """Show the step; called whenever the session changes while it is current."""
        views = self._session.snapshot.views
        if not self._entered:
            self._entered = True
            self._marking = self._session.state is State.MARK
            self.screen.set_compare_available(self._session.is_follow_up)
            if self._session.is_follow_up:
                self.screen.set_pane("body")
            if self._selected is None:
                waiting = (x.id for x in self._session.snapshot.shown_lesions())
                self._selected = next((i for i in waiting if self._session.status(i).needs_doctor), None)
            self.prepare()
        if self._capture_id not in views.values():
            self._capture_id = next(iter(views.values()), None)
        self.refresh()

    def leave(self) -> None:
        """Another step is shown."""
        self.screen.details.send_pending()
        self._entered = False
        self._placing = None

    def prepare(self) -> None:
        """After reopening a visit: analyse its captures, so that they can be clicked on."""
        session = self._session
        missing = [c for c in session.snapshot.views.values() if not session.is_ready(c)]
        if not missing:
            return

        def work(progress: Progress) -> None:
            for capture_id in missing:
                session.prepare(capture_id, progress)

        self._host.run("Preparing the body surface", work, lambda _: self.refresh(), stopped=self._unprepared)

    def _unprepared(self) -> None:
        self._host.banner.show_warning(
            "The body surface is not prepared; lesions can be read but not placed.",
            "Prepare it to go on marking.",
            actions=[("prepare", "Prepare now")],
        )

    def refresh(self) -> None:
        """Show the session's lesions."""
        session, screen = self._session, self.screen
        snapshot = session.snapshot
        lesions = snapshot.shown_lesions()
        if self._selected not in {lesion.id for lesion in lesions}:
            self._selected = None
        facts = snapshot.facts()
        screen.panel.show_state(session.info)
        screen.set_captures(snapshot.views, self._capture_id)
        self._show_picture()
        screen.show_lesions(
            [lesion_line(session, lesion) for lesion in lesions],
            self._markers(lesions),
            body_lesions(session, lesions, self._capture_id),
            None if self._selected is None else str(self._selected),
        )
        follow_up = session.is_follow_up
        confident, unseen = session.confident_count(), session.unseen_count()
        screen.confirm_all_button.setVisible(follow_up)
        screen.confirm_all_button.setEnabled(confident > 0)
        screen.confirm_all_button.setText(
            f" Confirm confident ({confident})" if confident else " Confirm confident"
        )
        screen.confirm_all_button.setToolTip(
            "Confirms every place whose region is no larger than a circle of 20 mm."
            if confident
            else "No place is certain enough."
        )
        refinable = session.refinable_count
        screen.refine_button.setVisible(follow_up and refinable > 0)
        screen.refine_button.setText(f" Use confirmed lesions to refine the others ({refinable})")
        screen.unseen_button.setVisible(follow_up and unseen > 0)
        screen.unseen_button.setText(f" Agree: not in view ({unseen})")
        screen.new_button.setVisible(session.state is State.CHECK)
        screen.progress.setVisible(follow_up)
        screen.progress.setRange(0, max(facts.lesions, 1))
        screen.progress.setValue(facts.lesions - facts.undecided)
        screen.count.setText(
            f"{facts.lesions - facts.undecided} of {facts.lesions} lesions checked"
            if follow_up or facts.undecided
            else f"{facts.lesions} lesion{'' if facts.lesions == 1 else 's'} marked"
        )
        self._show_placing()
        self._show_details()
        self._spots.refresh()
        self._earlier.show(self._selected)

    def _markers(self, lesions: list[Lesion]) -> list[Marker]:
        """Lesions, the selected one's other places, and the spots while they are listed."""
        session, capture_id = self._session, self._capture_id
        chosen = [x for x in lesions if x.id == self._selected]
        return [
            *photo_markers(session, lesions, capture_id),
            *(m for x in chosen for m in candidate_markers(session, x, capture_id)),
            *self._spots.markers(capture_id),
        ]

    def _show_picture(self) -> None:
        session, capture_id = self._session, self._capture_id
        if capture_id is None:
            return
        key = (capture_id, session.is_ready(capture_id))
        if key == self._picture_key:
            return
        self._picture_key = key
        record = session.snapshot.captures[capture_id]
        analysed = session.analysed(capture_id) if key[1] else None
        picture = stored_picture(session.store, record) if analysed is None else capture_picture(analysed)
        self.screen.show_capture(
            picture, analysed, f"This visit, {record.view} view, {when(record.taken_at)}"
        )

    def _show_details(self) -> None:
        session = self._session
        if self._selected is None:
            self.screen.show_details(False)
            return
        lesion = next(x for x in session.snapshot.lesions if x.id == self._selected)
        observation = session.snapshot.in_force(lesion.id)
        self.screen.details.show_lesion(
            lesion,
            observation,
            session.status(lesion.id),
            marked_now=lesion.visit_id == session.visit_id,
            explainable=observation is not None and bool(observation.method),
        )
        numbers = {v.id: v for v in (*session.snapshot.earlier, session.snapshot.visit)}
        self.screen.details.strip.set_thumbnails(
            [
                Thumbnail(
                    image.id,
                    session.store.dermoscopy.thumbnail(image.id, 128),
                    f"Visit {numbers[image.visit_id].number}, {when(image.added_at)}",
                    image.visit_id == session.visit_id,
                )
                for image in session.snapshot.dermoscopy.get(lesion.id, ())
            ]
        )
        self.screen.show_details(True)

    # --- acts ----------------------------------------------------------------------------------------

    def select(self, lesion_id: int | None) -> None:
        """Select a lesion in every view; the side of the body that shows it comes up."""
        if lesion_id != self._selected:
            self.screen.details.send_pending()
            self._placing = None
        self._selected = lesion_id
        if lesion_id is not None:
            observation = self._session.snapshot.in_force(lesion_id)
            if observation is not None and has_place(observation):
                self._capture_id = observation.capture_id
        self.refresh()

    @Slot(int)
    def _show_capture(self, capture_id: int) -> None:
        self._capture_id = capture_id
        self.refresh()

    def _on_selected(self, act: Callable[[int], Any]) -> None:
        if self._selected is not None:
            lesion_id = self._selected
            self._attempt(lambda: act(lesion_id))

    def _decide(self, act: Callable[[int], Any]) -> None:
        """Decide on the selected lesion and go on to the next that waits."""
        lesion_id = self._selected
        if lesion_id is None:
            return
        self._attempt(lambda: act(lesion_id))
        if self._session.status(lesion_id).needs_doctor:
            return
        ids = [int(i) for i in self.screen.list.ids()]
        at = ids.index(lesion_id) if lesion_id in ids else 0
        waiting = [i for i in ids[at:] + ids[:at] if self._session.status(i).needs_doctor]
        if waiting:
            self.select(waiting[0])
            self.screen.center_on(str(waiting[0]))

    @Slot(float, float)
    def _on_placed(self, u: float, v: float) -> None:
        session, capture_id = self._session, self._capture_id
        if capture_id is None:
            return
        if self._placing is not None:
            lesion_id = self._placing
            warnings = self._attempt(lambda: session.move(lesion_id, capture_id, (u, v)))
            if warnings is not None:
                self._placing = None
                self._warn(warnings)
                self.refresh()
            return
        self._mark(capture_id, (u, v))

    def _mark(self, capture_id: int, pixel: tuple[float, float]) -> None:
        """Mark a new lesion and select it."""
        marked = self._attempt(lambda: self._session.mark(capture_id, pixel))
        if marked is not None:
            lesion, warnings = marked
            if self._session.state is State.CHECK:
                self._marking = False
            self.select(lesion.id)
            self._warn(warnings)

    @Slot(str)
    def _on_marker(self, name: str) -> None:
        """A lesion was clicked, or another place of one, which then becomes its place."""
        if name.startswith(CANDIDATE):
            marker = next((m for m in self.screen.photo.markers() if m.id == name), None)
            if marker is not None:
                self._on_moved(name.removeprefix(CANDIDATE).split(":")[0], marker.x, marker.y)
        elif name.isdigit():
            self.select(int(name))

    @Slot()
    def _refine(self) -> None:
        """Look again for the lesions that wait, in a task that can be cancelled."""
        self._host.run("Refining the other lesions", self._session.refine_lesions, self._refined)

    def _refined(self, outcome: SearchOutcome) -> None:
        self._session.adopt_search(outcome)
        count = len(outcome.answers)
        self._host.banner.show_success(
            f"{count} lesion{'s'[: count != 1]} looked for again with the help of the confirmed ones."
        )

    @Slot(str, float, float)
    def _on_moved(self, name: str, u: float, v: float) -> None:
        capture_id = self._capture_id
        if capture_id is None:
            return
        warnings = self._attempt(lambda: self._session.move(int(name), capture_id, (u, v)))
        self.select(int(name))
        if warnings is not None:
            self._warn(warnings)

    def _warn(self, warnings: tuple[str, ...]) -> None:
        if warnings:
            self._host.banner.show_warning(warnings[0], " ".join(warnings[1:]))

    def _delete(self, lesion_id: int | None) -> None:
        if lesion_id is not None:
            self._attempt(lambda: self._session.remove(lesion_id))
            self.refresh()

    @Slot()
    def _confirm_all(self) -> None:
        count = self._attempt(self._session.confirm_confident)
        if count:
            self._host.banner.show_success(f"{count} place{'s'[: count > 1]} confirmed.")

    @Slot()
    def _accept_unseen(self) -> None:
        self._attempt(self._session.accept_unseen)

    @Slot(bool)
    def _set_marking(self, on: bool) -> None:
        self._marking, self._placing = on, None
        self._show_placing()

    @Slot(bool)
    def _set_placing(self, on: bool) -> None:
        self._placing = self._selected if on else None
        self._show_placing()

    def _show_placing(self) -> None:
        always = self._session.state is State.MARK
        new = self._marking and not always
        ready = self._capture_id is not None and self._session.is_ready(self._capture_id)
        self.screen.show_placing(ready and (always or new or self._placing is not None), new=new)
        self.screen.photo.set_movable(ready)
        self.screen.details.show_placing(self._placing is not None)

    # --- dermoscopy and explanation ------------------------------------------------------------------

    def attach(self, paths: list[Path]) -> None:
        """Attach image files to the selected lesion; a file that is no image is named and left out."""
        for path in paths:
            self._on_selected(lambda i, p=path: self._session.attach_dermoscopy(i, p))

    @Slot(int)
    def _show_image(self, image_id: int) -> None:
        self._host.show_dermoscopy(self._selected, image_id)

    @Slot()
    def _explain(self) -> None:
        if self._selected is not None:
            self._host.explain(self._selected)
