"""Which earlier view is laid over the live picture, and its outline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.workflows.snapshot import VisitSnapshot

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from core.capture.rgbd import CameraRig
    from core.records import CaptureRecord, ClinicStore


def ghost_record(snapshot: VisitSnapshot, role: str, view: str) -> CaptureRecord | None:
    """The newest capture of the same role and side of an earlier visit, else of this visit.

    Of this visit only another take of the same view serves: to repeat a capture as it stood.
    """
    earlier = {visit.id for visit in snapshot.earlier}
    same = [c for c in snapshot.captures.values() if c.role == role and c.view == view]
    before = [c for c in same if c.visit_id in earlier]
    return max(before or same, key=lambda c: c.id, default=None)


def ghost_name(snapshot: VisitSnapshot, record: CaptureRecord) -> str:
    """What the outline is called."""
    return "Outline of this visit" if record.visit_id == snapshot.visit.id else "Outline of the last visit"


def ghost_outlines(store: ClinicStore, capture_id: int, rig: CameraRig) -> list[NDArray[np.float64]]:
    """Worker: the outline of a stored capture in the pixels of a live picture.

    Raises
    ------
    GeodermError
        If the capture cannot be read or shows nobody.
    """
    from core.guidance import Ghost

    return list(Ghost.of_capture(store.captures.load(capture_id, frames=1)).outlines(rig))
