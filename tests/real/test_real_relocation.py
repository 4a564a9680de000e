"""Lesions on real people in real frames: the follow-up's answer lies on the same part of the body."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.anchors import AnalysedCapture, analyse_capture
from core.capture import read_capture
from core.relocation import LesionQuery, relocate
from devices.trackers import default_tracker

REAL = Path(__file__).resolve().parents[3] / "shared" / "real"
CLICKED = json.loads((Path(__file__).parent / "kinect_joints.json").read_text())["frames"]
SAME_MAN = (("01", "02"), ("02", "03"), ("04", "01"), ("03", "08"))
"""Pairs of frames in different stances in which both arms were clicked."""
NEAR_M = 0.10

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"the real recordings are not at {REAL}"),
]


@cache
def analysed(folder: str) -> AnalysedCapture:
    return analyse_capture(read_capture(REAL / folder), default_tracker())


def places(frame: str) -> dict[str, np.ndarray]:
    """Depth pixels on the chest, upper arms and forearms, from the clicked joints."""
    joint = {name: np.array(click["pixel"], float) for name, click in CLICKED[frame]["joints"].items()}
    out = {"chest": 0.5 * joint["torso"] + 0.25 * (joint["left_shoulder"] + joint["right_shoulder"])}
    for side in ("left", "right"):
        shoulder, elbow, hand = (joint[f"{side}_{part}"] for part in ("shoulder", "elbow", "hand"))
        out[f"{side} upper arm"] = 0.5 * (shoulder + elbow)
        out[f"{side} forearm"] = 0.55 * elbow + 0.45 * hand
    return out


def nearest_part(pixel: np.ndarray, frame: str) -> str:
    return min(places(frame), key=lambda part: np.linalg.norm(places(frame)[part] - pixel))


@pytest.mark.parametrize(("first", "followup"), SAME_MAN)
def test_lesions_of_a_depth_only_recording_are_found_on_the_same_body_part(first, followup):
    one, two = analysed(f"kinect_depth/{first}"), analysed(f"kinect_depth/{followup}")
    queries = [LesionQuery(part, None, tuple(pixel)) for part, pixel in places(first).items()]
    result = relocate(one, two, queries)
    answered = [lesion for lesion in result.lesions if lesion.has_point]
    assert len(answered) >= 4, [(lesion.id, lesion.reason) for lesion in result.lesions]
    camera = two.capture.rig.depth
    for lesion in answered:
        pixel = np.array(lesion.depth_pixel)
        assert nearest_part(pixel, followup) == lesion.id
        away = np.linalg.norm(pixel - places(followup)[lesion.id]) * lesion.point_m[2] / camera.fx
        assert away < NEAR_M
        assert lesion.picture == "depth"


def test_a_small_turn_of_a_dressed_man_is_followed():
    one, two = analysed("person_turning/00"), analysed("person_turning/10")
    arms = [name for name in ("left", "right") if one.skeleton.sees(f"{name}_shoulder", f"{name}_elbow")]
    assert arms
    queries = []
    for side in arms:
        middle = 0.5 * (one.skeleton.point(f"{side}_shoulder") + one.skeleton.point(f"{side}_elbow"))
        skin = one.scan.surface.nearest(middle)[0].position_m
        queries.append(LesionQuery(side, tuple(one.capture.rig.project_to_picture(skin)[0])))
    for lesion in relocate(one, two, queries).lesions:
        assert lesion.status in ("predicted", "ambiguous"), lesion.reason
        upper = [two.skeleton.point(f"{lesion.id}_{end}") for end in ("shoulder", "elbow")]
        share = np.clip(
            np.dot(lesion.point_m - upper[0], upper[1] - upper[0]) / np.sum((upper[1] - upper[0]) ** 2), 0, 1
        )
        assert np.linalg.norm(lesion.point_m - upper[0] - share * (upper[1] - upper[0])) < 0.12
        assert 0.2 < share < 0.8
