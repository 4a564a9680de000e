"""The table of sensors: one row for each, from the same pairs."""

from __future__ import annotations

import json

import numpy as np

from core.capture.sensors import sensor_model
from core.evaluation import CaseName, LesionScore, Record, Rung
from core.evaluation.sensor_table import (
    SkinError,
    sensor_rows,
    sensors_document,
    sensors_markdown,
    write_sensors,
)

RUNG = Rung("fused")
NAMES = ("kinect-v1", "kinect-v2")


def record(sensor: str, body: str, errors_mm: list[float], followup: str = "psi") -> Record:
    lesions = tuple(
        LesionScore(f"L{k}", "trunk", "", True, False, "predicted", e / 1000, radius95_m=0.010)
        for k, e in enumerate(errors_mm)
    )
    return Record(RUNG, CaseName(f"{body}-{sensor}", body, "psi", followup), "code", lesions=lesions)


def table() -> tuple[dict[str, object], str]:
    records = {
        "kinect-v1": [record("kinect-v1", "a", [4, 8, 12]), record("kinect-v1", "b", [6], "T")],
        "kinect-v2": [record("kinect-v2", "a", [2, 4, 6]), record("kinect-v2", "b", [3], "T")],
    }
    rows = sensor_rows(records, [RUNG])
    assert [(r.group, r.sensor) for r in rows] == [
        ("same stance", "kinect-v1"),
        ("same stance", "kinect-v2"),
        ("other stance", "kinect-v1"),
        ("other stance", "kinect-v2"),
    ]
    means = [r.summary.mean_mm.value for r in rows]
    np.testing.assert_allclose(means, [8.0, 4.0, 6.0, 3.0])
    skins = [SkinError("a", name, 4.0, 6.0, (100.0, 200.0), (1.0, -3.0)) for name in NAMES]
    models = [sensor_model(name) for name in NAMES]
    about = {"captures": "made up"}
    return sensors_document(models, rows, skins, about), sensors_markdown(models, rows, skins, about)


def test_each_sensor_has_its_row_with_coverage_and_radius() -> None:
    document, text = table()
    rows = document["rows"]
    assert isinstance(rows, list)
    assert [row["in_radius"] for row in rows] == [0.6667, 1.0, 1.0, 1.0]
    line = next(row for row in text.splitlines() if row.startswith("| fused | kinect-v1 | 1 "))
    assert "8.0 (8.0-8.0)" in line
    assert "67 %" in line
    assert "10.0" in line


def test_paths_are_summed_up_over_all_captures_of_a_sensor() -> None:
    _, text = table()
    line = next(row for row in text.splitlines() if row.startswith("| kinect-v2 | 1 | 4.0 mm"))
    assert "2.0 mm" in line
    assert "1.25 %" in line
    assert "-0.25 %" in line


def test_the_document_is_plain_json(tmp_path) -> None:
    document, text = table()
    paths = write_sensors(document, text, tmp_path)
    assert json.loads(paths[1].read_text())["format"] == "geoderm-sensors/1"
    assert paths[0].read_text() == text
