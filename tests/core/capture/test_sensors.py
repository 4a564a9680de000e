"""Depth sensors as data: what a file must say, and what the model makes of it."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.capture.sensors import (
    DEFAULT_SENSOR,
    read_sensor,
    sensor_model,
    sensor_names,
    sensor_of,
)
from core.errors import InputError
from resources import resource_path

SENSORS = ("kinect-v1", "kinect-v2", "realsense-d4xx")


def document(name: str = "kinect-v1") -> dict[str, Any]:
    return json.loads(resource_path("sensors", f"{name}.json").read_text(encoding="utf-8"))


def read(content: Any, folder: Path, name: str = "kinect-v1") -> Any:
    path = folder / f"{name}.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return read_sensor(path)


def test_the_three_principles_are_known_and_name_their_sources() -> None:
    assert set(SENSORS) <= set(sensor_names())
    assert {sensor_model(name).principle for name in SENSORS} == {
        "structured-light",
        "time-of-flight",
        "stereo",
    }
    assert all(len(sensor_model(name).sources) >= 3 for name in SENSORS)


def test_an_unknown_sensor_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="no sensor 'kinect-9'") as caught:
        sensor_model("kinect-9")
    assert "kinect-v2" in (caught.value.advice or "")


@pytest.mark.parametrize(("name", "known"), [("kinect-v2", True), ("azure", False), ("", False)])
def test_a_capture_of_an_unknown_sensor_is_taken_for_the_default(name: str, known: bool) -> None:
    model, said = sensor_of(name)
    assert said is known
    assert model.name == (name if known else DEFAULT_SENSOR)


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(SENSORS),
    z=st.floats(0.0, 1.0),
    step=st.floats(0.001, 0.5),
    angle=st.floats(0.0, 1.57),
    steeper=st.floats(0.0, 1.0),
)
def test_noise_is_positive_and_grows_with_distance_and_angle(
    name: str, z: float, step: float, angle: float, steeper: float
) -> None:
    sensor = sensor_model(name)
    near = sensor.near_m + z * (sensor.far_m - sensor.near_m)
    # a time-of-flight camera's noise falls by a fraction of a millimetre over the first metre, and the
    # published share of the angle falls with distance: it was measured up to 60 degrees
    seen = min(angle, np.deg2rad(60))
    assert 0 < sensor.axial_sigma(near, seen) <= sensor.axial_sigma(near + step, seen) + 2.5e-4
    assert sensor.axial_sigma(near, angle) > 0
    assert sensor.axial_sigma(near, angle) <= sensor.axial_sigma(near, angle + steeper) + 1e-9
    assert sensor.quantisation_step(near) > 0
    assert 0 < sensor.systematic_sigma(near) <= sensor.systematic_sigma(near + step) + 1e-12


@pytest.mark.parametrize(
    ("name", "z_m", "sigma_m"),
    [
        ("kinect-v1", 2.0, 0.0012 + 0.0019 * 1.6**2),
        ("kinect-v1", 1.0, 0.0012 + 0.0019 * 0.6**2),
        ("kinect-v2", 2.0, 0.0015 - 0.0005 * 2 + 0.0003 * 4),
        ("realsense-d4xx", 2.0, 0.04 * 2.0**2 / (424.0 * 0.05)),
    ],
)
def test_the_published_formulas_come_out(name: str, z_m: float, sigma_m: float) -> None:
    assert float(sensor_model(name).axial_sigma(z_m)) == pytest.approx(sigma_m, rel=1e-3)


def test_one_frame_of_a_d435_errs_by_eight_hundredths_of_a_pixel() -> None:
    sensor = sensor_model("realsense-d4xx")
    whole = float(sensor.fused_sigma(2.0, 1))
    assert whole == pytest.approx(0.08 * 2.0**2 / (424.0 * 0.05), rel=0.05)


@settings(max_examples=30, deadline=None)
@given(name=st.sampled_from(SENSORS), z=st.floats(0.6, 4.0), frames=st.integers(1, 300))
def test_averaging_helps_down_to_what_stays_and_smoothing_below(name: str, z: float, frames: int) -> None:
    sensor = sensor_model(name)
    one, many = sensor.fused_sigma(z, 1), sensor.fused_sigma(z, frames)
    assert sensor.systematic_sigma(z) <= many <= one
    assert sensor.skin_sigma(z, frames) <= many


def test_fewer_pixels_are_as_precise() -> None:
    for name in SENSORS:
        full, half = sensor_model(name), sensor_model(name).scaled(0.5)
        assert half.depth_camera.width == full.depth_camera.width // 2
        np.testing.assert_allclose(half.quantisation_step(2.3), full.quantisation_step(2.3), rtol=1e-6)
        np.testing.assert_allclose(half.systematic_sigma(2.3), full.systematic_sigma(2.3), rtol=1e-6)


def test_the_fingerprint_follows_figures_and_not_words(tmp_path: Path) -> None:
    content = document()
    plain = read(content, tmp_path).fingerprint
    assert read({**content, "title": "Another"}, tmp_path).fingerprint == plain
    assert read({**content, "lateral_px": 0.9}, tmp_path).fingerprint != plain


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("format", "geoderm-sensor/2", "format"),
        ("name", "other", "name of the file"),
        ("name", "../../etc", "name"),
        ("principle", "sonar", "principle"),
        ("far_m", 0.2, "far_m"),
        ("near_m", -1.0, "near_m"),
        ("far_m", float("nan"), "far_m"),
        ("baseline_m", 0.0, "baseline_m"),
        ("lateral_px", "0.8", "lateral_px"),
        ("lateral_px", 1e9, "lateral_px"),
        ("sources", [], "sources"),
        ("quantisation", {}, "quantisation"),
        ("quantisation", {"disparity_px": 0.1, "depth_m": 0.001}, "either"),
        ("axial", {"from_m": 0.0, "powers": []}, "powers"),
        ("axial", {"from_m": 0.0, "powers": [0.001, -0.001]}, "axial noise"),
        ("axial", {"from_m": 0.0, "powers": [0.0]}, "axial noise"),
        ("grain", {"white": 1.0, "correlated": 1.0, "window_px": 1.0}, "squares"),
        ("dropout", {"grazing_deg": 80.0, "lost_deg": 70.0, "silhouette": 0.1, "random": 0.0}, "lost_deg"),
        ("systematic", {"kind": "matching"}, "systematic"),
        ("depth_camera", {"width": 10**9, "height": 1, "fx": 1, "fy": 1, "cx": 0, "cy": 0}, "width"),
        ("surprise", 1, "surprise"),
    ],
)
def test_a_bad_field_is_named(field: str, value: Any, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"kinect-v1\.json") as caught:
        read({**document(), field: value}, tmp_path)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "text", ["", "[]", "null", "{", "7", '"x"', "[" * 100_000, "\x00", "{}" + " " * 200_000]
)
def test_what_is_no_sensor_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"kinect-v1\.json"):
        read(text, tmp_path)


_json = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_any_change_of_a_field_is_read_or_refused(data: st.DataObject, tmp_path_factory: Any) -> None:
    content = document(data.draw(st.sampled_from(SENSORS)))
    place: Any = content
    key: Any = data.draw(st.sampled_from(sorted(content)))
    while isinstance(place[key], dict) and data.draw(st.booleans()):
        place, key = place[key], data.draw(st.sampled_from(sorted(place[key])))
    place[key] = data.draw(_json)
    with suppress(InputError):
        model = read(content, tmp_path_factory.getbasetemp(), "kinect-v1")
        assert (model.axial_sigma(np.linspace(model.near_m, model.far_m, 9)) > 0).all()
