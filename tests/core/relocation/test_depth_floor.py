"""Noisier depth widens what is stated; a better sensor narrows nothing by a model alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.capture import CameraRig, PinholeCamera, RgbdCapture
from core.relocation.depth_floor import depth_excess_m2, widened
from core.relocation.types import Estimate, Region
from core.surface import BodyScan, scan_body


def ball(distance_m: float) -> BodyScan:
    """A ball of 60 cm in an empty room."""
    camera = PinholeCamera(320, 240, 288.0, 288.0, 159.5, 119.5)
    rays = camera.pixel_rays
    a, b, c = (rays**2).sum(axis=2), rays[..., 2] * distance_m, distance_m**2 - 0.3**2
    root = b * b - a * c
    z = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0.0))) / a, 0.0)
    frames = np.rint(1000.0 * z).astype(np.uint16)[None]
    return scan_body(RgbdCapture(frames, 0.001, CameraRig(camera)))


def seen_by(scan: BodyScan, sensor: str) -> BodyScan:
    return replace(scan, capture=replace(scan.capture, sensor=sensor))


@pytest.fixture(scope="module")
def near() -> BodyScan:
    return ball(1.5)


@pytest.mark.parametrize("sensor", ["kinect-v1", "", "unheard-of", "kinect-v2"])
def test_sensors_no_noisier_than_the_learned_one_change_nothing(sensor: str, near: BodyScan) -> None:
    if sensor == "kinect-v2":
        assert depth_excess_m2(seen_by(ball(2.6), sensor)) == 0.0
    else:
        assert depth_excess_m2(seen_by(near, sensor)) == 0.0


def test_stereo_exceeds_and_more_so_from_afar(near: BodyScan) -> None:
    one, two = (depth_excess_m2(seen_by(scan, "realsense-d4xx")) for scan in (near, ball(2.6)))
    assert 0 < one < two
    assert 0.004 < np.sqrt(two) < 0.02


@given(
    radius=st.floats(1e-3, 0.2),
    share=st.floats(0.1, 1.0),
    excess=st.floats(0.0, 4e-4),
    confidence=st.floats(0.0, 1.0),
)
def test_a_region_grows_in_all_directions_and_the_confidence_falls(
    radius: float, share: float, excess: float, confidence: float
) -> None:
    region = Region((radius, share * radius), np.array([1.0, 0.0, 0.0]))
    estimate = Estimate(np.zeros(3), radius, confidence, 0, region=region)
    wide = widened(estimate, excess)
    assert wide.radius95_m is not None
    assert wide.region is not None
    assert wide.radius95_m**2 == pytest.approx(radius**2 + 1.96**2 * excess)
    assert wide.region.axes_m[0] == pytest.approx(wide.radius95_m)
    assert wide.region.axes_m[1] >= share * radius
    assert wide.confidence <= confidence
    assert (wide is estimate) == (excess == 0.0)


def test_no_answer_stays_no_answer() -> None:
    nothing = Estimate(None, reason="hidden")
    assert widened(nothing, 1e-4) is nothing
