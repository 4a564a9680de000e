"""`geoderm capture-info`: what a capture folder holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import main
from core.anchors import JOINT_NAMES
from core.calibration.profile import CalibrationProfile
from core.capture import write_capture
from devices.simulator import SimulatedCapture, SimulatedPatient, make_rig


@pytest.fixture(scope="module")
def simulated() -> SimulatedCapture:
    patient = SimulatedPatient(
        "f_young_avg", seed=2, moles=5, lesions=1, freckles=0, rig=make_rig((640, 480))
    )
    return patient.capture(stance="psi", view="front", frames=3, seed=1)


@pytest.fixture(scope="module")
def folder(simulated: SimulatedCapture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("captures") / "psi"
    write_capture(simulated.capture, path)
    return path


def test_json_holds_every_field_of_the_contract(folder, simulated, capfd) -> None:
    assert main(["capture-info", str(folder), "--json"]) == 0
    said = capfd.readouterr()
    assert said.err == ""
    report = json.loads(said.out)
    assert list(report) == ["joints", "frames", "body_coverage", "depth_noise_m", "warnings"]
    assert report["frames"] == 3
    assert 0.8 < report["body_coverage"] <= 1
    assert 0 < report["depth_noise_m"] < 0.02
    assert tuple(report["joints"]) == JOINT_NAMES
    for name in ("left_hand", "right_knee", "left_shoulder"):
        joint = report["joints"][name]
        assert set(joint) == {"point_m", "pixel", "visibility"}
        assert np.linalg.norm(np.array(joint["point_m"]) - simulated.truth.joints_m[name]) < 0.07


def test_without_colour_joints_have_depth_pixels(folder, tmp_path, capfd) -> None:
    depth_only = tmp_path / "depth"
    depth_only.mkdir()
    description = json.loads((folder / "capture.json").read_text())
    del description["color"], description["color_from_depth"]
    (depth_only / "capture.json").write_text(json.dumps(description))
    for name in description["depth"]["frames"]:
        (depth_only / name).write_bytes((folder / name).read_bytes())
    assert main(["capture-info", str(depth_only), "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert all(set(j) == {"point_m", "depth_pixel", "visibility"} for j in report["joints"].values())


def test_the_table_is_for_people(folder, capfd) -> None:
    assert main(["capture-info", str(folder)]) == 0
    said = capfd.readouterr().out
    assert "3 frame(s) of 640 x 480" in said
    assert "15 of 15 visible, from the colour picture" in said
    assert "left_elbow" in said


def test_a_folder_that_is_none_is_wrong_use(tmp_path, capfd) -> None:
    assert main(["capture-info", str(tmp_path / "nowhere")]) == 2
    said = capfd.readouterr().err
    assert "nowhere" in said
    assert len(said.splitlines()) == 1


def test_an_empty_room_is_work_that_could_not_be_done(folder, tmp_path, capfd) -> None:
    import cv2

    empty = tmp_path / "empty"
    empty.mkdir()
    description = json.loads((folder / "capture.json").read_text())
    description["depth"]["frames"] = ["depth_000.png"]
    del description["color"], description["color_from_depth"]
    (empty / "capture.json").write_text(json.dumps(description))
    cv2.imwrite(str(empty / "depth_000.png"), np.zeros((480, 640), np.uint16))
    assert main(["capture-info", str(empty)]) == 3
    said = capfd.readouterr().err
    assert "internal" not in said
    assert len(said.splitlines()) == 1


def test_the_sensor_and_the_calibration_it_was_taken_with_are_told(simulated, tmp_path, capfd) -> None:
    profile = CalibrationProfile(simulated.capture.rig, "S1", "S1", version=3, views=25)
    taken = replace(simulated.capture, sensor="kinect-v1", calibration=profile.document())
    write_capture(taken, tmp_path / "calibrated")
    assert main(["capture-info", str(tmp_path / "calibrated")]) == 0
    said = capfd.readouterr().out
    assert "Sensor         kinect-v1" in said
    assert f"version 3 of {profile.made_at:%Y-%m-%d}, 25 views ({profile.id})" in said


def test_a_damaged_calibration_is_bad_input_that_names_the_field(simulated, tmp_path, capfd) -> None:
    document = CalibrationProfile(simulated.capture.rig, "S1").document()
    document["depth"]["fx"] = "wide"
    write_capture(replace(simulated.capture, calibration=document), tmp_path / "damaged")
    assert main(["capture-info", str(tmp_path / "damaged")]) == 2
    said = capfd.readouterr().err.strip()
    assert "capture.json: calibration: depth.fx" in said
    assert "\n" not in said
