"""The measured skin and shortest paths on it, held against the true body; kept for a run that goes on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from app.cli.evaluate_sensors import _Once, _Skins
from app.cli.simulated_cases import SimulatedCases
from devices.simulator.cases import TUNING_PAIRS

SENSOR = "kinect-v2"


@pytest.fixture(scope="module")
def once() -> _Once:
    source = SimulatedCases(TUNING_PAIRS[:1], frames=1, color_size=(320, 240), sensor=SENSOR)
    return _Once(next(iter(source.cases())))


def test_skins_are_measured_once_and_read_again(once: _Once, tmp_path: Path) -> None:
    path = tmp_path / "skins.jsonl"
    skins = _Skins(path, "code")
    skins.measure(once, SENSOR)
    made = skins.of([once.name.case])
    assert SENSOR in once.name.case
    assert [skin.sensor for skin in made] == [SENSOR, SENSOR]
    for skin in made:
        assert 2.0 < skin.depth_mm < 6.0
        assert 1.0 < skin.normal_deg < 15.0
        assert len(skin.lengths_mm) == len(skin.errors_mm) > 20
        assert np.mean(np.abs(skin.errors_mm) / np.array(skin.lengths_mm)) < 0.02
    with path.open("a") as file:
        file.write('{"code": "code", "case": "torn')
    assert _Skins(path, "code").of([once.name.case]) == made
    assert _Skins(path, "other code").of([once.name.case]) == []


def test_what_is_known_is_not_measured_again(once: _Once, tmp_path: Path) -> None:
    path = tmp_path / "skins.jsonl"
    path.write_text(json.dumps({"code": "c", "case": once.name.case, "skins": []}) + "\n")
    skins = _Skins(path, "c")
    skins.measure(once, SENSOR)
    assert len(path.read_text().splitlines()) == 1
