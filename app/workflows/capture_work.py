"""Captures of a visit: analysed in a worker, stored, and kept in memory ready to be clicked on."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from app.workflows.analysis import AnalysisCache, NewCapture, Role, TrackerSource, analyse_new
from app.workflows.joint_correction import anchor_records, correct_joints, with_stored_corrections
from app.workflows.snapshot import VisitSnapshot
from app.workflows.table import Refused
from core.capture.rgbd import RgbdCapture
from core.progress import Progress, ScaledProgress, no_progress
from core.records import CaptureRecord

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture, Skeleton, SkeletonCalibration
    from core.records import ClinicStore


class CaptureWork:
    """The captures of one visit and of the visits before it.

    Parameters
    ----------
    store : ClinicStore
    user_id : int
    tracker : callable
        Gives the skeleton tracker; called in the worker.
    snapshot : callable
        The records as they are now.
    """

    def __init__(
        self,
        store: ClinicStore,
        user_id: int,
        tracker: TrackerSource,
        snapshot: Callable[[], VisitSnapshot],
    ) -> None:
        self._store, self._user_id, self._tracker, self._snapshot = store, user_id, tracker, snapshot
        self._cache = AnalysisCache(store.captures.load, tracker)

    def analyse(self, capture: RgbdCapture, role: Role, progress: Progress = no_progress) -> NewCapture:
        """Find body, joints and anchors of a new capture. Stores nothing."""
        calibration = None
        if role == "working":
            calibration = self._calibration(self._snapshot().visit.id, ScaledProgress(progress, 0.0, 0.3))
            progress = ScaledProgress(progress, 0.3, 1.0)
        return analyse_new(capture, role, self._tracker, calibration=calibration, progress=progress)

    def store(self, new: NewCapture, progress: Progress = no_progress) -> CaptureRecord:
        """Store an analysed capture and its anchors. Cancelled before the last step: no trace."""
        record = self._store.captures.add(
            self._snapshot().visit.id, new.analysed.capture, new.role, by=self._user_id, progress=progress
        )
        self._store.anchors.put(record.id, anchor_records(new.analysed))
        self._cache.put(record.id, new.analysed)
        _warm_up_clicks(new.analysed)
        return record

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
        """Analyse a stored capture of this or an earlier visit, for example after reopening."""
        record = self._snapshot().captures[capture_id]
        calibration = None
        if record.role == "working" and not self.is_ready(capture_id):
            calibration = self._calibration(record.visit_id, ScaledProgress(progress, 0.0, 0.4))
            progress = ScaledProgress(progress, 0.4, 1.0)
        analysed = self._with_corrections(capture_id, calibration, progress)
        _warm_up_clicks(analysed)
        return analysed

    def correct_joints(
        self, capture_id: int, skeleton: Skeleton, progress: Progress = no_progress
    ) -> AnalysedCapture:
        """A stored capture with joints corrected by hand; its anchors are stored anew."""
        corrected = correct_joints(self._store, capture_id, self.analysed(capture_id), skeleton, progress)
        self._cache.put(capture_id, corrected)
        return corrected

    def _with_corrections(
        self, capture_id: int, calibration: SkeletonCalibration | None, progress: Progress
    ) -> AnalysedCapture:
        found = self._cache.get(capture_id, calibration=calibration, progress=progress)
        corrected = with_stored_corrections(self._store, capture_id, found)
        if corrected is not found:
            self._cache.put(capture_id, corrected)
        return corrected

    def _calibration(self, visit_id: int, progress: Progress) -> SkeletonCalibration | None:
        from core.anchors import calibrate_skeleton

        stance = self._snapshot().stance_of(visit_id)
        if stance is None:
            return None
        return calibrate_skeleton(self._with_corrections(stance.id, None, progress).skeleton)


def _warm_up_clicks(analysed: AnalysedCapture) -> None:
    """Make what the first click needs (search trees, compiled kernels), so that it is quick."""
    from core.surface import pick_skin

    rig = analysed.capture.rig
    pick_skin(analysed.scan, rig.project_to_picture(analysed.scan.surface.vertices.mean(axis=0))[0])
