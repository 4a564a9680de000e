"""One visit as the windows see it: a state, the records, and everything the doctor can do. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.workflows.analysis import AnalysisCache, NewCapture, Role, TrackerSource, analyse_new
from app.workflows.first_visit import FIRST_VISIT
from app.workflows.follow_up import FOLLOW_UP
from app.workflows.lesion_edits import LesionEdits
from app.workflows.notifier import Notifier
from app.workflows.search import SearchOutcome, explanation_pictures, run_plan
from app.workflows.snapshot import VisitSnapshot
from app.workflows.table import Event, Refused, State, StateInfo, StateTable
from app.workflows.wording import StatusText, describe
from core.capture.rgbd import RgbdCapture
from core.progress import Progress, ScaledProgress, no_progress
from core.records import AnatomicSite, AnchorRecord, CaptureRecord, DermoscopicImage, Lesion

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from core.anchors import AnalysedCapture, SkeletonCalibration
    from core.records import ClinicStore

Pixel = tuple[float, float]
T = TypeVar("T")


class VisitSession:
    """A visit in progress, or a closed one to look at.

    Long work is split in two: a method that computes and stores nothing but its last atomic step (call it
    in a worker, it may be cancelled), and one that brings the outcome into the session (call it in the
    thread of the windows). All other methods are quick.

    Parameters
    ----------
    store : ClinicStore
    user_id : int
    visit_id : int
    tracker : callable
        Gives the skeleton tracker; called in the worker.
    method : str or None
        Relocation method; None for the default.

    Attributes
    ----------
    changed : Notifier
        Called after every change of state or records.
    state : State
    stance_candidate : NewCapture or None
        A psi capture that is shown with its corrections and not stored.
    """

    def __init__(
        self,
        store: ClinicStore,
        user_id: int,
        visit_id: int,
        tracker: TrackerSource,
        *,
        method: str | None = None,
    ) -> None:
        self.store, self.user_id, self.method = store, user_id, method
        self.changed = Notifier()
        self._tracker = tracker
        self._snapshot = VisitSnapshot.load(store, visit_id)
        self._cache = AnalysisCache(store.captures.load, tracker)
        self._edits = LesionEdits(store, user_id, lambda: self._snapshot, self.analysed)
        self._names: dict[int, str] = {}
        self.table: StateTable = FOLLOW_UP if self._snapshot.is_follow_up else FIRST_VISIT
        self.state: State = self.table.resume(self._snapshot.facts())
        self.stance_candidate: NewCapture | None = None

    @classmethod
    def begin(
        cls,
        store: ClinicStore,
        user_id: int,
        patient_id: int,
        tracker: TrackerSource,
        *,
        method: str | None = None,
    ) -> VisitSession:
        """Go on with the patient's open visit, or open a new one."""
        visit = store.visits.open_visit(patient_id) or store.visits.create(patient_id, user_id)
        return cls(store, user_id, visit.id, tracker, method=method)

    # -- what is shown -----------------------------------------------------------------------------

    @property
    def snapshot(self) -> VisitSnapshot:
        """The records as last read."""
        return self._snapshot

    @property
    def info(self) -> StateInfo:
        """Title, instruction and next button of the state."""
        return self.table.states[self.state]

    @property
    def is_follow_up(self) -> bool:
        """Which of the two workflows runs."""
        return self.table is FOLLOW_UP

    @property
    def visit_id(self) -> int:
        """The visit's id."""
        return self._snapshot.visit.id

    @property
    def is_empty(self) -> bool:
        """Whether nothing at all was stored in the visit."""
        facts = self._snapshot.facts()
        return not (facts.has_stance or facts.has_capture or facts.lesions or facts.closed)

    def allows(self, event: Event) -> bool:
        """Whether an event is possible now."""
        return self.table.allows(self.state, event, self._snapshot.facts())

    def user_name(self, user_id: int) -> str:
        """Display name of a user."""
        if user_id not in self._names:
            self._names[user_id] = self.store.users.get(user_id).display_name
        return self._names[user_id]

    def status(self, lesion_id: int) -> StatusText:
        """Status of a lesion in this visit, in words."""
        return describe(self._snapshot.in_force(lesion_id), self.user_name)

    def confident_count(self) -> int:
        """How many proposals may be confirmed together."""
        return len(self._edits.confident())

    def unseen_count(self) -> int:
        """How many proposals say "not in view" and wait for the doctor."""
        return len(self._edits.unseen())

    # -- going from step to step -------------------------------------------------------------------

    def fire(self, event: Event) -> None:
        """Let an event happen.

        Raises
        ------
        Refused
            If it is not possible now.
        """
        self.state = self.table.next(self.state, event, self._snapshot.facts())
        if self.state is not State.STANCE_CHECK:
            self.stance_candidate = None
        self.changed.notify()

    def reload(self) -> None:
        """Read the records again, for example after a cancelled task."""
        self._snapshot = VisitSnapshot.load(self.store, self.visit_id)
        self.changed.notify()

    # -- captures: compute in a worker, then adopt -------------------------------------------------

    def analyse(self, capture: RgbdCapture, role: Role, progress: Progress = no_progress) -> NewCapture:
        """Worker: find body, joints and anchors of a new capture. Stores nothing."""
        calibration = None
        if role == "working":
            calibration = self._calibration(self._snapshot.visit.id, ScaledProgress(progress, 0.0, 0.3))
            progress = ScaledProgress(progress, 0.3, 1.0)
        return analyse_new(capture, role, self._tracker, calibration=calibration, progress=progress)

    def store_capture(self, new: NewCapture, progress: Progress = no_progress) -> CaptureRecord:
        """Worker: store an analysed capture and its anchors. Cancelled before the last step: no trace."""
        record = self.store.captures.add(
            self.visit_id, new.analysed.capture, new.role, by=self.user_id, progress=progress
        )
        self.store.anchors.put(record.id, _anchor_records(new.analysed))
        self._cache.put(record.id, new.analysed)
        _warm_up_clicks(new.analysed)
        return record

    def take_stance(self, capture: RgbdCapture, progress: Progress = no_progress) -> NewCapture:
        """Worker: analyse a psi capture, and store it if the stance is good. Then call `adopt_stance`."""
        new = self.analyse(capture, "psi", ScaledProgress(progress, 0.0, 0.8))
        if new.good:
            self.store_capture(new, ScaledProgress(progress, 0.8, 1.0))
        return new

    def adopt_stance(self, new: NewCapture) -> None:
        """Bring in what `take_stance` returned."""
        if new.good:
            self.reload()
            self.fire(Event.STANCE_GOOD)
        else:
            self.fire(Event.STANCE_TO_CORRECT)
            self.stance_candidate = new
            self.changed.notify()

    def adopt_accepted_stance(self) -> None:
        """Bring in a stance capture that the doctor accepted as it is, after `store_capture`."""
        self.reload()
        self.fire(Event.STANCE_ACCEPTED)

    def take_working(self, capture: RgbdCapture, progress: Progress = no_progress) -> NewCapture:
        """Worker: analyse and store a working capture. Then call `adopt_working`."""
        new = self.analyse(capture, "working", ScaledProgress(progress, 0.0, 0.85))
        self.store_capture(new, ScaledProgress(progress, 0.85, 1.0))
        return new

    def adopt_working(self, new: NewCapture) -> None:
        """Bring in what `take_working` returned."""
        self.reload()
        self.fire(Event.CAPTURE_STORED)

    def analysed(self, capture_id: int) -> AnalysedCapture:
        """The analysis of a stored capture, from memory.

        Raises
        ------
        Refused
            If it is not ready; `prepare` makes it so.
        """
        analysed = self._cache.peek(capture_id)
        if analysed is None:
            raise Refused("The body surface is still being prepared.", "Wait a moment and try again.")
        return analysed

    def is_ready(self, capture_id: int) -> bool:
        """Whether a stored capture can be clicked on without waiting."""
        return self._cache.peek(capture_id) is not None

    def prepare(self, capture_id: int, progress: Progress = no_progress) -> AnalysedCapture:
        """Worker: analyse a stored capture of this or an earlier visit, for example after reopening."""
        record = self._snapshot.captures[capture_id]
        calibration = None
        if record.role == "working" and not self.is_ready(capture_id):
            calibration = self._calibration(record.visit_id, ScaledProgress(progress, 0.0, 0.4))
            progress = ScaledProgress(progress, 0.4, 1.0)
        analysed = self._cache.get(capture_id, calibration=calibration, progress=progress)
        _warm_up_clicks(analysed)
        return analysed

    def _calibration(self, visit_id: int, progress: Progress) -> SkeletonCalibration | None:
        from core.anchors import calibrate_skeleton

        stance = self._snapshot.stance_of(visit_id)
        if stance is None:
            return None
        return calibrate_skeleton(self._cache.get(stance.id, progress=progress).skeleton)

    # -- finding lesions again ---------------------------------------------------------------------

    @property
    def pending_count(self) -> int:
        """Known lesions still to be found on the captures of this visit."""
        return len(self._snapshot.pending())

    def find_lesions(self, progress: Progress = no_progress) -> SearchOutcome:
        """Worker: look for every pending lesion. Stores nothing; then call `adopt_search`."""
        views = self._snapshot.views
        if not views:
            raise Refused("There is no body capture to look on.", "Take a capture of the body first.")
        return run_plan(
            self._snapshot.pending(),
            self.visit_id,
            self.prepare,
            some_capture_id=max(views.values()),
            numbers={lesion.id: lesion.number for lesion in self._snapshot.lesions},
            method=self.method,
            progress=progress,
        )

    def adopt_search(self, outcome: SearchOutcome) -> None:
        """Store all places found, or none."""
        self.store.observations.put_many(outcome.drafts, by=self.user_id)
        self._edits.set_replaced_aside()
        self.reload()
        self.fire(Event.LESIONS_RELOCATED)

    def explain(self, lesion_id: int, progress: Progress = no_progress) -> dict[str, NDArray[np.uint8]]:
        """Worker: pictures of how the proposed place of a lesion came about, by title."""
        for search in self._snapshot.plan().searches:
            place = next((p for p in search.places if p.lesion_id == lesion_id), None)
            if place is not None:
                proposal = self._snapshot.in_force(lesion_id)
                return explanation_pictures(
                    place,
                    search,
                    self.prepare,
                    number=str(next(x.number for x in self._snapshot.lesions if x.id == lesion_id)),
                    method=proposal.method if proposal is not None else "",
                    answer_m=proposal.proposed_point_m if proposal is not None else None,
                    progress=progress,
                )
        raise Refused(
            "This lesion was not looked for in this visit, so there is nothing to explain.",
            "Explanations exist for lesions of earlier visits.",
        )

    # -- lesions -----------------------------------------------------------------------------------

    def mark(self, capture_id: int, pixel: Pixel) -> tuple[Lesion, tuple[str, ...]]:
        """Mark a new lesion where the doctor clicked; returns it with warnings."""
        return self._edit(lambda: self._edits.mark(capture_id, pixel))

    def move(self, lesion_id: int, capture_id: int, pixel: Pixel) -> tuple[str, ...]:
        """Put a lesion at another place; a proposal becomes corrected, by whom and when."""
        return self._edit(lambda: self._edits.move(lesion_id, capture_id, pixel))

    def remove(self, lesion_id: int) -> None:
        """Take back a lesion marked in this visit by mistake."""
        self._edit(lambda: self._edits.remove(lesion_id))

    def confirm(self, lesion_id: int) -> None:
        """Agree with the proposal for one lesion."""
        self._edit(lambda: self._edits.confirm(lesion_id))

    def confirm_confident(self) -> int:
        """Agree with all proposals that are sure enough; returns how many."""
        return self._edit(lambda: self._edits.confirm_all(self._edits.confident()))

    def accept_unseen(self) -> int:
        """Agree with all proposals "not in view"; returns how many."""
        return self._edit(lambda: self._edits.confirm_all(self._edits.unseen()))

    def not_in_view(self, lesion_id: int) -> None:
        """The doctor does not see the lesion in this visit."""
        self._edit(lambda: self._edits.not_in_view(lesion_id))

    def reopen(self, lesion_id: int) -> None:
        """Take the decision on one lesion back."""
        self._edit(lambda: self._edits.reopen(lesion_id))

    def set_site(self, lesion_id: int, site: AnatomicSite | None) -> None:
        """Store the anatomic site."""
        self._edit(lambda: self._edits.set_site(lesion_id, site))

    def set_note(self, lesion_id: int, note: str) -> None:
        """Store the note of a lesion."""
        self._edit(lambda: self._edits.set_note(lesion_id, note))

    def set_size(self, lesion_id: int, size_mm: float) -> None:
        """Store the size in this visit, in millimetres."""
        self._edit(lambda: self._edits.set_size(lesion_id, size_mm))

    def set_removed(self, lesion_id: int, removed: bool) -> None:
        """Say that a physician removed the lesion, or take that back."""
        self._edit(lambda: self._edits.set_removed(lesion_id, removed))

    def attach_dermoscopy(self, lesion_id: int, path: Path) -> DermoscopicImage:
        """Attach an image file; raises `InputError` naming the file if it is not an image."""
        return self._edit(lambda: self._edits.attach_dermoscopy(lesion_id, path))

    def detach_dermoscopy(self, image_id: int) -> None:
        """Take a wrongly attached image away."""
        self._edit(lambda: self._edits.detach_dermoscopy(image_id))

    def _edit(self, act: Callable[[], T]) -> T:
        self.table.next(self.state, Event.LESION_EDITED, self._snapshot.facts())
        result = act()
        self.reload()
        return result

    # -- the end -----------------------------------------------------------------------------------

    def set_visit_note(self, note: str) -> None:
        """Store the note of the visit."""
        self.store.visits.set_note(self.visit_id, note)
        self.reload()

    def close(self) -> None:
        """Close the visit.

        Raises
        ------
        Refused
            If lesions still wait for the doctor.
        """
        target = self.table.next(self.state, Event.CLOSE, self._snapshot.facts())
        self.store.visits.close(self.visit_id, self.user_id)
        self.state = target
        self.reload()

    def discard(self) -> None:
        """Remove the open visit with everything recorded in it."""
        target = self.table.next(self.state, Event.DISCARD, self._snapshot.facts())
        self.store.visits.discard(self.visit_id, self.user_id)
        self.state = target
        self.changed.notify()


def _warm_up_clicks(analysed: AnalysedCapture) -> None:
    """Make what the first click needs (search trees, compiled kernels), so that it is quick."""
    from core.surface import pick_skin

    rig = analysed.capture.rig
    pick_skin(analysed.scan, rig.project_to_picture(analysed.scan.surface.vertices.mean(axis=0))[0])


def _anchor_records(analysed: AnalysedCapture) -> list[AnchorRecord]:
    records = []
    for anchor in analysed.anchors.anchors:
        joint = analysed.skeleton.joints.get(anchor.name) or analysed.skeleton.landmarks.get(anchor.name)
        x, y, z = (float(c) for c in anchor.position_m)
        records.append(
            AnchorRecord(
                anchor.name,
                x,
                y,
                z,
                None if joint is None else float(joint.pixel[0]),
                None if joint is None else float(joint.pixel[1]),
                0.0 if joint is None else float(joint.visibility),
                float(anchor.sigma_m),
                analysed.skeleton.source if joint is None else joint.source,
            )
        )
    return records
