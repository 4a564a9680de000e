"""A hand found without a marker, on simulated hands and on recordings of a real one."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from core.capture import PinholeCamera
from core.errors import WorkError
from core.hand.finding import find_hand
from core.hand.surface import cut_hand
from devices.simulator.hands.shots import Holder, shoot

REAL = Path(__file__).resolve().parents[4] / "shared" / "real" / "hand_depth"
SR305 = PinholeCamera(640, 480, 476.0, 476.0, 319.5, 239.5)
SR305_UNIT_M = 0.000125


@pytest.mark.parametrize(
    ("shape", "configuration", "seed"),
    [("m_tall_thin", "open", 1), ("f_old_heavy", "fist", 2), ("f_young_avg", "pinch", 3)],
)
def test_the_middle_of_the_hand_is_found_not_the_elbow(shape: str, configuration: str, seed: int) -> None:
    frame = shoot(Holder(shape, seed=seed, marker_m=0.036), configuration, seed)
    depth = frame.capture.depth_frames[0] * frame.capture.depth_unit_m
    seeds = find_hand(depth, frame.capture.rig.depth)
    assert seeds.shape == (5, 3)
    assert np.linalg.norm(seeds.mean(axis=0) - frame.corners_m[0].mean(axis=0)) < 0.06


def test_nearer_things_that_are_no_arm_are_passed_over() -> None:
    frame = shoot(Holder("m_young_avg", seed=4), "open", 4)
    depth = frame.capture.depth_frames[0] * frame.capture.depth_unit_m
    depth[:60, :80] = 0.45
    seeds = find_hand(depth, frame.capture.rig.depth)
    assert np.linalg.norm(seeds.mean(axis=0) - frame.corners_m[0].mean(axis=0)) < 0.06


@pytest.mark.parametrize("wall_m", [0.0, 0.7, 3.0])
def test_where_no_hand_is_none_is_made_up(wall_m: float) -> None:
    with pytest.raises(WorkError, match="No hand"):
        find_hand(np.full((480, 640), wall_m), SR305)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real recordings of a hand are not on this machine")
def test_a_real_hand_is_cut_in_every_recording() -> None:
    pictures = sorted(REAL.glob("*.png"))
    assert pictures
    for path in pictures:
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float) * SR305_UNIT_M
        hand = cut_hand(depth, SR305, find_hand(depth, SR305))
        surface = hand.surface
        assert hand.touching is None, path.name
        assert 1800 < len(surface.vertices) < 8000, path.name
        # palm and four fingers stand upright here: wider than an arm, the hand's end above the elbow's
        size = np.ptp(surface.vertices, axis=0)
        assert 0.09 < size[0] < 0.2, path.name
        assert 0.22 < size[1] < 0.40, path.name
        assert (surface.component == 0).mean() > 0.95, path.name
