"""Relocation between real frames of the same person: the answer lies on the same part of the body.

Nobody marked skin on these people, so the part is all that can be checked: the bone of the follow-up that is
nearest to the answer. What the pictures show was looked at by eye; the lesions are places in depth pixels
(Kinect) or picture pixels (turning man) chosen by eye on bare or clothed parts.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.workflows.session import VisitSession
from app.workflows.table import Event
from core.anchors import AnalysedCapture, analyse_capture
from core.capture import RgbdCapture, read_capture
from core.records import ClinicStore, PatientDraft
from core.relocation import LesionQuery, RelocatedLesion, relocate
from devices.trackers import default_tracker

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"
KINECT, TURNING = REAL / "kinect_depth", REAL / "person_turning"

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"the real recordings are not at {REAL}"),
]

PARTS = {
    "trunk": (
        ("left_shoulder", "right_shoulder"),
        ("neck", "torso"),
        ("torso", "left_hip"),
        ("torso", "right_hip"),
    ),
    "left upper arm": (("left_shoulder", "left_elbow"),),
    "right upper arm": (("right_shoulder", "right_elbow"),),
    "left forearm": (("left_elbow", "left_hand"),),
    "right forearm": (("right_elbow", "right_hand"),),
}
OF_FRAME_04 = {
    "trunk": (330, 310),
    "left upper arm": (450, 270),
    "right upper arm": (165, 288),
    "left forearm": (501, 240),
    "right forearm": (112, 265),
}


@cache
def kinect(frame: str) -> AnalysedCapture:
    return analyse_capture(read_capture(KINECT / frame), default_tracker())


@cache
def answers(followup: str) -> dict[str, RelocatedLesion]:
    queries = [LesionQuery(name, depth_pixel=pixel) for name, pixel in OF_FRAME_04.items()]
    return {x.id: x for x in relocate(kinect("04"), kinect(followup), queries).lesions}


def part_of(analysed: AnalysedCapture, point: np.ndarray) -> str:
    """Part whose bone is nearest to a place on the skin."""

    def distance(a: str, b: str) -> float:
        joints = analysed.skeleton.joints
        if a not in joints or b not in joints:
            return np.inf
        p, q = joints[a].point_m, joints[b].point_m
        share = np.clip((point - p) @ (q - p) / max((q - p) @ (q - p), 1e-9), 0, 1)
        return float(np.linalg.norm(point - p - share * (q - p)))

    return min(PARTS, key=lambda part: min(distance(a, b) for a, b in PARTS[part]))


@pytest.mark.parametrize("followup", ["02", "03", "05", "08"])
@pytest.mark.parametrize("part", list(OF_FRAME_04))
def test_an_answer_lies_on_the_same_part_of_the_same_side(followup: str, part: str) -> None:
    answer = answers(followup)[part]
    if answer.point_m is None:
        assert answer.reason
        return
    found = part_of(kinect(followup), answer.point_m)
    # Near shoulder and elbow two bones are equally near: the neighbour on the same side is no error.
    allowed = {part, part.replace("forearm", "upper arm"), part.replace("upper arm", "forearm")}
    if "upper arm" in part:
        allowed.add("trunk")
    assert found in allowed


@pytest.mark.parametrize("followup", ["02", "03", "05", "08"])
def test_chest_and_upper_arms_in_plain_view_are_answered(followup: str) -> None:
    for part in ("trunk", "left upper arm", "right upper arm"):
        assert answers(followup)[part].point_m is not None, answers(followup)[part].reason


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_forearm_is_answered_in_some_frame(side: str) -> None:
    assert any(answers(f)[f"{side} forearm"].point_m is not None for f in ("02", "03", "05", "08"))


def test_a_small_turn_of_a_real_man_goes_through_two_visits(tmp_path: Path) -> None:
    """Colour and depth of a man who turns by about ten degrees; moles clicked on both arms."""
    clicks = {"right": (220, 395), "right lower": (230, 440), "left": (420, 440)}
    with ClinicStore.open(tmp_path / "clinic") as store:
        user = store.users.create("real", "Reader", "a long password")
        patient = store.patients.create(PatientDraft("Turning"), by=user.id)
        first = _visit(store, user.id, patient.id, read_capture(TURNING / "00"))
        first.fire(Event.GO_LESIONS)
        capture_id = max(first.snapshot.views.values())
        numbers = {first.mark(capture_id, pixel)[0].id: name for name, pixel in clicks.items()}
        first.fire(Event.GO_REVIEW)
        first.close()
        second = _visit(store, user.id, patient.id, read_capture(TURNING / "10"))
        second.adopt_search(second.find_lesions())
        analysed = second.analysed(max(second.snapshot.views.values()))
        for lesion_id, name in numbers.items():
            o = second.snapshot.in_force(lesion_id)
            assert o is not None
            assert o.point_m is not None, (name, o.reason)
            assert part_of(analysed, np.array(o.point_m)).startswith((name.split()[0], "trunk"))
            assert o.pixel is not None
            assert np.hypot(*np.subtract(o.pixel, clicks[name])) < 90


def _visit(store: ClinicStore, user_id: int, patient_id: int, capture: RgbdCapture) -> VisitSession:
    session = VisitSession.begin(store, user_id, patient_id, default_tracker)
    stance = session.take_stance(capture)
    session.adopt_stance(stance)
    if session.stance_candidate is not None:
        session.store_capture(session.stance_candidate)
        session.adopt_accepted_stance()
    session.fire(Event.GO_CAPTURE)
    session.adopt_working(session.take_working(capture))
    return session
