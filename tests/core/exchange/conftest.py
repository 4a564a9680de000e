from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig, RgbdCapture
from core.capture.transform import RigidTransform
from core.records import ClinicStore, Patient, PatientDraft, User

MOLES = [(150, 110), (165, 118), (158, 150), (140, 170), (172, 182), (150, 200)]


def make_body(*, color: bool = True, view: str = "front") -> RgbdCapture:
    """A figure before a wall: trunk, head, arms, legs; a colour picture twice as fine."""
    height, width = 240, 320
    depth = np.full((height, width), 3200, np.uint16)
    shape = np.zeros((height, width), np.uint8)
    cv2.ellipse(shape, (158, 125), (26, 50), 0, 0, 360, 255, -1)
    cv2.circle(shape, (158, 60), 15, 255, -1)
    for x in (147, 169):
        cv2.line(shape, (x, 165), (x, 222), 255, 14)
    for x in (118, 198):
        cv2.line(shape, (158, 95), (x, 130), 255, 10)
    bulge = np.minimum(8.0 * cv2.distanceTransform(shape, cv2.DIST_L2, 5), 130.0)
    depth[shape > 0] = (2250.0 - bulge[shape > 0]).astype(np.uint16)
    rig = CameraRig(PinholeCamera(width, height, 288.0, 288.0, 159.5, 119.5))
    picture = None
    if color:
        big = cv2.resize(shape, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
        picture = np.full((2 * height, 2 * width, 3), (214, 224, 226), np.uint8)
        picture[big > 127] = (206, 158, 132)
        for u, v in MOLES:
            cv2.circle(picture, (2 * u, 2 * v), 4, (88, 52, 38), -1)
        rig = CameraRig(
            rig.depth, PinholeCamera(2 * width, 2 * height, 576.0, 576.0, 319.5, 239.5), RigidTransform()
        )
    return RgbdCapture(depth[None], 0.001, rig, picture, view, "psi")


def dermoscopic(shade: int) -> bytes:
    image = np.full((120, 160, 3), (220, 180, 170), np.uint8)
    cv2.ellipse(image, (80, 60), (45, 32), 20, 0, 360, (90 + shade, 60, 50), -1)
    out = io.BytesIO()
    Image.fromarray(image).save(out, "JPEG")
    return out.getvalue()


@pytest.fixture
def body() -> Callable[..., RgbdCapture]:
    return make_body


@pytest.fixture
def dermoscopic_image() -> Callable[[int], bytes]:
    return dermoscopic


@pytest.fixture
def moles() -> list[tuple[int, int]]:
    """Moles of the figure in pixels of the depth image; the colour picture is twice as fine."""
    return MOLES


@pytest.fixture
def store(tmp_path: Path) -> Iterator[ClinicStore]:
    with ClinicStore.open(tmp_path / "clinic") as opened:
        opened.settings.set("clinic_name", "Dermatologie Žižkov")
        yield opened


@pytest.fixture
def doctor(store: ClinicStore) -> User:
    return store.users.create("doctor", "MUDr. Žofie Šťastná", "a long password")


@pytest.fixture
def patient(store: ClinicStore, doctor: User) -> Patient:
    draft = PatientDraft("Nguyễn Thị", "Ελένη", date(1968, 3, 14), "F", "CZ-417")
    return store.patients.create(draft, by=doctor.id)
