"""A capture from the camera to its verdict, and once more after its joints were corrected by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.workflows.analysis import NewCapture, Role, take
from app.workflows.joint_correction import correct_candidate
from core.progress import Progress, ScaledProgress

if TYPE_CHECKING:
    from app.workflows.session import VisitSession
    from core.anchors import Skeleton
    from core.guidance import CaptureQuality
    from devices.camera import DepthCamera


@dataclass(frozen=True, eq=False)
class Judged:
    """A new capture and its verdict.

    Attributes
    ----------
    new : NewCapture
    quality : CaptureQuality
    stored : int or None
        Id of the capture if it was good enough to be stored at once.
    """

    new: NewCapture
    quality: CaptureQuality
    stored: int | None

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict's sentences, then what the skeleton has to say."""
        return tuple(dict.fromkeys((*self.quality.sentences, *self.new.analysed.skeleton.warnings)))


def capture_and_judge(
    camera: DepthCamera,
    session: VisitSession,
    role: Role,
    *,
    view: str | None,
    stance: str | None,
    frames: int,
    strict: bool,
    progress: Progress,
) -> Judged:
    """Worker: take a capture, analyse it, judge it, and store it if there is nothing to ask.

    Parameters
    ----------
    camera, session, role, view, stance, frames
        As for `app.workflows.analysis.take` and `VisitSession.analyse`.
    strict : bool
        Whether a capture that is merely usable is asked about; one that cannot be taken again is not.
    progress : Progress
    """
    from core.guidance import judge_capture

    capture = take(
        camera, view=view, stance=stance, frames=frames, progress=ScaledProgress(progress, 0.0, 0.4)
    )
    new = session.analyse(capture, role, ScaledProgress(progress, 0.4, 0.85))
    quality = judge_capture(new.analysed)
    fine = quality.grade == "good" or (quality.grade == "usable" and not strict)
    if not (fine and new.good):
        return Judged(new, quality, None)
    record = session.store_capture(new, ScaledProgress(progress, 0.85, 1.0))
    return Judged(new, quality, record.id)


def correct_and_judge(new: NewCapture, skeleton: Skeleton, progress: Progress) -> Judged:
    """Worker: a capture that is not stored yet, with joints placed by hand. Stores nothing."""
    from core.guidance import judge_capture

    corrected = correct_candidate(new, skeleton, progress)
    return Judged(corrected, judge_capture(corrected.analysed), None)
