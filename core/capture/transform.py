"""Rigid transforms between camera frames, named ``target_from_source``."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """Rotation and translation: ``x_target = rotation @ x_source + translation`` (metres).

    Attributes
    ----------
    rotation : ndarray (3, 3)
        Proper rotation matrix.
    translation : ndarray (3,)
        Metres.
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> RigidTransform:
        """Transform from a homogeneous 4x4 matrix.

        Raises
        ------
        InputError
            If the matrix is not 4x4 and finite, or its rotation part is not a proper rotation (within 1e-3).
        """
        m = np.asarray(matrix, dtype=float)
        if m.shape != (4, 4) or not np.isfinite(m).all():
            raise InputError("A rigid transform must be a finite 4x4 matrix.")
        r = m[:3, :3]
        if np.abs(r @ r.T - np.eye(3)).max() > 1e-3 or np.linalg.det(r) < 0:
            raise InputError("The rotation part of a rigid transform is not a rotation.")
        if np.abs(m[3] - (0, 0, 0, 1)).max() > 1e-6:
            raise InputError("The last row of a rigid transform must be 0 0 0 1.")
        u, _, vt = np.linalg.svd(r)
        return cls(u @ vt, m[:3, 3].copy())

    @property
    def matrix(self) -> FloatArray:
        """The homogeneous 4x4 matrix."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.rotation, self.translation
        return m

    def apply(self, points: ArrayLike) -> FloatArray:
        """Points (..., 3) of the source frame in the target frame."""
        return np.asarray(np.asarray(points, dtype=float) @ self.rotation.T + self.translation)

    def rotate(self, vectors: ArrayLike) -> FloatArray:
        """Directions (..., 3) of the source frame in the target frame."""
        return np.asarray(np.asarray(vectors, dtype=float) @ self.rotation.T)

    def inverse(self) -> RigidTransform:
        """``source_from_target``."""
        return RigidTransform(self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: RigidTransform) -> RigidTransform:
        """``a_from_b @ b_from_c`` is ``a_from_c``."""
        return RigidTransform(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )
