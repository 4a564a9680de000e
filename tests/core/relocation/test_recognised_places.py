"""A place is answered only where the moles around it are recognised: a limb carried wrongly tells nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.anchors import analyse_capture
from core.progress import no_progress
from core.relocation import LesionQuery, RelocationOptions
from core.relocation.bones import Bone
from core.relocation.clock import PhaseClock
from core.relocation.judgement import judge
from core.relocation.moles import FirstMoles
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.recognition import Recognition, limbs_of_bones, lost_places, recognise
from core.relocation.registry import MethodContext
from core.relocation.relocate import pick_query
from core.relocation.transfer import transfer_skin
from devices.simulator import SimulatedPatient, make_rig

ARM, TRUNK = 1, 0


def moles_along_an_arm(count=12, spacing_m=0.02, lesions=1, twin=None):
    """Moles in a row, the first ones lesions in question."""
    places = np.column_stack([np.arange(count) * spacing_m, np.zeros(count), np.full(count, 2.0)])
    rows = np.arange(count)
    return FirstMoles(
        places=places,
        normals=np.tile([0.0, 0.0, -1.0], (count, 1)),
        coordinates=places,
        spot=rows,
        lesions=lesions,
        healed=np.zeros(count, bool),
        twin=rows if twin is None else np.array(twin),
    )


def lost(moles, sure, limb=None):
    rows = np.arange(len(moles.places))
    limb = np.full(len(rows), ARM) if limb is None else np.array(limb)
    return lost_places(moles, limb, rows, np.array(sure, bool))


def test_a_match_among_moles_that_found_no_partner_is_not_believed():
    told = lost(moles_along_an_arm(), [True] * 4 + [False] * 8)
    assert set(told) == {0}
    assert "moles around it" in told[0]


def test_a_match_among_recognised_moles_is_believed():
    assert not lost(moles_along_an_arm(), [True] * 10 + [False] * 2)


def test_few_moles_that_were_not_recognised_decide_nothing():
    assert not lost(moles_along_an_arm(4), [True, False, False, False])


def test_moles_far_away_on_the_limb_say_little():
    near, far = moles_along_an_arm(12, spacing_m=0.01), moles_along_an_arm(12, spacing_m=0.15)
    sure = [True] * 3 + [False] * 9
    assert lost(near, sure)
    assert not lost(far, sure)


def test_moles_of_another_limb_bear_no_witness():
    sure = [True] * 4 + [False] * 4 + [True] * 4
    limb = [ARM] * 8 + [TRUNK] * 4
    assert not lost(moles_along_an_arm(spacing_m=0.005), sure)
    assert set(lost(moles_along_an_arm(spacing_m=0.005), sure, limb)) == {0}


def test_a_lesion_is_no_witness_for_itself_nor_is_its_double():
    four_of_seven = [True] * 4 + [False] * 3
    one, double = moles_along_an_arm(8), moles_along_an_arm(8, twin=[0, 0, 2, 3, 4, 5, 6, 7])
    assert not lost(one, [False, *four_of_seven])
    assert lost(one, [True, False, *four_of_seven[:3], *[False] * 3]), "three of seven beside its own match"
    assert set(lost(double, [True, *four_of_seven])) == {0}, "only three of six others"


def test_forearm_and_upper_arm_are_one_limb():
    def bone(name, parent):
        return Bone(name, np.zeros(3), np.ones(3), 0.1, np.eye(3), np.zeros(3), parent)

    skeleton = (
        bone("trunk", None),
        bone("left_shoulder to left_elbow", 0),
        bone("left_elbow to left_hand", 1),
        bone("right_hip to right_knee", 0),
    )
    assert limbs_of_bones(skeleton).tolist() == [0, 1, 1, 3]


class RecordedJoints:
    """Recorded joints need no tracker; asking one is an error."""

    name = "none"

    def detect(self, rgb):
        raise AssertionError("the recorded joints were not used")

    def close(self):
        pass


@pytest.fixture(scope="module")
def seen_twice():
    """A pair of one person in the same stance, carried over, and its lesions."""
    person = SimulatedPatient("m_young_avg", 5, 60, lesions=12, rig=make_rig((960, 720)))
    shots = [
        person.capture("psi", "front", visit, frames=2, seed=visit, joints=True, distance_m=2.5)
        for visit in (1, 2)
    ]
    pair = VisitPair(*(analyse_capture(shot.capture, RecordedJoints()) for shot in shots))
    truth = shots[0].truth
    lesions = []
    for name in truth.lesion_ids:
        row = truth.mole_row[name]
        if truth.mole_visible[row]:
            query = LesionQuery(name, tuple(truth.mole_pixels[row]))
            pick = pick_query(pair.first, query)
            lesions.append(PickedLesion(query, pick.point, pick.normal))
    context = MethodContext(RelocationOptions(), True, 0, PhaseClock(), no_progress, ())
    return pair, transfer_skin(pair, lesions, context)


def test_where_the_person_is_recognised_every_place_is(seen_twice):
    pair, transfer = seen_twice
    told = recognise(pair, transfer)
    assert not told.obstacle
    assert not told.places


def test_a_spot_seen_again_is_no_answer_where_its_surroundings_are_not(seen_twice):
    pair, transfer = seen_twice
    before = judge(pair, transfer, Recognition(), None)
    row = next(k for k, estimate in enumerate(before) if estimate.appearance_matched)
    after = judge(pair, transfer, Recognition(places={row: "not recognised"}), None)
    assert after[row].point_m is None
    assert after[row].reason == "not recognised"
    others = [k for k in range(len(before)) if k != row and transfer.moles.twin[k] != row]
    assert [after[k].reason for k in others] == [before[k].reason for k in others]


def test_skin_that_faces_away_is_not_seen_again_whatever_spot_lies_there(seen_twice):
    pair, transfer = seen_twice
    before = judge(pair, transfer, Recognition(), None)
    row = next(k for k, estimate in enumerate(before) if estimate.appearance_matched)
    normals = transfer.normals.copy()
    normals[row] *= -1.0
    after = judge(pair, replace(transfer, normals=normals), Recognition(), None)[row]
    assert not after.appearance_matched
    assert "turned away" in after.hidden
