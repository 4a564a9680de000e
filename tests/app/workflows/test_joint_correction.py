"""What becomes of joints that the doctor corrected: anchors anew, stored, and found again after reopening."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.workflows.analysis import NewCapture
from app.workflows.joint_correction import (
    anchor_records,
    correct_candidate,
    correct_joints,
    with_stored_corrections,
)
from core.anchors import JOINT_NAMES, AnalysedCapture, JointPlacer, Skeleton, analyse_capture
from tests.app.workflows.conftest import Clinic, Take, capture_body, capture_stance


@pytest.fixture(scope="module")
def analysed(take: Take, tracker) -> AnalysedCapture:
    return analyse_capture(take("A", 1).capture, tracker, find_spots=False)


def knee_moved(analysed: AnalysedCapture) -> Skeleton:
    placer = JointPlacer(analysed.capture.rig, analysed.scan.surface)
    u, v = analysed.skeleton.joints["left_knee"].pixel
    return placer.place(analysed.skeleton, "left_knee", np.array([u + 2.0, v + 9.0]))


def test_a_correction_moves_the_anchor_and_is_stored_as_done_by_hand(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    capture_body(session, take("A", 1))
    number = session.snapshot.views["front"]
    before = session.analysed(number)
    assert with_stored_corrections(clinic.store, number, before) is before
    assert {a.name for a in anchor_records(before)} == set(JOINT_NAMES)
    stored_before = {a.name: a for a in clinic.store.anchors.list(number)}

    after = correct_joints(clinic.store, number, before, knee_moved(before))

    assert after.scan is before.scan
    assert (
        np.linalg.norm(after.anchors["left_knee"].position_m - before.anchors["left_knee"].position_m) > 0.01
    )
    assert after.anchors["left_knee"].sigma_m < before.anchors["left_knee"].sigma_m
    stored = {a.name: a for a in clinic.store.anchors.list(number)}
    assert stored["left_knee"].source == "hand"
    assert stored["left_knee"] != stored_before["left_knee"]
    assert all(stored[n] == stored_before[n] for n in stored if n != "left_knee")

    reopened = with_stored_corrections(clinic.store, number, before)
    np.testing.assert_allclose(
        reopened.skeleton.point("left_knee"), after.skeleton.point("left_knee"), atol=1e-6
    )
    assert reopened.skeleton.joints["left_knee"].source == "hand"
    assert reopened.warnings == before.warnings
    assert with_stored_corrections(clinic.store, number, reopened) is reopened


def test_a_corrected_stance_is_judged_again(analysed: AnalysedCapture) -> None:
    new = NewCapture(analysed, "psi", ("Raise the left forearm.",), ())
    judged = correct_candidate(new, knee_moved(analysed))
    assert judged.analysed.skeleton.joints["left_knee"].source == "hand"
    assert judged.corrections  # arms a little out are no psi stance
    assert correct_candidate(replace(new, role="working"), analysed.skeleton).corrections == ()


def test_a_reopened_visit_has_the_corrected_joints(clinic: Clinic, take: Take) -> None:
    session = clinic.session()
    capture_stance(session, take("psi", 1))
    capture_body(session, take("A", 1))
    number = session.snapshot.views["front"]
    corrected = session.correct_joints(number, knee_moved(session.analysed(number)))
    assert session.analysed(number) is corrected

    again = clinic.session()
    reopened = again.prepare(number)
    assert reopened.skeleton.joints["left_knee"].source == "hand"
    np.testing.assert_allclose(
        reopened.skeleton.point("left_knee"), corrected.skeleton.point("left_knee"), atol=0.02
    )
    assert again.analysed(number) is reopened
