"""Trackers that follow a person in a depth stream by themselves, instead of reading a picture.

They open the camera or the recording on their own, need time to calibrate, and answer with joints in space.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.anchors.names import JOINT_NAMES, opposite
from core.anchors.skeleton import Joint, JointSource, Skeleton
from core.capture.rgbd import CameraRig

FloatArray = NDArray[np.float64]


class TrackingState(Enum):
    """How far a depth tracker is with a person."""

    NOBODY = "nobody"
    CALIBRATING = "calibrating"
    TRACKING = "tracking"


@dataclass(frozen=True, eq=False)
class TrackedPerson:
    """What a depth tracker knows at one moment.

    Attributes
    ----------
    state : TrackingState
    say : str
        What to tell the patient now; empty while tracking.
    points_m : mapping of str to ndarray (3,)
        Joints in the depth-camera frame (x right, y down, z away), names of `names.JOINT_NAMES`.
    confidence : mapping of str to float
        0 to 1, for each joint.
    time_s : float
        Of the depth frame, on the source's clock.
    """

    state: TrackingState
    say: str = ""
    points_m: Mapping[str, FloatArray] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)
    time_s: float = 0.0


class DepthTracker(Protocol):
    """Follows a person in a depth stream."""

    @property
    def name(self) -> str:
        """For people and for records."""

    def start(self, source: str = "") -> None:
        """Open a device (its URI), a recording (its path), or the first camera there is (empty).

        Raises
        ------
        WorkError
            If the tracker's runtime or the source is missing, with what was tried.
        """

    def read(self, timeout_s: float = 2.0) -> TrackedPerson:
        """The next moment.

        Raises
        ------
        WorkError
            If no frame comes in time, or the runtime crashed.
        """

    def close(self) -> None:
        """Release everything. Closing twice does nothing."""


def tracked_skeleton(person: TrackedPerson, rig: CameraRig, *, view: str, source: JointSource) -> Skeleton:
    """Skeleton of what a depth tracker saw.

    A depth tracker takes everybody for somebody who faces it. The side of the body that the user chose says
    what is left: facing the camera, the left shoulder is on the right of the picture. Nothing is known of the
    errors of its joints, so they have no covariance.

    Parameters
    ----------
    person : TrackedPerson
    rig : CameraRig
    view : str
        front, back, left or right; for the profiles the tracker's own sides stand, with a warning.
    source : JointSource
    """
    points = dict(person.points_m)
    confidence = dict(person.confidence)
    warnings: tuple[str, ...] = ()
    if view in ("front", "back"):
        if _exchanged(points, facing=view == "front"):
            points = {opposite(name): point for name, point in points.items()}
            confidence = {opposite(name): value for name, value in confidence.items()}
    else:
        warnings = ("The tracker expects a patient who faces it: check left and right of the joints.",)
    joints = {}
    for name in JOINT_NAMES:
        if name in points and np.isfinite(points[name]).all():
            pixel = rig.project_to_picture(points[name])[0]
            inside = bool(rig.picture_camera.contains(pixel)[0])
            joints[name] = Joint(
                name, points[name], pixel, confidence.get(name, 0.0) if inside else 0.0, source
            )
    return Skeleton(joints, source=source, warnings=warnings)


def _exchanged(points: Mapping[str, FloatArray], *, facing: bool) -> bool:
    """Whether the shoulders (else the hips) stand the wrong way round for a person who faces the camera."""
    for part in ("shoulder", "hip"):
        left, right = points.get(f"left_{part}"), points.get(f"right_{part}")
        if left is not None and right is not None:
            return bool((left[0] > right[0]) != facing)
    return False
