"""``--sensor``: simulated captures of other depth sensors, and accuracy with each."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from core.capture import read_capture
from tests.app.cli.cases import assert_told, geoderm


def test_a_capture_of_another_sensor_has_its_image_and_names_it(tmp_path: Path) -> None:
    outcome = geoderm("simulate", tmp_path / "v2", "--sensor", "kinect-v2", "--frames", "1")
    assert outcome.code == 0, outcome
    capture = read_capture(tmp_path / "v2")
    assert capture.sensor == "kinect-v2"
    assert capture.depth_frames.shape == (1, 424, 512)
    assert json.loads((tmp_path / "v2" / "lesions.json").read_text())["lesions"]


@pytest.mark.parametrize(
    "command",
    [
        ("simulate", "FOLDER/out"),
        ("evaluate", "ladder", "--pairs", "1"),
        ("evaluate", "sensors", "--pairs", "1"),
        ("evaluate", "residuals", "--out", "FOLDER/residuals.csv", "--pairs", "1"),
    ],
    ids=" ".join,
)
def test_an_unknown_sensor_is_refused_with_the_known_ones(command: tuple[str, ...], tmp_path: Path) -> None:
    arguments = [word.replace("FOLDER", str(tmp_path)) for word in command]
    assert_told(geoderm(*arguments, "--sensor", "sonar"), 2, "sonar", "kinect-v2")
    assert list(tmp_path.iterdir()) == []


def test_the_sensors_are_measured_on_a_frozen_split_only() -> None:
    assert_told(geoderm("evaluate", "sensors", "--split", "mine"), 2, "mine", "tuning")
