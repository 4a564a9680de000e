"""Specification: the other hand of the pair is said, and the forearm is no part of a tracked surface."""

from __future__ import annotations

import numpy as np

from core.hand.hand_model import HandModel
from core.hand.marker_anchors import MarkerAnchors
from core.hand.surface import WRIST_M, cut_hand
from core.hand.tracker import OTHER_HAND, HandTracker
from devices.simulator.hands.shots import HandVariation, Holder, shoot
from tests.core.hand.conftest import Shot

CALM = HandVariation(tilt_deg=10.0, roll_deg=10.0)


def test_a_pointing_left_hand_is_not_given_the_points_of_a_right_one(hand_model: HandModel) -> None:
    configuration = "point"
    for side in "LR":
        shot = Shot.of(shoot(Holder("f_young_avg", side, seed=3), configuration, 50, variation=CALM))
        tracker = HandTracker(hand_model, shot.frame.capture.rig, MarkerAnchors(0.036))
        answer = tracker.track(shot.depth_m, shot.rgb)
        if side == "L":
            assert answer.reason == OTHER_HAND
            assert not answer.found.any()
        else:
            assert answer.configuration == configuration


def test_only_the_wrist_is_kept_of_the_forearm() -> None:
    shot = Shot.of(shoot(Holder("f_young_avg", seed=3), "open", 50, variation=CALM))
    corners, camera = shot.frame.corners_m[0], shot.frame.capture.rig.depth
    toward = corners[:2].mean(axis=0) - corners[2:].mean(axis=0)
    whole = cut_hand(shot.depth_m, camera, corners).surface.vertices
    kept = cut_hand(shot.depth_m, camera, corners, toward=toward).surface.vertices
    along = (kept - corners.mean(axis=0)) @ toward / np.linalg.norm(toward)
    assert along.min() > -WRIST_M - 0.01
    assert len(kept) < 0.9 * len(whole)
    tips = shot.truth_m[shot.visible]
    assert np.linalg.norm(kept[:, None] - tips[None], axis=2).min(axis=0).max() < 0.01
