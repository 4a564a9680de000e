"""Points by landmarks alone, which geodesic points are compared with: the real detector on rendered hands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.hand.landmark_points import SHIFTS, landmark_points
from core.hand.landmarks import HandLandmarks, landmark
from core.hand.names import POINT_INDEX, POINT_NAMES
from core.hand.palm_anchors import PALM_LANDMARKS
from devices.simulator.hands.shots import Holder, shoot
from devices.trackers.mediapipe_hands import MediaPipeHands

CASES = (
    ("f_38_tall", "R", "open", 812),
    ("m_48_stout", "L", "grip", 813),
    ("m_25_muscular", "R", "fist", 814),
)


def seen_by(frame) -> tuple:
    capture = frame.capture
    return capture.depth_frames[0] * capture.depth_unit_m, capture.rig


def truth(frame) -> tuple[np.ndarray, np.ndarray]:
    return (
        np.array([frame.points_m[name] for name in POINT_NAMES]),
        np.array([frame.visible[name] for name in POINT_NAMES]),
    )


@pytest.fixture(scope="module")
def looked():
    """Frames with what the detector finds in them."""
    detector = MediaPipeHands()
    out = []
    for number, (shape, side, configuration, seed) in enumerate(CASES):
        frame = shoot(Holder(shape, side, seed=60 + number, marker_m=0.0), configuration, seed)
        found = detector.detect(frame.capture.color)
        assert found is not None
        out.append((frame, found))
    detector.close()
    return out


def errors(frame, found: HandLandmarks, **options) -> np.ndarray:
    places, visible = truth(frame)
    points = landmark_points(found, *seen_by(frame), **options).points_m
    return np.where(visible, np.linalg.norm(points - places, axis=1), np.nan)


def test_visible_points_are_found_within_some_millimetres(looked) -> None:
    for frame, found in looked:
        assert np.nanmedian(errors(frame, found)) < 0.008
        assert np.nanmax(errors(frame, found)) < 0.035


def test_landmarks_moved_to_our_points_are_nearer_than_landmarks_as_they_are(looked) -> None:
    moved = np.concatenate([errors(frame, found) for frame, found in looked])
    plain = np.concatenate([errors(frame, found, aligned=False) for frame, found in looked])
    assert np.nanmedian(moved) < 0.7 * np.nanmedian(plain)


def test_exact_landmarks_give_exact_points(looked) -> None:
    """What is left when a detector makes no error: depth noise, and nothing of the wall behind."""
    frame, found = looked[0]
    places, visible = truth(frame)
    wanted = frame.capture.rig.project_to_picture(places)
    pixels = found.pixels.copy()
    for finger in range(5):
        parts = (3, 2, 1) if finger == 0 else (3, 1, 0)
        for part, k in zip(parts, range(3 * finger, 3 * finger + 3), strict=True):
            pixels[landmark(finger, part)] = wanted[k]
        before = pixels[landmark(finger, 2)]
        # the landmark of a tip lies beyond the nail
        pixels[landmark(finger, 3)] = before + (wanted[3 * finger] - before) / 0.8
    exact = replace(found, pixels=pixels)
    error = errors(frame, exact, aligned=False)
    assert np.nanmedian(error) < 0.002
    assert np.nanmax(error) < 0.008
    assert visible.sum() >= 9


def test_no_point_falls_on_the_wall_although_a_landmark_lies_beside_the_finger(looked) -> None:
    frame, found = looked[0]
    depth, rig = seen_by(frame)
    places, _ = truth(frame)
    aside = replace(found, pixels=found.pixels + np.where(np.arange(21) % 4 == 0, 9.0, 0.0)[:, None] * (1, 0))
    points = landmark_points(aside, depth, rig).points_m
    assert points[:, 2].max() < places[:, 2].max() + 0.05
    assert depth.max() > places[:, 2].max() + 0.3


def test_a_point_behind_something_is_guessed_hidden_and_keeps_the_landmarks_own_depth(looked) -> None:
    frame, found = looked[0]
    depth, rig = seen_by(frame)
    free = landmark_points(found, depth, rig)
    k = POINT_INDEX["middle_tip"]
    assert free.visible[k]
    u, v = np.rint(rig.depth.project(free.points_m[k])[0]).astype(int)
    covered = depth.copy()
    covered[v - 12 : v + 13, u - 15 : u + 16] = free.points_m[k, 2] - 0.08
    hidden = landmark_points(found, covered, rig)
    assert not hidden.visible[k]
    assert abs(hidden.points_m[k, 2] - free.points_m[k, 2]) < 0.035
    assert hidden.visible[POINT_INDEX["middle_mcp"]]


def test_a_palm_that_is_not_measured_gives_no_points(looked) -> None:
    frame, found = looked[0]
    depth, rig = seen_by(frame)
    nothing = landmark_points(found, np.zeros_like(depth), rig)
    assert np.isnan(nothing.points_m).all()
    assert not nothing.visible.any()


def test_landmarks_outside_the_image_are_no_crash_and_not_visible(looked) -> None:
    frame, found = looked[0]
    pixels = found.pixels.copy()
    pixels[landmark(2, 0) + 1 : landmark(2, 3) + 1] += (0.0, -900.0)
    out = landmark_points(replace(found, pixels=pixels), *seen_by(frame))
    assert not out.visible[POINT_INDEX["middle_tip"]]
    assert out.visible[POINT_INDEX["index_mcp"]]


def test_shifts_are_a_part_of_the_palm_and_scale_with_it(looked) -> None:
    frame, found = looked[0]
    assert SHIFTS.shape == (15, 2)
    assert np.abs(SHIFTS).max() < 0.15
    moved = landmark_points(found, *seen_by(frame)).points_m
    plain = landmark_points(found, *seen_by(frame), aligned=False).points_m
    rig = frame.capture.rig
    palm = found.pixels[list(PALM_LANDMARKS)]
    k = POINT_INDEX["ring_mcp"]
    step = rig.project_to_picture(moved[k])[0] - rig.project_to_picture(plain[k])[0]
    expected = SHIFTS[k] @ np.array([palm[1] - palm[4], palm[2] - palm[0]])
    np.testing.assert_allclose(step, expected, atol=1e-6)
