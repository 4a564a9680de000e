"""What happens between two visits of a simulated pair, and that the pairs keep their promises."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.errors import InputError
from devices.simulator import (
    CALIBRATION_PAIRS,
    CALIBRATION_SHAPES,
    DEMANDING,
    STANCES,
    STILL,
    TEST_PAIRS,
    TEST_SHAPES,
    TUNING_PAIRS,
    TUNING_SHAPES,
    SimulatedCapture,
    SimulatedPair,
    SimulatedPatient,
    VisitChange,
    make_pair,
    make_rig,
    read_truth,
    write_simulated,
)
from devices.simulator.body import load_body, pose_body
from devices.simulator.figure import skin_slide
from devices.simulator.stances import Posture, take_stance

SPLITS = {TUNING_PAIRS: TUNING_SHAPES, CALIBRATION_PAIRS: CALIBRATION_SHAPES, TEST_PAIRS: TEST_SHAPES}
HEALED = tuple(f"L{k:02d}" for k in range(1, 25))


@pytest.mark.parametrize("pairs", SPLITS)
def test_a_split_uses_its_own_shapes_and_all_of_them(pairs: tuple[SimulatedPair, ...]) -> None:
    assert {pair.shape for pair in pairs} == set(SPLITS[pairs])


def test_no_two_pairs_share_a_seed_and_there_are_enough() -> None:
    everyone = [pair for pairs in SPLITS for pair in pairs]
    assert len({pair.seed for pair in everyone}) == len(everyone)
    assert (len(TUNING_PAIRS), len(CALIBRATION_PAIRS), len(TEST_PAIRS)) == (24, 40, 42)


@pytest.mark.parametrize("pairs", SPLITS)
def test_a_split_is_a_fair_mix(pairs: tuple[SimulatedPair, ...]) -> None:
    same = [pair for pair in pairs if pair.group == "same stance"]
    assert len(same) == len(pairs) // 2
    assert {pair.followup for pair in pairs} == set(STANCES)
    assert 0.2 < np.mean([pair.view == "back" for pair in pairs]) < 0.5
    assert {abs(pair.turn_deg) for pair in pairs} >= {0.0, 10.0, 20.0}
    assert {pair.followup_distance_m for pair in pairs} == {None, 1.8, 2.8}
    assert min(pair.weight_change for pair in pairs) == -0.05
    assert max(pair.weight_change for pair in pairs) == 0.05
    assert {60, 180, 480} <= {pair.moles for pair in pairs}
    for trait in ("missing", "healed", "body_hair", "new_moles", "vanished"):
        assert any(getattr(pair, trait) for pair in pairs)


def test_the_pairs_are_frozen() -> None:
    """These rows were published with figures; another rule would be another benchmark."""
    assert TEST_PAIRS[3] == SimulatedPair(
        "m_36_obese",
        3003,
        "psi",
        "hip_hands",
        weight_change=0.05,
        new_moles=2,
        vanished=6,
        body_hair=1.0,
    )
    assert [(p.shape, p.first, p.followup, p.view) for p in TUNING_PAIRS[:3]] == [
        ("m_young_avg", "psi", "psi", "front"),
        ("f_old_heavy", "A", "psi", "front"),
        ("child10", "A", "A", "back"),
    ]


def test_a_pair_is_two_visits_as_described() -> None:
    pair = replace(TEST_PAIRS[6], moles=60, missing=("left_forearm",))
    patient, first, followup = make_pair(pair, 1, make_rig((320, 240)))
    assert patient.shape == pair.shape
    assert (first.capture.stance, followup.capture.stance) == (pair.first, pair.followup)
    assert len(first.truth.mole_ids) == 60
    assert len(set(followup.truth.mole_ids) - set(first.truth.mole_ids)) == pair.new_moles
    assert len(set(first.truth.mole_ids) - set(followup.truth.mole_ids)) == pair.vanished
    elbow, hand = (first.truth.joints_m[f"left_{name}"] for name in ("elbow", "hand"))
    other = np.linalg.norm(first.truth.joints_m["right_hand"] - first.truth.joints_m["right_elbow"])
    assert np.linalg.norm(hand - elbow) < 0.6 * other


@pytest.fixture(scope="module")
def visits() -> tuple[SimulatedCapture, SimulatedCapture]:
    """A dummy before and after moles came, went and healed, seen in the same stance."""
    change = VisitChange(new_moles=40, vanished=40, healed=HEALED)
    patient = SimulatedPatient(
        "m_52_avg", 4, 120, lesions=30, changes={2: change}, variation=STILL, rig=make_rig((1000, 750))
    )
    one, two = (patient.capture("A", visit=visit, frames=1, seed=1, distance_m=2.0) for visit in (1, 2))
    return one, two


def _darkness(simulated: SimulatedCapture, pixels: np.ndarray) -> np.ndarray:
    """Log of the brightness around places over the brightness there."""
    assert simulated.capture.color is not None
    grey = simulated.capture.color.astype(float).mean(axis=2)
    out = []
    for u, v in np.rint(pixels).astype(int):
        around = grey[max(v - 7, 0) : v + 8, max(u - 7, 0) : u + 8]
        out.append(np.log(np.median(around) / grey[v, u]))
    return np.array(out)


def _pixels(simulated: SimulatedCapture, names: list[str]) -> np.ndarray:
    truth = simulated.truth
    rows = [truth.mole_row[name] for name in names]
    return truth.mole_pixels[[row for row in rows if truth.mole_visible[row]]]


def test_new_and_vanished_moles_are_where_the_truth_says(
    visits: tuple[SimulatedCapture, SimulatedCapture],
) -> None:
    one, two = visits
    came = sorted(set(two.truth.mole_ids) - set(one.truth.mole_ids))
    went = sorted(set(one.truth.mole_ids) - set(two.truth.mole_ids))
    new, gone = _pixels(two, came), _pixels(one, went)
    assert min(len(new), len(gone)) > 6
    # the dummy stands still: the same pixel is the same skin at both visits
    for places, with_them, without in ((new, two, one), (gone, one, two)):
        assert np.median(_darkness(with_them, places)) > 0.15
        assert abs(np.median(_darkness(without, places))) < 0.03


def test_a_healed_lesion_is_pale_and_its_place_stays(
    visits: tuple[SimulatedCapture, SimulatedCapture], tmp_path
) -> None:
    one, two = visits
    assert one.truth.healed_ids == ()
    assert two.truth.healed_ids == HEALED
    seen = [n for n in HEALED if one.truth.mole_visible[one.truth.mole_row[n]]]
    assert len(seen) >= 3
    before, after = _darkness(one, _pixels(one, seen)), _darkness(two, _pixels(two, seen))
    assert np.median(before) > 0.15
    # a place at the body's rim or beside another mole may be darker than its surroundings for that reason
    assert np.median(after) < 0.0
    assert np.mean(after < 0.05) > 0.6
    assert (after < before).all()
    assert after.min() > -0.2
    rows = [[c.truth.mole_row[n] for n in HEALED] for c in visits]
    assert np.array_equal(one.truth.mole_triangle[rows[0]], two.truth.mole_triangle[rows[1]])
    assert np.allclose(one.truth.mole_barycentric[rows[0]], two.truth.mole_barycentric[rows[1]])
    write_simulated(two, tmp_path)
    assert read_truth(tmp_path, two.capture.rig).healed_ids == HEALED


def test_an_unknown_lesion_cannot_heal() -> None:
    patient = SimulatedPatient(moles=20, lesions=5, changes={2: VisitChange(healed=("L77",))})
    with pytest.raises(InputError, match="L77"):
        patient.moles(2)


def test_other_moles_are_faint_at_every_visit_and_the_same_again_when_asked_again() -> None:
    def patient() -> SimulatedPatient:
        return SimulatedPatient("m_52_avg", 4, 480, variation=DEMANDING)

    one, two = patient().moles(1), patient().moles(2)
    assert 0.03 < len(one.faint) / 480 < 0.10
    assert len(one.faint & two.faint) < 0.5 * len(one.faint)
    assert patient().moles(2).faint == two.faint
    plain = SimulatedPatient("m_52_avg", 4, 480).moles(1).marks.opacity
    share = one.marks.opacity / plain
    hidden = np.array([name in one.faint for name in one.ids])
    assert share[hidden].max() <= 0.30
    assert share[~hidden].min() >= 0.75


def test_moles_do_not_fade_unless_asked() -> None:
    patient = SimulatedPatient("m_52_avg", 4, 100)
    assert patient.moles(1).faint == frozenset()
    assert (patient.moles(1).marks.opacity == patient.moles(2).marks.opacity).all()


def test_hair_draws_thin_dark_lines_on_skin_only() -> None:
    rig = make_rig((1000, 750))
    bare, hairy = (
        SimulatedPatient("m_52_avg", 4, 60, variation=STILL, body_hair=amount, rig=rig).capture(
            "A", frames=1, seed=1, distance_m=2.0
        )
        for amount in (0.0, 1.0)
    )
    assert bare.capture.color is not None
    assert hairy.capture.color is not None
    change = hairy.capture.color.astype(float).mean(axis=2) - bare.capture.color.astype(float).mean(axis=2)
    person = bare.truth.triangle >= 0
    beside = cv2.dilate(person.astype(np.uint8), np.ones((9, 9), np.uint8)) == 0
    assert np.abs(change[beside]).max() == 0.0
    assert change[person].max() <= 2.0
    assert np.mean(change[person] < -4.0) > 0.03
    assert (bare.capture.depth_frames == hairy.capture.depth_frames).all()
    with pytest.raises(InputError, match="hair"):
        SimulatedPatient(body_hair=2.0)


@pytest.mark.parametrize(("stance", "least", "most"), [("T", 5.0, 8.0), ("up", 5.0, 8.0), ("down", 0.0, 4.0)])
def test_raised_arms_draw_the_skin_of_the_torso(stance: str, least: float, most: float) -> None:
    body = load_body("f_44_avg")
    posed = pose_body(body, take_stance(Posture(body), stance))
    torso = body.bone_weight("spine", "clavicle", "shoulder", "breast") > 0.6
    for seed in range(3):
        slid = skin_slide(posed, np.random.default_rng(seed), torso_too=True)
        assert least <= 1e3 * np.linalg.norm(slid[torso], axis=1).max() <= most
