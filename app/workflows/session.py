"""One visit as the windows see it: a state, the records, and everything the doctor can do. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.workflows.analysis import NewCapture, Role, TrackerSource
from app.workflows.capture_work import CaptureWork
from app.workflows.evidence import SeenSpot, VisitEvidence
from app.workflows.first_visit import FIRST_VISIT
from app.workflows.follow_up import FOLLOW_UP
from app.workflows.lesion_edits import LesionEdits
from app.workflows.lesion_search import LesionSearch
from app.workflows.notifier import Notifier
from app.workflows.search import SearchOutcome
from app.workflows.snapshot import VisitSnapshot
from app.workflows.table import Event, State, StateInfo, StateTable
from app.workflows.wording import StatusText, describe
from core.capture.rgbd import RgbdCapture
from core.progress import Progress, ScaledProgress, no_progress
from core.records import AnatomicSite, CaptureRecord, DermoscopicImage, Lesion

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from core.anchors import AnalysedCapture, Skeleton
    from core.records import ClinicStore
    from core.relocation.site_check import SiteCheck

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
        self._snapshot = VisitSnapshot.load(store, visit_id)
        self._captures = CaptureWork(store, user_id, tracker, lambda: self._snapshot)
        self._search = LesionSearch(lambda: self._snapshot, self._captures, method)
        self._edits = LesionEdits(store, user_id, lambda: self._snapshot, self.analysed, self.evidence)
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
        return describe(self._snapshot.in_force(lesion_id), self.user_name, self.evidence)

    @property
    def evidence(self) -> VisitEvidence:
        """What the searches of this session told beyond the records."""
        return self._search.evidence

    def spots(self) -> tuple[tuple[SeenSpot, ...], tuple[SeenSpot, ...]]:
        """Spots seen in this visit only, and in an earlier one only, that are no lesions."""
        return self._search.spots()

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
        return self._captures.analyse(capture, role, progress)

    def store_capture(self, new: NewCapture, progress: Progress = no_progress) -> CaptureRecord:
        """Worker: store an analysed capture and its anchors. Cancelled before the last step: no trace."""
        return self._captures.store(new, progress)

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
        """The analysis of a stored capture, from memory; `Refused` if it is not ready."""
        return self._captures.analysed(capture_id)

    def is_ready(self, capture_id: int) -> bool:
        """Whether a stored capture can be clicked on without waiting."""
        return self._captures.is_ready(capture_id)

    def prepare(self, capture_id: int, progress: Progress = no_progress) -> AnalysedCapture:
        """Worker: analyse a stored capture of this or an earlier visit, for example after reopening."""
        return self._captures.prepare(capture_id, progress)

    def correct_joints(
        self, capture_id: int, skeleton: Skeleton, progress: Progress = no_progress
    ) -> AnalysedCapture:
        """Worker: a stored capture with joints corrected by hand; its anchors are stored anew."""
        return self._captures.correct_joints(capture_id, skeleton, progress)

    # -- finding lesions again ---------------------------------------------------------------------

    @property
    def pending_count(self) -> int:
        """Known lesions still to be found on the captures of this visit."""
        return len(self._snapshot.pending())

    def find_lesions(self, progress: Progress = no_progress) -> SearchOutcome:
        """Worker: look for every pending lesion. Stores nothing; then call `adopt_search`."""
        return self._search.find(progress)

    @property
    def refinable_count(self) -> int:
        """Lesions that may be looked for again with the help of those that are decided."""
        return self._search.waiting_count() if self._search.sure_places() else 0

    def refine_lesions(self, progress: Progress = no_progress) -> SearchOutcome:
        """Worker: look again for the undecided lesions, held by the decided ones. Then `adopt_search`."""
        return self._search.refine(progress)

    def adopt_search(self, outcome: SearchOutcome) -> None:
        """Store all places found, or none. What a person decided meanwhile stays."""
        self.store.observations.put_many(outcome.drafts, by=self.user_id)
        self._search.keep(outcome)
        self._edits.set_replaced_aside()
        self.reload()
        self.fire(Event.LESIONS_RELOCATED)

    def explain(
        self, lesion_id: int, progress: Progress = no_progress
    ) -> tuple[dict[str, NDArray[np.uint8]], tuple[tuple[str, float], ...]]:
        """Worker: pictures of how the proposed place of a lesion came about; anchors with spread in m."""
        return self._search.explain(lesion_id, progress)

    def check_site(
        self, lesion_id: int, capture_id: int, pixel: Pixel, progress: Progress = no_progress
    ) -> SiteCheck:
        """Worker: whether a clicked site of a capture of this visit is that of a lesion. Stores nothing."""
        return self._search.check_site(lesion_id, capture_id, pixel, progress)

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
