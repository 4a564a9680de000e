"""The verdict of a capture: what is found fault with, and where the picture shows it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture, with_skeleton
from core.capture.rgbd import RgbdCapture
from core.guidance import CaptureQuality, Ghost, judge_capture, label_of
from core.surface import scan_body
from devices.trackers import default_tracker


@pytest.fixture(scope="module")
def analysed(still: RgbdCapture) -> AnalysedCapture:
    return analyse_capture(still, default_tracker(), find_spots=False)


def judge(analysed: AnalysedCapture, capture: RgbdCapture) -> CaptureQuality:
    """The verdict of a changed capture with the joints of the unchanged one."""
    return judge_capture(with_skeleton(scan_body(capture), analysed.skeleton))


def names(quality: CaptureQuality) -> set[str]:
    return {finding.name for finding in quality.findings}


def test_a_good_capture_is_called_good(analysed: AnalysedCapture) -> None:
    quality = judge_capture(analysed)
    assert quality.grade == "good", quality.sentences
    assert quality.sentences == ()
    assert quality.measures["coverage"] > 0.98
    assert quality.measures["motion_mm"] < 5
    assert quality.measures["joints"] == 15
    assert quality.faults.shape == (480, 640)


def test_a_band_of_cloth_without_depth_is_found_and_shown_where_it_is(
    still: RgbdCapture, analysed: AnalysedCapture
) -> None:
    frames = still.depth_frames.copy()
    frames[:, 225:270, 250:390] = 0
    quality = judge(analysed, replace(still, depth_frames=frames))
    assert "coverage" in names(quality)
    assert quality.shown_faults == ("no depth",)
    rows, columns = np.nonzero(quality.faults == label_of("no depth"))
    assert 200 < np.median(rows) < 300
    assert 250 < np.median(columns) < 390


def test_a_forearm_that_is_not_measured_is_missed(still: RgbdCapture, analysed: AnalysedCapture) -> None:
    hand = still.rig.depth.project(analysed.skeleton.point("left_hand")[None])[0]
    u, v = (round(float(c)) for c in hand)
    frames = still.depth_frames.copy()
    frames[:, v - 45 : v + 45, u - 50 : u + 50] = 0
    quality = judge(analysed, replace(still, depth_frames=frames))
    assert "no depth" in quality.shown_faults


def test_a_body_that_is_cut_off_is_usable_and_the_edge_is_shown(too_near: RgbdCapture) -> None:
    quality = judge_capture(too_near)
    assert quality.grade == "usable"
    assert "cut" in names(quality)
    assert "above and below" in quality.sentences[0]
    assert "outside" in quality.shown_faults


def test_light_and_blur_of_the_photo_are_judged(still: RgbdCapture, analysed: AnalysedCapture) -> None:
    assert still.color is not None
    white = still.color.copy()
    white[130:230, 290:340] = 255
    bright = judge(analysed, replace(still, color=white))
    assert "over-exposed" in bright.shown_faults
    assert any("over-exposed" in sentence for sentence in bright.sentences)
    dark = judge(analysed, replace(still, color=(still.color * 0.15).astype(np.uint8)))
    assert any("too dark" in sentence for sentence in dark.sentences)
    black = judge(analysed, replace(still, color=(still.color * 0.01).astype(np.uint8)))
    assert black.grade == "refused"
    soft = np.asarray(cv2.GaussianBlur(still.color, (0, 0), 3.0), np.uint8)
    blurred = judge(analysed, replace(still, color=soft))
    assert "blur" in names(blurred)
    assert "blurred" in blurred.shown_faults


def test_movement_within_the_burst_is_measured(still: RgbdCapture, analysed: AnalysedCapture) -> None:
    # one pixel every other frame: from the first to the last third some ten pixels, 44 mm at 2.5 m
    walking = np.stack([np.roll(frame, k // 2, axis=1) for k, frame in enumerate(still.depth_frames)])
    quality = judge(analysed, replace(still, depth_frames=walking))
    assert "motion" in names(quality)
    assert quality.measures["motion_mm"] == pytest.approx(44, rel=0.4)


def test_half_a_body_without_depth_is_refused(still: RgbdCapture, analysed: AnalysedCapture) -> None:
    hidden = dict(analysed.skeleton.joints)
    for name in list(hidden)[4:]:
        hidden[name] = replace(hidden[name], visibility=0.0)
    few = with_skeleton(analysed.scan, replace(analysed.skeleton, joints=hidden))
    quality = judge_capture(few)
    assert quality.grade == "refused"
    assert "4 of 15 joints" in quality.sentences[0]


def test_the_outline_of_an_earlier_capture_lies_on_the_body(still: RgbdCapture) -> None:
    one = replace(still, depth_frames=still.depth_frames[:1])
    outlines = Ghost.of_capture(one).outlines(still.rig)
    assert len(outlines) >= 1
    body = np.zeros((480, 640), np.uint8)
    cv2.fillPoly(body, [np.rint(outline).astype(np.int32) for outline in outlines], 1)
    scan = scan_body(still)
    at = np.rint(scan.vertex_picture_pixels).astype(int)
    near = cv2.dilate(body, np.ones((5, 5), np.uint8))
    inside = near[at[:, 1], at[:, 0]] > 0
    assert inside.mean() > 0.97, "the body lies within its own outline, to two pixels"
    assert body.sum() < 1.25 * len(np.unique(at, axis=0)), "and the outline is no wider than the body"
