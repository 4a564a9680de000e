"""Sequences of simulated hands: continuous, the same again, and what their names say."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from core.errors import InputError
from core.hand.names import POINT_NAMES
from devices.simulator.hands.bottle_motion import grasp_of
from devices.simulator.hands.model import CONFIGURATIONS, load_hand
from devices.simulator.hands.motions import HandMoment, HandMotion
from devices.simulator.hands.rendering import HandScene
from devices.simulator.hands.scene import true_points
from devices.simulator.hands.sequence import (
    RATE_HZ,
    SEQUENCES,
    USUAL_FRAMES,
    hand_motion,
    hand_sequence,
    training_frames,
    view_at,
)
from devices.simulator.hands.shots import Holder
from devices.simulator.room import make_rig
from devices.simulator.skin import TONES

RIG = make_rig((640, 480))


def motion_of(kind: str, seed: int = 1, **more: object) -> HandMotion:
    return hand_motion(kind, Holder(), USUAL_FRAMES[kind] / RATE_HZ, seed=seed, **more)  # type: ignore[arg-type]


def moments(kind: str, seed: int = 1) -> list[HandMoment]:
    motion = motion_of(kind, seed)
    return [motion.at(k / RATE_HZ) for k in range(USUAL_FRAMES[kind])]


def points_of(moment: HandMoment) -> np.ndarray:
    hand = load_hand()
    places = hand.points(hand.posed(moment.pose))
    return moment.depth_from_hand.apply(np.array([places[name] for name in POINT_NAMES]))


@pytest.mark.parametrize("kind", SEQUENCES)
def test_a_hand_goes_from_place_to_place_without_jumps(kind: str) -> None:
    motion = motion_of(kind)
    for start in np.arange(0.0, 8.0, 0.37):
        fine = [points_of(motion.at(float(start + k * 0.002))) for k in range(3)]
        step = np.linalg.norm(fine[1] - fine[0], axis=1).max()
        assert step < 0.002 * 8.0  # metres in 2 ms: fingers go at most 8 m/s when a hand flicks
        assert np.linalg.norm(fine[2] - 2 * fine[1] + fine[0], axis=1).max() < 0.003


@pytest.mark.parametrize("kind", SEQUENCES)
def test_the_seed_tells_it_all(kind: str) -> None:
    first, again, other = (motion_of(kind, seed).at(1.3) for seed in (1, 1, 2))
    assert np.array_equal(points_of(first), points_of(again))
    assert not np.allclose(points_of(first), points_of(other))


@pytest.mark.parametrize("kind", SEQUENCES)
def test_the_hand_stays_before_the_camera(kind: str) -> None:
    for moment in moments(kind)[::6]:
        places = points_of(moment)
        assert places[:, 2].min() > 0.3
        assert places[:, 2].max() < 1.15
        assert RIG.rig.depth.contains(RIG.rig.depth.project(places)).mean() > 0.9


def test_large_displacements_go_through_the_whole_view() -> None:
    shown = moments("large-displacements")
    assert len(shown) == 162
    places = np.array([m.depth_from_hand.translation for m in shown])
    pixels = RIG.rig.depth.project(places)
    assert np.ptp(pixels[:, 0]) > 0.45 * 640
    assert np.ptp(pixels[:, 1]) > 0.35 * 480
    assert np.ptp(places[:, 2]) > 0.25
    assert places[:, 2].min() > 0.48
    assert places[:, 2].max() < 1.02
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) * RATE_HZ
    assert 0.3 < np.median(speed) < 1.5
    turned = [np.degrees(np.arccos(-m.depth_from_hand.rotation[2, 2])) for m in shown]
    assert 15 < max(turned) < 37  # both tilts of 25 degrees at once
    assert {m.configuration for m in shown} == {"open"}


def test_all_configurations_are_shown_and_changes_have_no_name() -> None:
    shown = moments("configurations")
    names = [m.configuration for m in shown]
    assert set(names) == {*CONFIGURATIONS, None}
    runs = [name for name, _ in itertools.groupby(names)]
    assert all((a is None) != (b is None) for a, b in itertools.pairwise(runs))
    named = sum(name is not None for name in names)
    assert named > 0.6 * len(names)


def test_only_the_configurations_asked_for_are_shown() -> None:
    motion = motion_of("configurations", configurations=("fist", "open"))
    names = {motion.at(k / RATE_HZ).configuration for k in range(240)}
    assert names == {"fist", "open", None}


def test_something_passes_before_fingers_one_after_another() -> None:
    motion = motion_of("occlusion")
    hidden: set[str] = set()
    remarks = set()
    for k in range(0, 240, 8):
        view, moment = view_at(motion, k / RATE_HZ, Holder(), RIG)
        _, seen = true_points(view, HandScene(view), RIG)
        if moment.things:
            remarks.add(moment.remark)
            hidden |= {name for name in POINT_NAMES if not seen[name]}
        else:
            assert sum(seen[name] for name in POINT_NAMES if name.split("_")[0] != "thumb") == 12
    assert remarks == {"a bar passes", "another hand passes", "a cup passes"}
    assert {name.split("_")[0] for name in hidden} >= {"index", "middle", "ring", "little"}


@pytest.mark.parametrize("shape", ["m_young_avg", "child10", "f_old_heavy"])
def test_a_bottle_lies_in_the_hand_and_not_in_its_flesh(shape: str) -> None:
    hand = load_hand(shape)
    grasp = grasp_of(hand)
    skin = hand.posed(CONFIGURATIONS["grip"])
    away = np.linalg.norm(skin[:, 1:] - (grasp.y_m, grasp.z_m), axis=1)
    assert away[skin[:, 1] > -0.02].min() > 0.8 * grasp.radius_m
    assert (away < grasp.radius_m + 0.004).sum() > 15  # it touches the skin


def test_a_bottle_is_taken_lifted_tilted_and_put_back() -> None:
    shown = moments("bottle")
    names = [name for name, _ in itertools.groupby(m.configuration for m in shown)]
    assert names == ["open", None, "grip", None, "open"]
    foot = np.array([m.things[0].vertices[:32].mean(axis=0) for m in shown])
    cap = np.array([m.things[0].vertices[-1] for m in shown])
    assert np.allclose(cap[0], cap[-1], atol=1e-6)
    axis = (cap - foot) / np.linalg.norm(cap - foot, axis=1, keepdims=True)
    tilt = np.degrees(np.arccos(np.clip(axis @ axis[0], -1.0, 1.0)))
    assert max(tilt) > 25
    assert max(np.linalg.norm(foot - foot[0], axis=1)) > 0.06


def test_a_marker_is_lost_for_every_run_of_one_to_ten_frames_and_for_longer_ones() -> None:
    remarks = [m.remark for m in moments("marker-lost")]
    runs = [(how, len(list(run))) for how, run in itertools.groupby(remarks) if how]
    lengths = [length for _, length in runs]
    assert sorted(lengths[:10]) == list(range(1, 11))
    assert max(lengths) > 10 or len(runs) == 10
    assert {how for how, _ in runs} == {"blurred", "tilted"}


def test_a_lost_marker_is_smeared_or_edge_on() -> None:
    motion = motion_of("marker-lost")
    for k in range(USUAL_FRAMES["marker-lost"]):
        view, moment = view_at(motion, k / RATE_HZ, Holder(), RIG)
        back = -moment.depth_from_hand.rotation[2, 2]
        if moment.remark == "blurred":
            assert view.blur_px > 8
        elif moment.remark == "tilted":
            assert back < np.cos(np.radians(55))
        else:
            assert view.blur_px < 8


def test_marker_skin_and_side_stay_for_a_whole_sequence() -> None:
    holder = Holder("child10", "L", 5)
    motion = hand_motion("configurations", holder, 8.0, seed=3)
    views = [view_at(motion, t, holder, RIG)[0] for t in (0.0, 2.0, 7.0)]
    assert len({(v.markers, v.tone, v.model) for v in views}) == 1
    assert views[0].markers != Holder("child10", "L", 6).sheet()
    assert {Holder(seed=k).tone() for k in range(30)} == set(range(len(TONES)))


def test_fingers_drift_smoothly_instead_of_trembling() -> None:
    motion = motion_of("large-displacements")
    bends = np.array([motion.at(k / RATE_HZ).pose["index"].middle for k in range(162)])
    assert 1.0 < bends.std() < 8.0
    assert np.abs(np.diff(bends)).max() < 0.25 * np.ptp(bends)


def test_frames_of_a_sequence_carry_their_truth() -> None:
    frames = list(hand_sequence("configurations", Holder(seed=2), 2, seed=4, rate_hz=15.0))
    again = list(hand_sequence("configurations", Holder(seed=2), 2, seed=4, rate_hz=15.0))
    assert [f.time_s for f in frames] == [0.0, pytest.approx(1 / 15)]
    for a, b in zip(frames, again, strict=True):
        assert np.array_equal(a.capture.depth_frames, b.capture.depth_frames)
        assert a.capture.color is not None
        assert b.capture.color is not None
        assert np.array_equal(a.capture.color, b.capture.color)
        assert a.labels().array(only_visible=False).shape == (15, 3)
        assert a.labels().configuration == a.configuration


def test_training_frames_show_every_configuration_in_turn_and_never_twice_alike() -> None:
    frames = list(training_frames(Holder(), 4, seed=1, configurations=("open", "fist")))
    assert [f.configuration for f in frames] == ["open", "fist", "open", "fist"]
    assert not np.allclose(
        frames[0].labels().array(only_visible=False), frames[2].labels().array(only_visible=False)
    )


@pytest.mark.parametrize("kind", ["dance", ""])
def test_an_unknown_sequence_is_named(kind: str) -> None:
    with pytest.raises(InputError, match="no simulated sequence"):
        hand_motion(kind, Holder(), 1.0)


def test_an_unknown_configuration_is_named() -> None:
    with pytest.raises(InputError, match="no configuration 'hug'"):
        hand_motion("configurations", Holder(), 1.0, configurations=("open", "hug"))
