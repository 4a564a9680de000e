"""What to correct of the stance, from live joints: the psi check of the calibration at preview rate.

The joints are lifted to space by the depth under them, plainly: no surface is built. That is enough for
advice to a person; the capture is checked with the full method.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors import EXTRA_NAMES, JOINT_NAMES, Joint, Skeleton, check_psi
from core.guidance.moment import Moment
from core.guidance.person import Person
from core.guidance.readings import Reading, unknown

FloatArray = NDArray[np.float64]

_PATCH: Final = 2


def live_skeleton(moment: Moment, person: Person) -> Skeleton | None:
    """Joints in space: as the live skeleton lifted them, else by the coarse depth; None without one."""
    pose = moment.pose
    if pose is None:
        return None
    depth = np.where(person.mask, moment.depth_m, 0.0)
    found = {}
    for name, seen in pose.joints.items():
        if name in JOINT_NAMES or name in EXTRA_NAMES:
            point = seen.point_m
            if point is None:
                point = _lift(seen.pixel, depth, moment, person.distance_m)
            found[name] = Joint(name, point, seen.pixel, seen.visibility, pose.source)
    return Skeleton(
        {name: joint for name, joint in found.items() if name in JOINT_NAMES},
        {name: joint for name, joint in found.items() if name in EXTRA_NAMES},
    )


def stance_reading(moment: Moment, person: Person | None, *, whole_body: bool = True) -> Reading:
    """Compare the live skeleton with the psi stance; the value is the number of corrections."""
    skeleton = None if person is None else live_skeleton(moment, person)
    if skeleton is None:
        return unknown("stance")
    report = check_psi(skeleton, whole_body=whole_body)
    if report.ok:
        return Reading("stance", 0.0, "", "good")
    return Reading("stance", float(len(report.corrections)), "", "bad", report.corrections[0])


def _lift(pixel: FloatArray, depth: FloatArray, moment: Moment, usual_m: float) -> FloatArray:
    """The point on the ray of a picture pixel at the depth found there, or the person's where there is none.

    The shift between the two cameras is taken at the person's distance, then once more at the depth found.
    """
    origin, rays = moment.rig.picture_rays(pixel[None])
    z = usual_m
    for _ in range(2):
        point = origin + rays[0] * (z - origin[2]) / max(float(rays[0, 2]), 1e-6)
        (u, v) = np.rint(moment.camera.project(point[None])[0])
        if not np.isfinite((u, v)).all():
            break
        row, column = int(v), int(u)
        patch = depth[
            max(row - _PATCH, 0) : max(row + _PATCH + 1, 0),
            max(column - _PATCH, 0) : max(column + _PATCH + 1, 0),
        ]
        measured = patch[patch > 0]
        if not len(measured):
            break
        z = float(np.percentile(measured, 25))
    return np.asarray(origin + rays[0] * (z - origin[2]) / max(float(rays[0, 2]), 1e-6))
