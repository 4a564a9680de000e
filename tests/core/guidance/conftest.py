"""One simulated patient, still and swaying, in the resolution of a live picture."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.capture.rgbd import RgbdCapture
from devices.simulator import SimulatedPatient
from devices.simulator.room import STILL, make_rig


def _patient(sway_m: float) -> SimulatedPatient:
    return SimulatedPatient(
        "m_young_avg",
        seed=4,
        moles=20,
        lesions=4,
        freckles=10,
        rig=make_rig((640, 480)),
        variation=replace(STILL, sway_m=sway_m),
    )


@pytest.fixture(scope="session")
def still() -> RgbdCapture:
    """Thirty frames of somebody who does not move at all: all change is the sensor's noise."""
    return _patient(0.0).capture("A", frames=30, distance_m=2.6).capture


@pytest.fixture(scope="session")
def swaying() -> RgbdCapture:
    """Thirty frames of somebody who sways by 10 mm (RMS, at the head)."""
    return _patient(0.010).capture("A", frames=30, distance_m=2.6).capture


@pytest.fixture(scope="session")
def too_near() -> RgbdCapture:
    """Two frames of somebody 0.9 m before the camera."""
    return _patient(0.0).capture("psi", frames=2, distance_m=1.0).capture
