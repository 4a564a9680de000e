"""How far an anchor may lie from its place: the table that trilateration believes."""

from __future__ import annotations

import pytest

from core.anchors.names import EXTRA_NAMES, JOINT_NAMES
from core.anchors.skin_anchors import SIGMA_M, anchor_sigma_m


def test_every_joint_has_a_measured_spread_and_both_sides_share_it():
    kinds = {name.removeprefix("left_").removeprefix("right_") for name in JOINT_NAMES}
    assert set(SIGMA_M) == kinds
    for name in JOINT_NAMES:
        other = name.replace("left_", "right_")
        assert anchor_sigma_m(name, 1.0) == anchor_sigma_m(other, 1.0)


def test_the_head_is_the_least_sure_anchor_and_knees_are_surer_than_hips():
    spread = {name: anchor_sigma_m(name, 1.0) for name in JOINT_NAMES}
    assert max(spread, key=spread.__getitem__) == "head", "its nearest skin may be the face or the crown"
    assert spread["left_knee"] < spread["left_hip"]


@pytest.mark.parametrize("name", [*JOINT_NAMES, *EXTRA_NAMES])
def test_no_anchor_is_known_better_than_depth_pixels_allow_nor_worse_than_a_limb_is_thick(name):
    assert 0.005 <= anchor_sigma_m(name, 1.0) <= 0.03


def test_an_anchor_half_seen_spreads_twice_as_far():
    assert anchor_sigma_m("left_hand", 0.5) == pytest.approx(2 * anchor_sigma_m("left_hand", 1.0))
