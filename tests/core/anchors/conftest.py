"""People made of 15 points, a Kinect-like rig, and the real tracker."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from core.anchors import Joint, Skeleton, SkeletonTracker
from core.capture.camera import PinholeCamera
from core.capture.rgbd import CameraRig
from core.surface import BodyScan, scan_body
from devices.simulator import SimulatedCapture, SimulatedPatient, make_rig

MakeSkeleton = Callable[..., Skeleton]

PSI = {
    # metres from the chest, x to the patient's left as seen by a camera in front, y down
    "head": (0.0, -0.33, 0.0),
    "neck": (0.0, -0.17, 0.0),
    "torso": (0.0, 0.08, 0.0),
    "left_shoulder": (0.18, -0.13, 0.0),
    "left_elbow": (0.47, -0.13, 0.0),
    "left_hand": (0.48, -0.45, 0.0),
    "left_hip": (0.10, 0.34, 0.0),
    "left_knee": (0.11, 0.76, 0.0),
    "left_foot": (0.12, 1.17, 0.0),
}


@pytest.fixture(scope="session")
def kinect_rig() -> CameraRig:
    return CameraRig(PinholeCamera(640, 480, 575.8, 575.8, 319.5, 239.5))


@pytest.fixture(scope="session")
def psi_points() -> dict[str, np.ndarray]:
    points = {name: np.array(place) for name, place in PSI.items()}
    for name, place in PSI.items():
        if name.startswith("left_"):
            points[name.replace("left_", "right_")] = np.array(place) * (-1, 1, 1)
    return {name: place + np.array([0.0, -0.2, 2.6]) for name, place in points.items()}


@pytest.fixture(scope="session")
def make_skeleton(kinect_rig: CameraRig) -> MakeSkeleton:
    """A skeleton from points; ``hidden`` joints have visibility 0.2."""

    def make(points: dict[str, np.ndarray], hidden: tuple[str, ...] = (), **more: object) -> Skeleton:
        joints = {}
        for name, point in points.items():
            p = np.asarray(point, dtype=float)
            seen = 0.2 if name in hidden else 0.95
            joints[name] = Joint(name, p, kinect_rig.project_to_picture(p)[0], seen, "relief")
        return Skeleton(joints, source="relief", **more)  # type: ignore[arg-type]

    return make


@pytest.fixture(scope="session")
def tracker() -> SkeletonTracker:
    from devices.trackers import default_tracker

    return default_tracker()


@pytest.fixture(scope="session")
def person() -> SimulatedPatient:
    return SimulatedPatient("m_young_avg", seed=1, moles=5, lesions=1, freckles=0, rig=make_rig((1280, 960)))


@pytest.fixture(scope="session")
def psi(person: SimulatedPatient) -> SimulatedCapture:
    return person.capture(stance="psi", view="front", frames=6, seed=3)


@pytest.fixture(scope="session")
def psi_scan(psi: SimulatedCapture) -> BodyScan:
    return scan_body(psi.capture)
