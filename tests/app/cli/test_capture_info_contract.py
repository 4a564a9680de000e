"""``geoderm capture-info``: what it prints about a good capture folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.anchors import JOINT_NAMES
from core.capture import read_capture
from tests.app.cli.cases import edit, geoderm, map_depth, put, without_color, without_joints
from tests.app.cli.conftest import Shot


@pytest.fixture
def folder(first: Shot, tmp_path: Path) -> Path:
    return first.copy(tmp_path / "capture")


def test_json_is_the_only_output_and_has_exactly_the_fields_of_the_contract(first: Shot) -> None:
    outcome = geoderm("capture-info", first.folder, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    told = json.loads(outcome.out)
    assert set(told) == {"joints", "frames", "body_coverage", "depth_noise_m", "warnings"}
    assert told["frames"] == 2
    assert 0.5 < told["body_coverage"] <= 1
    assert 0 < told["depth_noise_m"] < 0.03
    assert told["warnings"] == []
    assert set(told["joints"]) == set(JOINT_NAMES)
    for joint in told["joints"].values():
        assert set(joint) == {"point_m", "pixel", "visibility"}
        assert 0 <= joint["visibility"] <= 1


def test_recorded_joints_are_told_as_they_are_recorded(first: Shot) -> None:
    told = json.loads(geoderm("capture-info", first.folder, "--json").out)["joints"]
    rig = read_capture(first.folder).rig
    for name, joint in told.items():
        np.testing.assert_allclose(joint["point_m"], first.truth.joints_m[name], atol=2e-5)
        np.testing.assert_allclose(joint["pixel"], rig.project_to_picture(joint["point_m"])[0], atol=0.05)


@pytest.mark.parametrize("color", [True, False], ids=["from colour", "from depth alone"])
def test_without_recorded_joints_the_tracker_finds_them(folder: Path, first: Shot, color: bool) -> None:
    without_joints(folder)
    if not color:
        without_color(folder)
    outcome = geoderm("capture-info", folder, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    joints = json.loads(outcome.out)["joints"]
    assert set(joints) == set(JOINT_NAMES)
    rig = read_capture(folder).rig
    errors = []
    for name, joint in joints.items():
        pixel = joint["pixel" if color else "depth_pixel"]
        assert len(pixel) == 2
        assert ("depth_pixel" in joint) != color
        errors.append(float(np.linalg.norm(np.array(joint["point_m"]) - first.truth.joints_m[name])))
        assert rig.picture_camera.contains(pixel)[0]
    assert np.median(errors) < 0.06
    assert max(errors) < 0.25


def test_a_capture_from_behind_keeps_the_patients_own_sides(back: Shot, tmp_path: Path) -> None:
    joints = json.loads(geoderm("capture-info", without_joints(back.copy(tmp_path / "back")), "--json").out)[
        "joints"
    ]
    for name in ("left_shoulder", "right_shoulder", "left_hip", "right_hip"):
        np.testing.assert_allclose(joints[name]["point_m"], back.truth.joints_m[name], atol=0.12)
    assert joints["left_shoulder"]["point_m"][0] < joints["right_shoulder"]["point_m"][0]


def test_one_frame_is_enough_and_its_noise_is_still_told(folder: Path) -> None:
    edit(folder, lambda d: put(d, ("depth", "frames"), d["depth"]["frames"][:1]))
    told = json.loads(geoderm("capture-info", folder, "--json").out)
    assert told["frames"] == 1
    assert 0 < told["depth_noise_m"] < 0.05


def test_the_unit_of_depth_is_honoured(folder: Path) -> None:
    """Tenths of a millimetre say the same as millimetres."""
    before = json.loads(geoderm("capture-info", folder, "--json").out)
    map_depth(folder, lambda image: image * 10)
    edit(folder, lambda d: put(d, ("depth", "unit_m"), 0.0001))
    after = json.loads(geoderm("capture-info", folder, "--json").out)
    assert after["body_coverage"] == pytest.approx(before["body_coverage"], abs=0.01)
    assert after["warnings"] == before["warnings"]


def test_a_table_for_people(first: Shot) -> None:
    outcome = geoderm("capture-info", first.folder)
    assert (outcome.code, outcome.err) == (0, "")
    for word in ("front", "psi", "2 frame(s)", "256 x 192", "320 x 240", "left_shoulder", "15 of 15"):
        assert word in outcome.out


def test_a_recorded_joint_behind_the_camera_has_no_pixel_and_the_json_no_nan(folder: Path) -> None:
    description = json.loads((folder / "capture.json").read_text(encoding="utf-8"))
    description["joints_m"]["left_hand"] = [0.1, 0.2, -1.0]
    (folder / "capture.json").write_text(json.dumps(description), encoding="utf-8")
    outcome = geoderm("capture-info", folder, "--json")
    assert outcome.code == 0
    assert "NaN" not in outcome.out
    assert json.loads(outcome.out)["joints"]["left_hand"]["pixel"] is None
