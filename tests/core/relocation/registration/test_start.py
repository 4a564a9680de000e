"""Where the skeleton alone carries the skin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from core.anchors import AnalysedCapture, Skeleton
from core.anchors.skeleton import Joint
from core.relocation.pair import VisitPair
from core.relocation.registration.start import SkeletonStart, skeleton_start

STANDING = {
    "head": [0.0, -0.65, 2.0],
    "neck": [0.0, -0.45, 2.0],
    "torso": [0.0, -0.20, 2.0],
    "left_shoulder": [0.18, -0.42, 2.0],
    "right_shoulder": [-0.18, -0.42, 2.0],
    "left_elbow": [0.22, -0.12, 2.0],
    "right_elbow": [-0.22, -0.12, 2.0],
    "left_hand": [0.24, 0.15, 2.0],
    "right_hand": [-0.24, 0.15, 2.0],
    "left_hip": [0.10, 0.05, 2.0],
    "right_hip": [-0.10, 0.05, 2.0],
    "left_knee": [0.11, 0.50, 2.0],
    "right_knee": [-0.11, 0.50, 2.0],
    "left_foot": [0.12, 0.95, 2.0],
    "right_foot": [-0.12, 0.95, 2.0],
}
"""A person who faces the camera with straight hanging arms; the camera looks along z, y goes down."""
FRONT, LEFT = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
ROTATIONS = st.tuples(*[st.floats(-1.2, 1.2)] * 3).map(lambda v: Rotation.from_rotvec(v).as_matrix())


def skeleton(places: Mapping[str, object], unseen: tuple[str, ...] = ()) -> Skeleton:
    return Skeleton(
        {
            name: Joint(name, np.array(p, float), np.zeros(2), 0.1 if name in unseen else 1.0, "hand")
            for name, p in places.items()
        }
    )


@pytest.fixture(scope="module")
def capture(simulated_visits) -> AnalysedCapture:
    return simulated_visits.first


@pytest.fixture(scope="module")
def started(capture):
    """The start between two skeletons, over skin sampled along the first one's bones."""

    def make(
        first: Mapping[str, object], second: Mapping[str, object], unseen: tuple[str, ...] = ()
    ) -> SkeletonStart:
        pair = VisitPair(
            replace(capture, skeleton=skeleton(first)), replace(capture, skeleton=skeleton(second, unseen))
        )
        made = skeleton_start(pair, *bone_skin(first))
        assert made is not None
        return made

    return make


SEGMENTS = [("neck", "torso", 0.12), ("head", "neck", 0.07)] + [
    (f"{side}_{a}", f"{side}_{b}", 0.05)
    for side in ("left", "right")
    for a, b in (("shoulder", "elbow"), ("elbow", "hand"), ("hip", "knee"), ("knee", "foot"))
]


def bone_skin(first: Mapping[str, object]) -> tuple[np.ndarray, np.ndarray]:
    """Places around the bones, neighbours along each bone joined."""
    rows, edges = [], []
    for a, b, radius in SEGMENTS:
        start, end = np.array(first[a], float), np.array(first[b], float)
        for share in np.linspace(0.05, 0.95, 9):
            for x in (-1.0, 0.0, 1.0):
                if len(rows) % 27 > 2:
                    edges.append((len(rows) - 3, len(rows)))
                rows.append(start + share * (end - start) + radius * np.array([x, 0.0, abs(x) - 1.0]))
    return np.array(rows), np.array(edges, np.int32)


def on(start: SkeletonStart, name: str):
    """The bone of that name."""
    return next(b for b in start.bones if b.name == name)


def posed(**moved: object) -> dict[str, object]:
    return {**STANDING, **moved}


def test_who_stands_still_is_not_moved(started):
    places, _ = bone_skin(STANDING)
    rotation, moved = started(STANDING, STANDING)(places)
    assert moved == pytest.approx(places, abs=1e-9)
    assert rotation == pytest.approx(np.tile(np.eye(3), (len(places), 1, 1)), abs=1e-9)


@given(ROTATIONS, st.tuples(*[st.floats(-0.5, 0.5)] * 3))
@settings(max_examples=15, deadline=None)
def test_who_turns_as_a_whole_is_carried_rigidly(started, rotation, shift):
    bent = posed(left_hand=[0.30, -0.10, 1.80], right_hand=[-0.05, -0.15, 1.85])
    centre = np.array([0.0, 0.0, 2.0])
    turned = {n: rotation @ (np.array(p) - centre) + centre + shift for n, p in bent.items()}
    places, _ = bone_skin(bent)
    turns, moved = started(bent, turned)(places)
    assert moved == pytest.approx((places - centre) @ rotation.T + centre + shift, abs=1e-6)
    assert turns == pytest.approx(np.tile(rotation, (len(places), 1, 1)), abs=1e-6)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_limbs_keep_their_lengths_and_hang_together_however_the_joints_jump(started, seed):
    rng = np.random.default_rng(seed)
    second = {n: np.array(p) + rng.normal(0, 0.05, 3) for n, p in STANDING.items()}
    start = started(STANDING, second)
    for bone in start.bones:
        assert bone.rotation @ bone.rotation.T == pytest.approx(np.eye(3), abs=1e-9)
        assert np.linalg.det(bone.rotation) == pytest.approx(1.0)
    for side in ("left", "right"):
        for upper, lower in (
            ("shoulder to {}_elbow", "elbow to {}_hand"),
            ("hip to {}_knee", "knee to {}_foot"),
        ):
            near = on(start, f"{side}_{upper.format(side)}")
            far = on(start, f"{side}_{lower.format(side)}")
            assert far.moved_start == pytest.approx(
                near.moved_start + near.rotation @ (near.end - near.start)
            )
    _, moved = start(bone_skin(STANDING)[0])
    assert np.isfinite(moved).all()


