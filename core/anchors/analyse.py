"""One call from what a device hands over to everything that relocation needs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from core.anchors.calibration import SkeletonCalibration
from core.anchors.finding import find_skeleton
from core.anchors.skeleton import Skeleton, SkeletonTracker
from core.anchors.skin_anchors import AnchorSet, project_to_skin
from core.capture.rgbd import RgbdCapture
from core.lesions import SkinSpots, spots_of
from core.progress import Progress, ScaledProgress, no_progress
from core.surface import BodyScan, scan_body


@dataclass(frozen=True, eq=False)
class AnalysedCapture:
    """A capture with its body surface, skeleton and anchors.

    Attributes
    ----------
    capture : RgbdCapture
    scan : BodyScan
    skeleton : Skeleton
    anchors : AnchorSet
        All of them; `AnchorSet.reliable` gives those one may trust.
    warnings : tuple of str
        Of the scan and of the skeleton, for the doctor.
    """

    capture: RgbdCapture
    scan: BodyScan
    skeleton: Skeleton
    anchors: AnchorSet
    warnings: tuple[str, ...]

    @property
    def spots(self) -> SkinSpots:
        """The mole-like spots of the picture, found once for each scan."""
        return spots_of(self.scan)


def analyse_capture(
    capture: RgbdCapture,
    tracker: SkeletonTracker,
    *,
    use_recorded: bool = True,
    calibration: SkeletonCalibration | None = None,
    find_spots: bool = True,
    progress: Progress = no_progress,
) -> AnalysedCapture:
    """Scan the body, find its joints, move them to the skin.

    Parameters
    ----------
    capture : RgbdCapture
    tracker : SkeletonTracker
    use_recorded, calibration
        See `find_skeleton`.
    find_spots : bool
        Find the spots on the other core while the joints are found. False leaves them to their first use.

    Raises
    ------
    WorkError
        If there is no body or no person is recognised.
    Cancelled
        Through ``progress``.
    """
    scan = scan_body(capture, progress=ScaledProgress(progress, 0.0, 0.6))
    progress(0.6, "Finding the joints")
    with ThreadPoolExecutor(1, "spots") as beside:
        spots = beside.submit(spots_of, scan) if find_spots else None
        skeleton = find_skeleton(scan, tracker, use_recorded=use_recorded, calibration=calibration)
        progress(0.85, "Finding the moles")
        if spots is not None:
            spots.result()
    return with_skeleton(scan, skeleton, progress=ScaledProgress(progress, 0.9, 1.0))


def with_skeleton(scan: BodyScan, skeleton: Skeleton, *, progress: Progress = no_progress) -> AnalysedCapture:
    """The analysis of a scan with a given skeleton, for example after joints were placed by hand."""
    progress(0.0, "Placing the anchors")
    anchors = project_to_skin(skeleton, scan.surface)
    warnings = tuple(dict.fromkeys((*scan.warnings, *skeleton.warnings)))
    progress(1.0)
    return AnalysedCapture(scan.capture, scan, skeleton, anchors, warnings)
