from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.records import ClinicStore, Patient, PatientDraft, User, Visit


def make_capture(seed: int = 0, *, frames: int = 2, color: bool = True) -> RgbdCapture:
    rng = np.random.default_rng(seed)
    depth = rng.integers(0, 65536, (frames, 24, 32), dtype=np.uint16)
    angle = 0.1 + seed
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    rig = CameraRig(
        PinholeCamera(32, 24, 30.1, 30.2, 15.5, 11.5),
        PinholeCamera(40, 30, 38.0, 38.5, 19.6, 14.4, (0.1, -0.2, 0.001, 0.002)) if color else None,
        RigidTransform(rotation, rng.normal(size=3)) if color else None,
    )
    picture = rng.integers(0, 256, (30, 40, 3), dtype=np.uint8) if color else None
    joints = {"head": rng.normal(size=3), "left_hand": rng.normal(size=3)}
    return RgbdCapture(depth, 0.0001, rig, picture, "front", "psi", joints_m=joints)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[ClinicStore]:
    with ClinicStore.open(tmp_path / "clinic") as opened:
        yield opened


@pytest.fixture
def doctor(store: ClinicStore) -> User:
    return store.users.create("doctor", "Dr Doctor", "correct horse")


@pytest.fixture
def patient(store: ClinicStore, doctor: User) -> Patient:
    return store.patients.create(PatientDraft("Novák", "Jiří", clinic_number="A-1"), by=doctor.id)


@pytest.fixture
def visit(store: ClinicStore, doctor: User, patient: Patient) -> Visit:
    return store.visits.create(patient.id, doctor.id)


@pytest.fixture
def capture() -> RgbdCapture:
    return make_capture()


@pytest.fixture
def capture_of() -> Callable[..., RgbdCapture]:
    """Makes a small capture of random bits: ``capture_of(seed, frames=..., color=...)``."""
    return make_capture