def test_a_limb_points_where_the_follow_up_has_it(started):
    start = started(STANDING, posed(left_elbow=[0.48, -0.42, 2.0], left_hand=[0.74, -0.42, 2.0]))
    upper, fore = on(start, "left_shoulder to left_elbow"), on(start, "left_elbow to left_hand")
    for bone in (upper, fore):
        way = bone.rotation @ (bone.end - bone.start)
        assert way / np.linalg.norm(way) == pytest.approx(LEFT, abs=0.1)


def test_a_straight_elbow_that_bends_to_the_front_did_not_twist(started):
    bent = posed(left_hand=[0.22, -0.12, 1.73], right_hand=[-0.22, -0.12, 1.73])
    start = started(STANDING, bent)
    for side in ("left", "right"):
        upper = on(start, f"{side}_shoulder to {side}_elbow")
        assert upper.rotation @ FRONT == pytest.approx(FRONT, abs=0.1)
        fore = on(start, f"{side}_elbow to {side}_hand")
        way = fore.rotation @ (fore.end - fore.start)
        assert way / np.linalg.norm(way) == pytest.approx(FRONT, abs=0.1)


@pytest.mark.parametrize(("side", "inward"), [("left", -1.0), ("right", 1.0)])
def test_the_bending_plane_tells_how_the_upper_arm_turned(started, side, inward):
    x = np.array(STANDING[f"{side}_elbow"])[0]
    hand = f"{side}_hand"
    ahead = posed(**{hand: [x, -0.12, 1.73]})
    across = posed(**{hand: [x + inward * 0.27, -0.12, 2.0]})
    for first in (ahead, STANDING):
        upper = on(started(first, across), f"{side}_shoulder to {side}_elbow")
        assert upper.rotation @ FRONT == pytest.approx(inward * LEFT, abs=0.2)
    back = on(started(across, ahead), f"{side}_shoulder to {side}_elbow")
    assert back.rotation @ (inward * LEFT) == pytest.approx(FRONT, abs=0.2)


def test_a_straight_knee_tells_nothing_and_a_bent_one_tells_the_turn(started):
    ahead = posed(left_knee=[0.11, 0.30, 1.65], left_foot=[0.12, 0.75, 1.65])
    thigh = on(started(STANDING, posed(left_foot=[0.13, 0.94, 1.99])), "left_hip to left_knee")
    assert thigh.rotation @ FRONT == pytest.approx(FRONT, abs=0.1)
    out = posed(left_knee=[0.11, 0.30, 1.65], left_foot=[0.50, 0.55, 1.80])
    one, two = (on(started(ahead, s), "left_hip to left_knee").rotation for s in (ahead, out))
    turned = Rotation.from_matrix(two @ one.T).as_rotvec()
    axis = np.array(ahead["left_knee"]) - np.array(ahead["left_hip"])
    assert abs(turned @ axis / np.linalg.norm(axis)) == pytest.approx(np.linalg.norm(turned), rel=0.05)
    assert np.degrees(np.linalg.norm(turned)) > 30


def test_skin_bends_smoothly_over_a_joint(started):
    start = started(STANDING, posed(left_hand=[0.22, -0.12, 1.73]))
    line = np.linspace(STANDING["left_shoulder"], STANDING["left_hand"], 200) + np.array([0.0, 0.0, -0.04])
    _, moved = start(line)
    steps = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    assert steps.max() < 6 * np.linalg.norm(line[1] - line[0])


def test_without_a_trunk_there_is_no_start(capture):
    arms = {n: p for n, p in STANDING.items() if "elbow" in n or "hand" in n}
    pair = VisitPair(replace(capture, skeleton=skeleton(arms)), replace(capture, skeleton=skeleton(STANDING)))
    assert skeleton_start(pair, *bone_skin(STANDING)) is None


def test_a_limb_that_the_follow_up_does_not_show_is_known_to_be_lost(started):
    start = started(STANDING, posed(left_elbow=[0.40, -0.25, 2.0]), unseen=("left_hand",))
    lost = [start.bones[k].name for k in start.lost]
    assert lost == ["left_elbow to left_hand"]
    fore, upper = on(start, lost[0]), on(start, "left_shoulder to left_elbow")
    assert fore.rotation == pytest.approx(upper.rotation)
    assert fore.moved_start == pytest.approx(upper.moved_start + upper.rotation @ (upper.end - upper.start))
    assert not started(STANDING, STANDING).lost
