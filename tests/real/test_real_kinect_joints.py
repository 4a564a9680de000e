"""Joints of real people in real Kinect frames against places clicked by eye (`kinect_joints.json`)."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from app.cli.capture_info import capture_report
from core.anchors import BONES, AnalysedCapture, Sides, analyse_capture, guard_left_right
from core.anchors.lifting import interior_m
from core.capture import RgbdCapture, read_capture
from devices.trackers import default_tracker

REAL = Path(__file__).resolve().parents[3] / "shared" / "real" / "kinect_depth"
CLICKED = json.loads((Path(__file__).parent / "kinect_joints.json").read_text())["frames"]
TOLERANCE_M = 0.080

pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(not REAL.is_dir(), reason=f"the real recordings are not at {REAL}"),
]


@cache
def analysed_frame(frame: str) -> AnalysedCapture:
    return analyse_capture(read_capture(REAL / frame), default_tracker())


def clicked_joint(capture: RgbdCapture, click: dict[str, object], name: str) -> np.ndarray:
    """A clicked pixel in space: the depth under it, or as read off the image, plus the depth inside."""
    u, v = click["pixel"]
    depth = click.get("surface_m")
    if depth is None:
        patch = capture.depth_frames[0][v - 3 : v + 4, u - 3 : u + 4] * capture.depth_unit_m
        depth = np.median(patch[patch > 0])
    return capture.rig.depth.rays([u, v])[0] * (depth + interior_m(name))


@pytest.mark.parametrize("frame", sorted(CLICKED))
def test_every_visible_joint_is_near_its_clicked_place(frame: str) -> None:
    analysed = analysed_frame(frame)
    capture = analysed.capture
    report = json.loads(json.dumps(capture_report(analysed)))
    assert report["frames"] == 1
    assert 0.5 < report["body_coverage"] <= 1.0
    assert 0.0 < report["depth_noise_m"] < 0.02
    errors = {}
    for name, click in CLICKED[frame]["joints"].items():
        found = report["joints"][name]
        assert found["visibility"] >= 0.5, f"{name} was clicked but not found"
        truth = clicked_joint(capture, click, name)
        errors[name] = float(np.linalg.norm(np.array(found["point_m"]) - truth))
        pixel = np.array(found["depth_pixel"])
        assert np.linalg.norm(pixel - capture.rig.depth.project(found["point_m"])[0]) < 0.1
    assert max(errors.values()) < TOLERANCE_M, {k: f"{1000 * e:.0f} mm" for k, e in errors.items()}


@pytest.mark.parametrize("frame", ["03", "11"])
def test_what_lies_below_the_image_is_not_claimed(frame: str) -> None:
    analysed = analysed_frame(frame)
    assert not {"left_knee", "right_knee", "left_foot", "right_foot"} & set(analysed.skeleton.visible())
    assert any("cut by" in warning for warning in analysed.warnings)
    assert guard_left_right(analysed.skeleton, "front").sides is Sides.AGREE


@pytest.mark.parametrize("frame", ["10", "11"])
def test_the_person_behind_is_neither_tracked_nor_silent(frame: str) -> None:
    analysed = analysed_frame(frame)
    assert (
        max(joint.point_m[2] for joint in analysed.skeleton.joints.values() if joint.visibility >= 0.5) < 1.6
    )
    assert any("nother person" in warning for warning in analysed.warnings)


def test_bones_of_one_man_agree_between_his_stances() -> None:
    """Frames 01, 02 and 05 show the same man, arms in the picture plane."""
    lengths = []
    for frame in ("01", "02", "05"):
        skeleton = analysed_frame(frame).skeleton
        lengths.append(
            [
                float(np.linalg.norm(skeleton.point(a) - skeleton.point(b)))
                for a, b in BONES
                if skeleton.sees(a, b)
            ]
        )
    assert np.ptp(np.array(lengths), axis=0).max() < 0.09
