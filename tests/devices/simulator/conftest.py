from __future__ import annotations

import pytest

from devices.simulator import STILL, SimulatedCapture, SimulatedPatient, make_rig

SMALL = (640, 480)


@pytest.fixture(scope="package")
def patient() -> SimulatedPatient:
    """A young man with his natural variation, seen by the Kinect's own colour camera."""
    return SimulatedPatient(seed=5, moles=120, rig=make_rig(SMALL))


@pytest.fixture(scope="package")
def first(patient: SimulatedPatient) -> SimulatedCapture:
    return patient.capture("psi", frames=6, joints=True)


@pytest.fixture(scope="package")
def followup(patient: SimulatedPatient) -> SimulatedCapture:
    return patient.capture("hip_hands", visit=2, frames=1, turn_deg=12.0)


@pytest.fixture(scope="package")
def dummy() -> SimulatedPatient:
    """A body that neither sways, breathes nor slides, in a small picture."""
    return SimulatedPatient(seed=5, moles=60, variation=STILL, rig=make_rig((320, 240)))


@pytest.fixture(scope="package")
def front(dummy: SimulatedPatient) -> SimulatedCapture:
    return dummy.capture("A", "front", frames=1, distance_m=2.3, height_m=0.9)


@pytest.fixture(scope="package")
def back(dummy: SimulatedPatient) -> SimulatedCapture:
    return dummy.capture("A", "back", frames=1, distance_m=2.3, height_m=0.9)
