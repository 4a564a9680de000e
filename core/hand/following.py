"""Where a hand has gone since the marker was last seen: by the shape of its surface.

The surface of the last frame with a marker is laid onto the surface of this one (iterative closest points;
Besl and McKay 1992, Chen and Medioni 1991), beginning where the motion so far would have taken it. Its inner
points are drawn to the planes of the new surface, and may slide along them: a back of a hand is nearly flat.
Its outline is drawn to the new outline, which holds it. Fingers that have bent since weigh little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.capture.camera import PinholeCamera
from core.capture.transform import RigidTransform
from core.errors import WorkError
from core.hand.surface import cut_hand
from core.surface.body_surface import BodySurface

FloatArray = NDArray[np.float64]

_MOST_INNER, _MOST_RIM = 500, 250
REACH_M = 0.16
"""A hand's fingertips are nearer to the middle of its anchors."""

_BEHIND_M = 0.03
_GATES_M = (0.05, 0.05, 0.04, 0.04, 0.03, 0.03, 0.02, 0.02, 0.015, 0.015, 0.015, 0.015)
_SCALE_M = 0.006
_RIM_WEIGHT = 0.5
_LEAST = 30
_BEST = 0.65
_MOST_DISAGREEMENT_M = 0.0042


@dataclass(frozen=True, eq=False)
class LastSeen:
    """A hand as it was when its marker was last seen.

    Attributes
    ----------
    inner_m : ndarray (n, 3)
        Some of its surface.
    rim_m : ndarray (k, 3)
        Some of its outline, without that of the forearm.
    anchors_m : ndarray (a, 3)
    """

    inner_m: FloatArray
    rim_m: FloatArray
    anchors_m: FloatArray

    @classmethod
    def of(
        cls,
        surface: BodySurface,
        anchors_m: FloatArray,
        toward: FloatArray | None = None,
        reach_m: float = REACH_M,
    ) -> LastSeen:
        """Keep what lies within reach of the anchors.

        Parameters
        ----------
        surface : BodySurface
        anchors_m : ndarray (a, 3)
        toward : ndarray (3,), optional
            Direction to the fingers; the outline behind the anchors is the forearm's, which says nothing.
        reach_m : float
            From the middle of the anchors.
        """
        off = surface.vertices - np.nanmean(anchors_m, axis=0)
        near = (off**2).sum(axis=1) < reach_m**2
        inner = np.flatnonzero(near & ~surface.boundary)
        rim = near & surface.boundary
        if toward is not None:
            rim &= off @ (toward / np.linalg.norm(toward)) > -_BEHIND_M
        return cls(
            surface.vertices[_some(inner, _MOST_INNER)],
            surface.vertices[_some(np.flatnonzero(rim), _MOST_RIM)],
            anchors_m,
        )


def _some(rows: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    return rows[:: max(1, len(rows) // most)]


def follow(
    last: LastSeen, depth_m: FloatArray, camera: PinholeCamera, guesses: Sequence[RigidTransform]
) -> RigidTransform | None:
    """Motion ``now_from_then`` of the hand since it was last seen; None if the surface does not fit anywhere.

    Parameters
    ----------
    last : LastSeen
    depth_m : ndarray (h, w)
        Metres, 0 for no measurement.
    camera : PinholeCamera
    guesses : sequence of RigidTransform
        Motions that are expected, the likeliest first: a hand that is shaken turns back from one frame to
        the next. The one that leads to the best fit is taken.
    """
    now = None
    for guess in guesses:
        try:
            surface = cut_hand(depth_m, camera, guess.apply(last.anchors_m)).surface
        except WorkError:
            continue
        now = _Now(surface, cKDTree(surface.vertices), cKDTree(surface.vertices[surface.boundary]))
        break
    if now is None:
        return None
    found = []
    for guess in (*guesses, _same_middle(last, now, guesses[0])):
        motion = _laid_on(last, now, guess)
        if motion is not None:
            found.append((_disagreement(last, now, motion), motion))
    if not found:
        return None
    least, best = min(found, key=lambda one: one[0])
    return best if least < _MOST_DISAGREEMENT_M else None


def _same_middle(last: LastSeen, now: _Now, guess: RigidTransform) -> RigidTransform:
    """The guess, shifted so that the middles of both outlines fall together."""
    rim = guess.apply(last.rim_m) if len(last.rim_m) else guess.apply(last.inner_m)
    reach = np.linalg.norm(now.rim.data - rim.mean(axis=0), axis=1) < REACH_M
    if not reach.any():
        return guess
    shift = now.rim.data[reach].mean(axis=0) - rim.mean(axis=0)
    return RigidTransform(guess.rotation, guess.translation + shift)


def _laid_on(last: LastSeen, now: _Now, guess: RigidTransform) -> RigidTransform | None:
    motion = guess
    for gate in _GATES_M:
        step = _step(last, now, motion, gate)
        if step is None:
            return None
        motion = step
    return motion


@dataclass(frozen=True, eq=False)
class _Now:
    """The surface of this frame, to be searched."""

    surface: BodySurface
    every: cKDTree
    rim: cKDTree


def _step(last: LastSeen, now: _Now, motion: RigidTransform, gate_m: float) -> RigidTransform | None:
    """One Gauss-Newton step of the robust distances; None if too little is near."""
    inner, rim = motion.apply(last.inner_m), motion.apply(last.rim_m)
    far, nearest = now.every.query(inner, distance_upper_bound=gate_m)
    good = np.isfinite(far)
    if good.sum() < _LEAST:
        return None
    normals = now.surface.normals[nearest[good]]
    off = ((now.surface.vertices[nearest[good]] - inner[good]) * normals).sum(axis=1)
    centre = inner.mean(axis=0)
    rows = [np.hstack([np.cross(inner[good] - centre, normals), normals])]
    wanted, weight = [off], [1.0 / (1.0 + (off / _SCALE_M) ** 2)]
    far, nearest = now.rim.query(rim, distance_upper_bound=gate_m)
    good = np.isfinite(far)
    if good.any():
        gap = now.rim.data[nearest[good]] - rim[good]
        share = _RIM_WEIGHT / (1.0 + (far[good] / _SCALE_M) ** 2)
        for axis in np.eye(3):
            along = np.broadcast_to(axis, gap.shape)
            rows.append(np.hstack([np.cross(rim[good] - centre, along), along]))
            wanted.append(gap @ axis)
            weight.append(share)
    matrix, right, w = np.vstack(rows), np.concatenate(wanted), np.concatenate(weight)
    normal = (matrix * w[:, None]).T @ matrix
    # what the data do not say stays as it was
    normal += np.diag([1e-5] * 3 + [1e-2] * 3) * len(inner)
    change = np.linalg.solve(normal, matrix.T @ (w * right))
    turn = _rotation(change[:3])
    rotation = turn @ motion.rotation
    return RigidTransform(rotation, turn @ (motion.translation - centre) + centre + change[3:])


def _rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrix (3, 3) of a rotation vector."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix())


def _disagreement(last: LastSeen, now: _Now, motion: RigidTransform) -> float:
    """Mean distance of the hand's surface and outline from the new ones.

    A hand that turns shows other parts of itself, and something may be before it: a third counts nothing.
    """
    parts = [_of_the_best(now.every.query(motion.apply(last.inner_m))[0])]
    if len(last.rim_m):
        parts.append(_of_the_best(now.rim.query(motion.apply(last.rim_m))[0]))
    return float(np.mean(parts))


def _of_the_best(distances: FloatArray) -> float:
    """Mean of the nearest two thirds."""
    return float(np.sort(distances)[: max(1, round(_BEST * len(distances)))].mean())


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
