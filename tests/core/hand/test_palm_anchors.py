"""Anchors of a hand without a marker, by the real detector on rendered hands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.capture.transform import RigidTransform
from core.errors import InputError
from core.hand.finders import finder_for
from core.hand.hand_model import HandModel
from core.hand.landmarks import HandLandmarks
from core.hand.marker_anchors import MarkerAnchors
from core.hand.palm_anchors import PALM_LANDMARKS, PALM_NAMES, PalmAnchors
from devices.simulator.hands.shots import HandVariation, Holder, hand_view, shoot
from devices.simulator.room import make_rig
from devices.trackers.mediapipe_hands import MediaPipeHands

SEEDS = (901, 902, 906)


class Says:
    """A detector that has found these landmarks (or none) already."""

    def __init__(self, found: HandLandmarks | None) -> None:
        self.found = found

    def detect(self, rgb: np.ndarray) -> HandLandmarks | None:
        return self.found

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def detector():
    hands = MediaPipeHands()
    yield hands
    hands.close()


def seen_by(frame) -> tuple:
    capture = frame.capture
    return capture.color, capture.depth_frames[0] * capture.depth_unit_m, capture.rig


def hand_pose(holder: Holder, configuration: str, seed: int) -> RigidTransform:
    """Depth frame from hand frame of what `shoot` shows with the same arguments."""
    rng = np.random.default_rng((0x5407, seed, holder.seed))
    return hand_view(holder, configuration, rng).depth_from_hand


@pytest.fixture(scope="module")
def bare():
    """Frames of one bare hand in different configurations and views, with their true hand pose."""
    holder = Holder("m_33_short", seed=21, marker_m=0.0)
    return [
        (shoot(holder, name, seed), hand_pose(holder, name, seed))
        for name, seed in zip(("open", "grip", "two"), SEEDS, strict=True)
    ]


@pytest.fixture(scope="module")
def looked(bare, detector):
    """What the detector finds in the first of them."""
    return detector.detect(bare[0][0].capture.color)


def test_the_anchors_are_the_same_spots_of_the_skin_in_every_frame(bare, detector) -> None:
    finder = PalmAnchors(detector)
    assert (finder.kind, finder.count) == ("palm", len(PALM_NAMES))
    on_the_hand = []
    for frame, pose in bare:
        found = finder.find(*seen_by(frame))
        assert found.seen
        assert found.places_m.shape == (5, 3)
        on_the_hand.append(pose.inverse().apply(found.places_m))
    places = np.array(on_the_hand)
    apart = np.linalg.norm(places - np.median(places, axis=0), axis=2)
    assert np.median(apart) < 0.006
    assert apart.max() < 0.016


def test_the_knuckles_are_near_the_true_knuckles(bare, detector) -> None:
    frame, _ = bare[0]
    places = PalmAnchors(detector).find(*seen_by(frame)).places_m
    for name, place in zip(PALM_NAMES[1:], places[1:], strict=True):
        assert np.linalg.norm(place - frame.points_m[name]) < 0.02, name


def test_anchors_lie_on_the_hand_and_not_on_the_wall_behind_it(bare, detector) -> None:
    for frame, _ in bare:
        near = np.array(list(frame.points_m.values()))
        places = PalmAnchors(detector).find(*seen_by(frame)).places_m
        assert (places[:, 2] < near[:, 2].max() + 0.05).all()


def test_without_a_hand_there_are_no_anchors_and_it_is_said(bare, detector) -> None:
    _, depth, rig = seen_by(bare[0][0])
    found = PalmAnchors(detector).find(np.full((480, 640, 3), 120, np.uint8), depth, rig)
    assert not found.seen
    assert "No hand" in found.reason
    assert np.isnan(found.places_m).all()


def test_without_a_colour_picture_it_is_said(bare, detector) -> None:
    _, depth, rig = seen_by(bare[0][0])
    found = PalmAnchors(detector).find(None, depth, rig)
    assert not found.seen
    assert "colour" in found.reason


def test_a_hand_that_the_depth_camera_does_not_measure_has_no_anchors(bare, looked) -> None:
    rgb, depth, rig = seen_by(bare[0][0])
    found = PalmAnchors(Says(looked)).find(rgb, np.zeros_like(depth), rig)
    assert not found.seen
    assert "depth camera" in found.reason
    assert np.isnan(found.places_m).all()


def test_landmarks_beyond_the_images_border_give_no_anchors(bare, looked) -> None:
    rgb, depth, rig = seen_by(bare[0][0])
    for shift in ((-900.0, 0.0), (900.0, 0.0), (0.0, -700.0), (0.0, 700.0)):
        outside = replace(looked, pixels=looked.pixels + shift)
        assert not PalmAnchors(Says(outside)).find(rgb, depth, rig).seen


def test_one_anchor_that_is_not_measured_is_missing_and_the_others_stay(bare, looked) -> None:
    frame, _ = bare[0]
    rgb, depth, rig = seen_by(frame)
    whole = PalmAnchors(Says(looked)).find(rgb, depth, rig).places_m
    u, v = np.rint(rig.depth.project(whole[2])[0]).astype(int)
    holed = depth.copy()
    holed[v - 14 : v + 15, u - 14 : u + 15] = 0.0
    found = PalmAnchors(Says(looked)).find(rgb, holed, rig)
    assert found.seen
    assert np.isnan(found.places_m[2]).all()
    np.testing.assert_allclose(found.places_m[[0, 1, 4]], whole[[0, 1, 4]], atol=0.003)


def test_something_before_a_knuckle_is_not_taken_for_the_knuckle(bare, looked) -> None:
    rgb, depth, rig = seen_by(bare[0][0])
    whole = PalmAnchors(Says(looked)).find(rgb, depth, rig).places_m
    u, v = np.rint(rig.depth.project(whole[4])[0]).astype(int)
    covered = depth.copy()
    covered[v - 9 : v + 10, u - 5 : u + 12] = whole[4, 2] - 0.06
    found = PalmAnchors(Says(looked)).find(rgb, covered, rig)
    assert found.seen
    assert np.isnan(found.places_m[4]).all()
    # with the finger beside it covered too, too few are left
    covered[v - 12 : v + 13, u - 25 : u + 12] = whole[4, 2] - 0.06
    nothing = PalmAnchors(Says(looked)).find(rgb, covered, rig)
    assert not nothing.seen
    assert "covered" in nothing.reason


def test_a_picture_of_a_hand_that_would_be_a_giants_is_refused(bare, looked) -> None:
    rgb, depth, rig = seen_by(bare[0][0])
    wall = np.full_like(depth, 1.6)  # landmarks of a near hand, as if it were printed on the wall
    found = PalmAnchors(Says(looked)).find(rgb, wall, rig)
    assert not found.seen
    assert "mm" in found.reason


def test_an_unsure_hand_is_given_with_a_reason(bare, looked) -> None:
    found = PalmAnchors(Says(replace(looked, score=0.6))).find(*seen_by(bare[0][0]))
    assert found.seen
    assert "not clearly seen" in found.reason
    assert PalmAnchors(Says(looked)).find(*seen_by(bare[0][0])).reason is None


def mirrored(found: HandLandmarks) -> HandLandmarks:
    """The landmarks as of a detector that has taken the hand for the other one."""
    order = list(range(21))
    for here, there in zip(PALM_LANDMARKS[1:], PALM_LANDMARKS[:0:-1], strict=True):
        order[here] = there
    return replace(found, pixels=found.pixels[order], side="L" if found.side == "R" else "R")


def test_a_hand_taken_for_the_other_one_is_put_right_where_the_side_is_known(bare, looked) -> None:
    frame = seen_by(bare[0][0])
    right = PalmAnchors(Says(looked), side="R").find(*frame).places_m
    np.testing.assert_array_equal(PalmAnchors(Says(mirrored(looked)), side="R").find(*frame).places_m, right)
    alone = PalmAnchors(Says(mirrored(looked))).find(*frame).places_m
    np.testing.assert_array_equal(alone, right[[0, 4, 3, 2, 1]])


def test_a_hand_taken_for_the_other_one_is_put_right_by_the_frames_before(bare, looked) -> None:
    frame = seen_by(bare[0][0])
    says = Says(looked)
    finder = PalmAnchors(says)
    before = finder.find(*frame).places_m
    finder.find(*frame, before)
    says.found = mirrored(looked)
    np.testing.assert_array_equal(finder.find(*frame, before).places_m, before)
    # a new sequence does not inherit the vote of the one before
    np.testing.assert_array_equal(finder.find(*frame).places_m, before[[0, 4, 3, 2, 1]])


def test_a_first_frame_that_was_wrong_is_outvoted(bare, looked) -> None:
    frame = seen_by(bare[0][0])
    says = Says(mirrored(looked))
    finder = PalmAnchors(says)
    places = finder.find(*frame).places_m
    says.found = looked
    for _ in range(3):
        places = finder.find(*frame, places).places_m
    np.testing.assert_array_equal(places, PalmAnchors(Says(looked)).find(*frame).places_m)


def test_a_steep_and_distant_hand_still_has_its_anchors(detector) -> None:
    far = HandVariation(distance_m=(0.95, 1.0), tilt_deg=30.0)
    frame = shoot(
        Holder("f_38_tall", seed=8, marker_m=0.0), "open", 55, variation=far, rig=make_rig((640, 480))
    )
    found = PalmAnchors(detector).find(*seen_by(frame))
    assert found.seen
    knuckles = np.array([frame.points_m[name] for name in PALM_NAMES[1:]])
    assert np.linalg.norm(found.places_m[1:] - knuckles, axis=1).max() < 0.025


def test_the_finder_of_a_model_follows_its_kind_of_anchors(detector) -> None:
    assert isinstance(finder_for(HandModel({}, None, "palm"), detector), PalmAnchors)
    assert isinstance(finder_for(HandModel({}, None, "marker"), detector), MarkerAnchors)
    with pytest.raises(InputError, match="detector"):
        finder_for(HandModel({}, None, "palm"))
    with pytest.raises(InputError, match="elbow"):
        finder_for(HandModel({}, None, "elbow"), detector)
