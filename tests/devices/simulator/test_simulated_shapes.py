"""The bodies: whole, plausible, and divided so that nothing is tuned on what it is tested on."""

from __future__ import annotations

import numpy as np
import open3d as o3d
import pytest

from core.errors import InputError
from devices.simulator import CALIBRATION_SHAPES, SHAPES, TEST_SHAPES, TUNING_SHAPES
from devices.simulator.amputation import LIMBS, without_limbs
from devices.simulator.body import BodyModel, enclosed_volume, load_body, pose_body
from devices.simulator.shapes import describe_shape, read_shape
from devices.simulator.stances import Posture, take_stance

OLD = ("m_young_avg", "f_young_avg", "m_tall_thin", "f_old_heavy", "child10")
SPLITS = (TUNING_SHAPES, CALIBRATION_SHAPES, TEST_SHAPES)


def test_the_five_first_shapes_stay_first() -> None:
    assert SHAPES[:5] == OLD
    assert len(SHAPES) == len(set(SHAPES)) >= 30


def test_every_shape_is_in_exactly_one_split() -> None:
    assert sorted(name for split in SPLITS for name in split) == sorted(SHAPES)
    assert {"m_young_avg", "f_old_heavy", "child10"} <= set(TUNING_SHAPES)
    assert {"m_tall_thin", "f_young_avg"} <= set(TEST_SHAPES)


@pytest.mark.parametrize("split", SPLITS)
def test_every_split_is_mixed_in_sex_age_and_build(split: tuple[str, ...]) -> None:
    for start in ("m_", "f_", "child"):
        assert any(name.startswith(start) for name in split)
    numbers = [name.split("_")[1] for name in split if "_" in name and not name.startswith("child")]
    ages = [int(number) for number in numbers if number.isdigit()]
    assert min(ages) < 30
    assert max(ages) > 60
    thin, heavy = ("thin",), ("heavy", "obese", "stout")
    for words in (thin, heavy):
        assert any(name.endswith(words) for name in split)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_has_the_size_of_a_person_and_its_joints_inside(shape: str) -> None:
    body = load_body(shape)
    low, high = (1.1, 1.7) if shape.startswith("child") else (1.5, 2.1)
    assert low < body.stature_m < high
    mass = 985.0 * enclosed_volume(body.reference, body.triangles)
    index = mass / body.stature_m**2
    assert (14.0 if shape.startswith("child") else 18.0) < index < 40.0
    if shape.endswith(("heavy", "obese", "stout")) and shape != "f_old_heavy":
        assert index > 28.0
    if shape.endswith("thin"):
        assert index < 22.0
    posed = pose_body(body, take_stance(Posture(body), "A"))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(posed.vertices.astype(np.float32)),
        o3d.core.Tensor(body.triangles[body.outer].astype(np.uint32)),
    )
    joints = np.array(list(posed.joints.values()), np.float32)
    assert scene.compute_signed_distance(o3d.core.Tensor(joints)).numpy().max() < -0.005


def test_the_compact_shapes_follow_the_same_skinning_as_the_others() -> None:
    """Moving the bind posture to the reference posture gives the reference vertices that are shipped."""
    own = read_shape("f_old_heavy")
    body = load_body("f_old_heavy")
    assert own.reference is not None
    posed = pose_body(body, {})
    shift = posed.vertices - own.reference
    assert np.ptp(shift, axis=0).max() < 1e-5


def test_nobody_is_anybody_else() -> None:
    some = [load_body(name).bind for name in SHAPES[5:12]]
    for k, one in enumerate(some):
        for other in some[k + 1 :]:
            assert np.linalg.norm(one - other, axis=1).mean() > 0.01


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ("m_young_avg", "young man"),
        ("f_31_short_heavy", "short heavy woman of 31"),
        ("m_52_avg", "average man of 52"),
        ("child7_f", "girl of 7"),
        ("child14_m", "boy of 14"),
    ],
)
def test_a_name_says_who_it_is(shape: str, words: str) -> None:
    assert describe_shape(shape) == words


@pytest.fixture(scope="module")
def whole() -> BodyModel:
    return load_body("m_52_avg")


@pytest.mark.parametrize("limb", LIMBS)
def test_a_lost_limb_leaves_a_stump_and_the_rest_alone(whole: BodyModel, limb: str) -> None:
    body = without_limbs(whole, (limb,))
    stance = take_stance(Posture(whole), "A")
    before, after = pose_body(whole, stance), pose_body(body, stance)
    joint = LIMBS[limb][1]
    above = joint.replace("hand", "elbow").replace("foot", "knee")
    same = {name for name in before.joints if np.allclose(before.joints[name], after.joints[name], atol=2e-3)}
    assert set(before.joints) - same == {joint}
    length = np.linalg.norm(before.joints[joint] - before.joints[above])
    left = after.vertices[np.unique(body.triangles[body.outer])]
    lost = np.linalg.norm(left - before.joints[joint], axis=1).min()
    assert lost > 0.3 * length
    assert np.linalg.norm(left - after.joints[joint], axis=1).min() < 0.09
    share = 1 - enclosed_volume(after.vertices, body.triangles) / enclosed_volume(
        before.vertices, whole.triangles
    )
    assert 0.005 < share < 0.06
    assert len(body.outer) < len(whole.outer)
    assert len(body.triangles) == len(whole.triangles)


def test_two_limbs_may_be_lost_and_no_others(whole: BodyModel) -> None:
    body = without_limbs(whole, ("left_forearm", "right_lower_leg"))
    assert set(body.stumps) == {"left_hand", "right_foot"}
    with pytest.raises(InputError, match="left_wing"):
        without_limbs(whole, ("left_wing",))
