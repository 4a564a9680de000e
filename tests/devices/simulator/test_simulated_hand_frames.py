"""Frames of simulated hands are hands: their points lie on the skin, what hides them hides them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from core.capture.transform import RigidTransform
from core.errors import InputError
from core.hand.names import POINT_INDEX, POINT_NAMES
from devices.simulator.hands.model import CONFIGURATIONS, load_hand
from devices.simulator.hands.scene import HandFrame, HandView, MarkerSheet, Thing, take_frame
from devices.simulator.hands.shots import HandVariation, Holder, checked_holder, shoot, shoot_nobody
from devices.simulator.hands.things import bar, bottle, other_hand, placed, table, torso, upright
from devices.simulator.room import make_rig
from devices.simulator.shapes import SHAPES

RIG = make_rig((640, 480))
FRONTAL = HandVariation(
    joint_deg=0, spread_deg=0, tilt_deg=0, roll_deg=0, distance_m=(0.6, 0.6001), aside_m=0
)
AT_60_CM = RigidTransform(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.6]))


def picture_of(
    configuration: str = "open",
    *,
    things: tuple[Thing, ...] = (),
    markers: tuple[MarkerSheet, ...] | None = None,
) -> HandFrame:
    hand = load_hand()
    view = HandView(
        hand,
        hand.posed(CONFIGURATIONS[configuration]),
        AT_60_CM,
        (MarkerSheet(),) if markers is None else markers,
        things,
    )
    return take_frame(view, RIG, np.random.default_rng(0))


def marker_numbers(frame: HandFrame, dictionary: str = "DICT_4X4_50") -> list[int]:
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    assert frame.capture.color is not None
    _, numbers, _ = cv2.aruco.ArucoDetector(known).detectMarkers(frame.capture.color)
    return [] if numbers is None else sorted(int(n) for n in numbers.ravel())


@pytest.mark.parametrize("side", ["R", "L"])
@pytest.mark.parametrize("shape", ["m_young_avg", "child6_f", "f_old_heavy", "m_36_obese"])
def test_points_lie_over_their_joints_on_the_back(shape: str, side: str) -> None:
    hand = load_hand(shape, side)
    points = hand.points(hand.posed(CONFIGURATIONS["open"]))
    body = hand.body
    size = hand.length_m
    for number, finger in enumerate(("index", "middle", "ring", "little"), start=2):
        tip, pip, mcp = (points[f"{finger}_{part}"] for part in ("tip", "pip", "mcp"))
        assert tip[1] > pip[1] > mcp[1] > 0.1 * size  # y goes to the fingertips
        first, second = (body.bone_point(f"finger{number}-{k}.{side}") for k in (1, 2))
        assert np.linalg.norm(pip - mcp) == pytest.approx(np.linalg.norm(second - first), rel=0.2)
        # 80 % of the last phalanx: short of the farthest skin of the finger
        assert 0.1 * size < np.linalg.norm(tip - pip) < 0.35 * size
    thumb_side = -1.0 if side == "R" else 1.0
    assert thumb_side * points["thumb_mcp"][0] > 0.1 * size
    assert thumb_side * points["thumb_tip"][0] > thumb_side * points["index_mcp"][0]
    across = [points[f"{finger}_mcp"][0] * thumb_side for finger in ("index", "middle", "ring", "little")]
    assert across == sorted(across, reverse=True)


def test_a_nail_is_at_four_fifths_of_the_last_phalanx() -> None:
    hand = load_hand()
    last = hand.body.bone_weight("finger3-3.R") > 0.6
    start = hand.body.bone_point("finger3-3.R")
    along = hand.body.bone_direction("finger3-2.R", "finger3-3.R")
    end = float(((hand.body.reference[last] - start) @ along).max())
    corners = hand.body.reference[hand.rows][hand.triangles[hand.point_triangle[POINT_INDEX["middle_tip"]]]]
    nail = hand.point_weights[POINT_INDEX["middle_tip"]] @ corners
    assert float((nail - start) @ along) / end == pytest.approx(0.8, abs=0.02)


def test_every_body_has_two_hands_of_a_plausible_length() -> None:
    lengths = {shape: load_hand(shape).length_m for shape in SHAPES}
    assert all(0.11 < length < 0.24 for length in lengths.values()), lengths
    assert lengths["child6_f"] < lengths["child10"] < lengths["m_tall_thin"]
    assert load_hand("child10", "L").length_m == pytest.approx(lengths["child10"], rel=0.02)


@pytest.mark.parametrize("configuration", list(CONFIGURATIONS))
def test_what_is_called_visible_is_what_the_depth_camera_measures(configuration: str) -> None:
    frame = shoot(Holder(seed=1), configuration, 3, variation=FRONTAL, rig=RIG)
    depth = frame.capture.depth_frames[0].astype(float) * frame.capture.depth_unit_m
    points = np.array([frame.points_m[name] for name in POINT_NAMES])
    pixels = np.rint(RIG.rig.depth.project(points)).astype(int)
    for name, place, (u, v) in zip(POINT_NAMES, points, pixels, strict=True):
        window = depth[v - 1 : v + 2, u - 1 : u + 2]
        measured = window[window > 0]
        if frame.visible[name] and len(measured):
            assert np.abs(measured - place[2]).min() < 0.008, name
        if not frame.visible[name] and len(measured):
            # something is before it, or its skin looks away
            assert measured.min() < place[2] + 0.012, name


def test_outstretched_fingers_are_seen_and_a_fist_hides_its_nails() -> None:
    outstretched = shoot(Holder(), "open", 0, variation=FRONTAL, rig=RIG).visible
    fist = shoot(Holder(), "fist", 0, variation=FRONTAL, rig=RIG).visible
    fingers = ("index", "middle", "ring", "little")
    assert all(outstretched[f"{finger}_{part}"] for finger in fingers for part in ("tip", "pip", "mcp"))
    assert not any(fist[f"{finger}_tip"] for finger in fingers)
    assert all(fist[f"{finger}_mcp"] for finger in fingers)


def test_the_marker_is_where_its_corners_are_said_to_be() -> None:
    frame = picture_of()
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    assert frame.capture.color is not None
    found, _, _ = cv2.aruco.ArucoDetector(known).detectMarkers(frame.capture.color)
    expected = RIG.rig.project_to_picture(frame.corners_m[0])
    assert np.abs(found[0].reshape(4, 2) - expected).max() < 1.5
    sides = np.linalg.norm(np.roll(frame.corners_m[0], 1, axis=0) - frame.corners_m[0], axis=1)
    assert sides == pytest.approx([0.036] * 4, rel=0.08)


def test_no_marker_two_markers_and_another_dictionary_can_be_had() -> None:
    assert marker_numbers(picture_of(markers=())) == []
    two = (MarkerSheet(0.023, shift_m=(0.0, 0.022)), MarkerSheet(0.023, 9, shift_m=(0.0, -0.011)))
    assert marker_numbers(picture_of(markers=two)) == [7, 9]
    other = picture_of(markers=(MarkerSheet(dictionary="DICT_5X5_50"),))
    assert marker_numbers(other) == []
    assert marker_numbers(other, "DICT_5X5_50") == [7]


def test_a_bar_before_the_fingers_hides_them_and_nothing_else() -> None:
    free = picture_of().visible
    hand = load_hand()
    across = placed(
        bar(0.03),
        RigidTransform(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]), np.array([-0.175, -0.09, 0.5])),
    )
    hidden = picture_of(things=(across,)).visible
    assert hand.length_m > 0.15
    lost = {name for name in POINT_NAMES if free[name] and not hidden[name]}
    assert lost
    assert all(name.split("_")[1] in ("tip", "pip") for name in lost)


def test_there_may_be_no_hand_at_all() -> None:
    frame = shoot_nobody(rig=RIG)
    depth = frame.capture.depth_frames[0]
    assert np.abs(depth[depth > 0] - 1400.0).max() < 150
    assert frame.points_m == {}
    assert marker_numbers(frame) == []
    with_bottle = shoot_nobody(rig=RIG, things=(placed(bottle(), upright((0, -1, 0), (0, 0.1, 0.7))),))
    assert (with_bottle.capture.depth_frames[0][200:280, 300:340] < 800).mean() > 0.5


def test_a_body_touched_by_the_hand_is_skin_to_skin_with_it() -> None:
    behind = torso("m_young_avg", (0.0, 0.05, 0.63))
    frame = picture_of(things=(behind,))
    depth = frame.capture.depth_frames[0].astype(float) * 0.001
    near = (depth > 0) & (depth < 0.8)
    assert near.mean() > 0.25  # the trunk fills much of the view
    assert np.median(depth[near]) < 0.75


def test_bottle_table_and_another_hand_are_before_the_camera_where_they_are_put() -> None:
    up = np.array([0.0, -1.0, 0.0])
    standing = placed(bottle(0.03, 0.2), upright(up, (0.2, 0.1, 0.7)))
    assert standing.vertices[:, 1].min() == pytest.approx(-0.1, abs=1e-6)
    assert standing.vertices[:, 1].max() == pytest.approx(0.1, abs=1e-6)
    assert table(up, (0.0, 0.1, 0.7)).vertices[:, 1].min() == pytest.approx(0.1, abs=1e-6)
    other = other_hand("child10", "L", hand=AT_60_CM)
    assert np.abs(other.vertices.mean(axis=0) - (0.0, 0.0, 0.6)).max() < 0.5


@pytest.mark.parametrize(
    ("holder", "words"),
    [
        (Holder("nobody"), "no simulated body called 'nobody'"),
        (Holder(side="X"), "R or L"),
        (Holder(marker_m=0.5), "0.01 to 0.08"),
        (Holder(marker_m=float("nan")), "0.01 to 0.08"),
        (Holder(dictionary="DICT_9"), "no ArUco dictionary 'DICT_9'"),
        (Holder(seed=-1), "seed"),
    ],
)
def test_a_holder_that_cannot_be_is_named(holder: Holder, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked_holder(holder)
