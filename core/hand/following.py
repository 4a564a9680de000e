"""Where a hand has gone since the marker was last seen: by the shape of its surface.

The surface of the last frame with a marker is laid onto the depth image of this one (projective point-to-
plane registration; Chen and Medioni 1991, Blais and Levine 1995), beginning where the motion so far would
have taken it. Fingers that have bent since weigh little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from core.surface.body_surface import BodySurface

FloatArray = NDArray[np.float64]

_MOST_POINTS = 900
_GATES_M = (0.04, 0.04, 0.03, 0.03, 0.02, 0.02, 0.012, 0.012, 0.012, 0.012)
_STARTS_M = (0.0, 0.02)
_SCALE_M = 0.004
_LEAST_SHARE = 0.45
_MOST_RESIDUAL_M = 0.005


@dataclass(frozen=True, eq=False)
class LastSeen:
    """A hand as it was when its marker was last seen.

    Attributes
    ----------
    points_m, normals : ndarray (n, 3)
        Some of its surface.
    anchors_m : ndarray (a, 3)
    """

    points_m: FloatArray
    normals: FloatArray
    anchors_m: FloatArray

    @classmethod
    def of(cls, surface: BodySurface, anchors_m: FloatArray, reach_m: float = 0.13) -> LastSeen:
        """Keep what lies within reach of the anchors."""
        centre = np.nanmean(anchors_m, axis=0)
        near = np.flatnonzero(
            (((surface.vertices - centre) ** 2).sum(axis=1) < reach_m**2) & ~surface.boundary
        )
        some = near[:: max(1, len(near) // _MOST_POINTS)]
        return cls(surface.vertices[some], surface.normals[some], anchors_m)


def follow(
    last: LastSeen, depth_m: FloatArray, camera: PinholeCamera, guess: RigidTransform
) -> RigidTransform | None:
    """Motion ``now_from_then`` of the hand since it was last seen; None if the surface does not fit anywhere.

    Parameters
    ----------
    last : LastSeen
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    camera : PinholeCamera
    guess : RigidTransform
        Motion that is expected.
    """
    best: tuple[float, RigidTransform] | None = None
    for start in _starts(guess):
        motion = start
        for gate in _GATES_M:
            matched = _match(last, depth_m, camera, motion, gate)
            if matched is None:
                break
            motion = _step(*matched[:3], motion)
        else:
            matched = _match(last, depth_m, camera, motion, _GATES_M[-1])
            if matched is not None and matched[3] >= _LEAST_SHARE:
                residual = float(np.median(np.abs(matched[2])))
                if residual < _MOST_RESIDUAL_M and (best is None or residual < best[0]):
                    best = residual, motion
        if best is not None and start is guess:
            break
    return None if best is None else best[1]


def _starts(guess: RigidTransform) -> list[RigidTransform]:
    """The guess, and places beside it that are tried if it leads nowhere."""
    found = [guess]
    for axis in (0, 1, 2):
        for sign in (-1.0, 1.0):
            shift = np.zeros(3)
            shift[axis] = sign * _STARTS_M[1]
            found.append(RigidTransform(guess.rotation, guess.translation + shift))
    return found


def _match(
    last: LastSeen, depth_m: FloatArray, camera: PinholeCamera, motion: RigidTransform, gate_m: float
) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Moved points, their normals and their distances to the surface of now, and the share that has one."""
    points = motion.apply(last.points_m)
    normals = last.normals @ motion.rotation.T
    pixels = camera.project(points)
    inside = np.isfinite(pixels).all(axis=1)
    u, v = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(np.int64).T
    inside &= (u >= 0) & (v >= 0) & (u < camera.width) & (v < camera.height)
    u, v = np.where(inside, u, 0), np.where(inside, v, 0)
    z = depth_m[v, u]
    rays = camera.pixel_rays[v, u]
    off = ((rays * z[:, None] - points) * normals).sum(axis=1)
    good = inside & (z > 0) & (np.abs(z - points[:, 2]) < 2 * gate_m) & (np.abs(off) < gate_m)
    share = float(good.mean())
    if good.sum() < 30:
        return None
    return points[good], normals[good], off[good], share


def _step(points: FloatArray, normals: FloatArray, off: FloatArray, motion: RigidTransform) -> RigidTransform:
    """One Gauss-Newton step of the robust point-to-plane distance."""
    centre = points.mean(axis=0)
    rows = np.hstack([np.cross(points - centre, normals), normals])
    weight = 1.0 / (1.0 + (off / _SCALE_M) ** 2)
    normal = (rows * weight[:, None]).T @ rows
    # a back of a hand can slide in its plane: what the data do not say stays as it was
    normal += np.diag([1e-5, 1e-5, 1e-5, 1e-2, 1e-2, 1e-2]) * len(rows)
    change = np.linalg.solve(normal, rows.T @ (weight * off))
    angle = float(np.linalg.norm(change[:3]))
    turn = np.eye(3)
    if angle > 1e-12:
        axis = change[:3] / angle
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    rotation = turn @ motion.rotation
    translation = turn @ (motion.translation - centre) + centre + change[3:]
    return RigidTransform(rotation, translation)


def motion_between(before_m: FloatArray, after_m: FloatArray) -> RigidTransform:
    """Rigid motion ``after_from_before`` of anchors (a, 3) (Kabsch 1976); NaN rows do not count."""
    known = np.isfinite(before_m).all(axis=1) & np.isfinite(after_m).all(axis=1)
    if known.sum() < 3:
        return RigidTransform()
    p, q = before_m[known], after_m[known]
    left, _, right = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    rotation = left @ flip @ right
    return RigidTransform(rotation, q.mean(axis=0) - rotation @ p.mean(axis=0))
