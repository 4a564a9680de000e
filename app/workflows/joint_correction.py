"""Joints corrected by hand: the analysis from the skeleton on, the stored anchors, and their way back."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.workflows.analysis import NewCapture
from core.errors import InputError
from core.progress import Progress, no_progress
from core.records import AnchorRecord

if TYPE_CHECKING:
    from core.anchors import AnalysedCapture, Skeleton
    from core.records import ClinicStore

HAND = "hand"


def anchor_records(analysed: AnalysedCapture) -> list[AnchorRecord]:
    """The anchors of an analysed capture as they are stored."""
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


def correct_joints(
    store: ClinicStore,
    capture_id: int,
    analysed: AnalysedCapture,
    skeleton: Skeleton,
    progress: Progress = no_progress,
) -> AnalysedCapture:
    """Worker: the analysis of a stored capture with a corrected skeleton; its anchors are stored.

    Body and moles stay as they are; only the anchors are placed anew. Cancelled before the last step: no
    trace.

    Parameters
    ----------
    store : ClinicStore
    capture_id : int
    analysed : AnalysedCapture
        Of the stored capture.
    skeleton : Skeleton
        The corrected one.
    """
    from core.anchors import with_skeleton

    corrected = with_skeleton(analysed.scan, skeleton, progress=progress)
    store.anchors.put(capture_id, anchor_records(corrected))
    return corrected


def correct_candidate(new: NewCapture, skeleton: Skeleton, progress: Progress = no_progress) -> NewCapture:
    """Worker: a capture that is not stored yet with a corrected skeleton, its stance judged again."""
    from core.anchors import check_psi, with_skeleton

    analysed = with_skeleton(new.analysed.scan, skeleton, progress=progress)
    corrections = tuple(check_psi(skeleton).corrections) if new.role == "psi" else ()
    return replace(
        new, analysed=analysed, corrections=corrections, warnings=tuple(dict.fromkeys(analysed.warnings))
    )


def with_stored_corrections(
    store: ClinicStore, capture_id: int, analysed: AnalysedCapture
) -> AnalysedCapture:
    """Worker: the analysis of a stored capture with the joints that were once placed by hand.

    It is returned as it is if it has them already. A place that no longer lies on the body (after the body
    finder changed, say) is left to the tracker, with a warning.
    """
    from core.anchors import JointPlacer, by_hand, with_skeleton
    from core.anchors.names import spoken

    placed = {
        record.name: np.array([record.pixel_u, record.pixel_v])
        for record in store.anchors.list(capture_id)
        if record.source == HAND and record.pixel_u is not None and record.pixel_v is not None
    }
    if placed.keys() <= by_hand(analysed.skeleton).keys():
        return analysed
    placer = JointPlacer(analysed.capture.rig, analysed.scan.surface)
    skeleton = analysed.skeleton
    for name, pixel in placed.items():
        try:
            skeleton = placer.place(skeleton, name, pixel)
        except InputError:
            skeleton = skeleton.with_warnings(
                f"The {spoken(name)} was once placed by hand, but not on what is the body now: check it."
            )
    return with_skeleton(analysed.scan, skeleton)
