"""Slopes of distance fields in the tangent plane of a skin point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FIT_RADIUS_M = 0.025
"""Skin this near a point counts for the slope there: several depth pixels, less than a wrist."""


@dataclass(frozen=True, eq=False)
class TangentSlopes:
    """First-order model of several fields around one point.

    Attributes
    ----------
    basis : ndarray (2, 3)
        Orthonormal tangent vectors.
    slopes : ndarray (a, 2)
        Change of each field per metre along the basis; NaN where a field is not finite around the point.
    """

    basis: FloatArray
    slopes: FloatArray


def tangent_basis(normal: FloatArray) -> FloatArray:
    """Two orthonormal vectors (2, 3) perpendicular to a normal (3,)."""
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, helper)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first) / np.linalg.norm(normal)])


def tangent_slopes(
    distances: NDArray[np.floating],
    vertices: FloatArray,
    normals: FloatArray,
    vertex: int,
    radius_m: float = FIT_RADIUS_M,
) -> TangentSlopes:
    """Least-squares slopes of fields (a, n) at a vertex from the skin around it.

    The distance to an anchor has slope 1 away from it; noise and the rim make it less, so slopes are only
    shortened to 1, never stretched.
    """
    offset = vertices - vertices[vertex]
    box = (np.abs(offset) < radius_m).all(axis=1)
    near = np.flatnonzero(box)
    near = near[np.linalg.norm(offset[near], axis=1) < radius_m]
    near = near[normals[near] @ normals[vertex] > 0.2]
    basis = tangent_basis(normals[vertex])
    flat = offset[near] @ basis.T
    out = np.full((len(distances), 2), np.nan)
    if len(near) < 6:
        return TangentSlopes(basis, out)
    design = np.column_stack([flat, np.ones(len(near))])
    values = distances[:, near].astype(float)
    whole = np.isfinite(values).all(axis=1)
    if whole.any():
        solution = np.linalg.lstsq(design, values[whole].T, rcond=None)[0]
        slopes = solution[:2].T
        out[whole] = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1.0)
    return TangentSlopes(basis, out)
