"""What NiTE2 says of a person, in the application's words: joints, axes, calibration states.

NiTE2's world is in millimetres with y up; its left and right are those of a person facing the camera.
Works on the structures of the binding (``primesense._nite2``), without the runtime.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.tracked import TrackedPerson, TrackingState
from core.capture.camera import PinholeCamera

FloatArray = NDArray[np.float64]

NITE_JOINTS: Final[tuple[str, ...]] = (
    "head",
    "neck",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_hand",
    "right_hand",
    "torso",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_foot",
    "right_foot",
)
"""Names in the order of NiteJointType 0..14."""

_TRACKED: Final = 2
_CALIBRATING: Final = 1
_FIRST_ERROR: Final = 3
_LOST: Final = 4
_MICROSECONDS: Final = 1e-6

SAY: Final[dict[int, str]] = {
    0: "Stand in front of the camera.",
    1: "Hold the psi stance: the skeleton is being calibrated.",
    3: "Take the psi stance: upper arms level to the sides, forearms raised.",
    4: "Raise both forearms: the calibration does not see the hands.",
    5: "Stand so that the head is in the picture: the calibration does not see it.",
    6: "Step back: the calibration does not see the legs.",
    7: "Turn to face the camera: the calibration does not see the trunk.",
}
"""What to tell the patient in each NiteSkeletonState but TRACKED."""


def nite_points_m(
    positions_mm: FloatArray, camera: PinholeCamera, nominal: PinholeCamera | None = None
) -> FloatArray:
    """Points (n, 3) in the depth-camera frame (metres, y down) from NiTE2's positions (n, 3).

    Parameters
    ----------
    positions_mm : ndarray (n, 3)
        x right, y up, z away.
    camera : PinholeCamera
        The calibrated depth camera.
    nominal : PinholeCamera, optional
        The ideal camera by which the runtime made its world from pixels (field of view, centred). The pixel
        is then read again through the calibrated camera, so that joints and depth agree.
    """
    points = np.asarray(positions_mm, dtype=float).reshape(-1, 3) * (1e-3, -1e-3, 1e-3)
    if nominal is None:
        return np.asarray(points)
    pixels = nominal.project(points)
    share = np.array([camera.width / nominal.width, camera.height / nominal.height])
    return np.asarray(camera.rays((pixels + 0.5) * share - 0.5) * points[:, 2:3])


def person_of(
    users: Iterable[Any], time_us: int, camera: PinholeCamera, nominal: PinholeCamera | None = None
) -> TrackedPerson:
    """The person who matters among NiteUserData structures: a tracked one first, then the nearest."""
    seen = [user for user in users if not int(user.state) & _LOST]
    time_s = time_us * _MICROSECONDS
    if not seen:
        return TrackedPerson(TrackingState.NOBODY, SAY[0], time_s=time_s)
    user = min(seen, key=lambda u: (_state(u) != _TRACKED, float(u.centerOfMass.z)))
    if _state(user) != _TRACKED:
        return TrackedPerson(
            TrackingState.CALIBRATING, SAY.get(_state(user), SAY[_FIRST_ERROR]), time_s=time_s
        )
    raw = {int(_number(j.jointType)): j for j in user.skeleton.joints}
    rows = sorted(k for k in raw if k < len(NITE_JOINTS))
    where = np.array([[getattr(raw[k].position, axis) for axis in "xyz"] for k in rows])
    confidence = {NITE_JOINTS[k]: float(np.clip(raw[k].positionConfidence, 0.0, 1.0)) for k in rows}
    points = nite_points_m(where, camera, nominal)
    placed = {NITE_JOINTS[k]: p for k, p in zip(rows, points, strict=True) if p[2] > 0}
    return TrackedPerson(TrackingState.TRACKING, "", placed, confidence, time_s)


def wants_start(user: Any) -> bool:
    """Whether skeleton tracking has to be asked for: of a new user, or after a failed calibration."""
    return not int(user.state) & _LOST and (_state(user) == 0 or _state(user) >= _FIRST_ERROR)


def _state(user: Any) -> int:
    return _number(user.skeleton.state)


def _number(value: Any) -> int:
    """Value of the binding's enumerations, which are ctypes integers."""
    return int(getattr(value, "value", value))
