"""From a trilaterated place to what is told: radius, ellipse, confidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.relocation.tangent import tangent_basis
from core.relocation.trilateration import Fix
from core.relocation.types import Region

FloatArray = NDArray[np.float64]

RADIUS_SCALE = 1.25
RADIUS_FLOOR_M = 0.012
"""Calibrated on the tuning pairs of the simulated patient (three bodies, six changes of stance, tracked
joints): about 95 % of errors lie within ``RADIUS_FLOOR_M + RADIUS_SCALE * spread``.

Real skin may do worse."""

HIGHEST_CONFIDENCE = 0.9
"""Geometry alone never earns more."""


def radius95_m(fix: Fix) -> float:
    """Radius that holds the truth in 95 % of cases."""
    return RADIUS_FLOOR_M + RADIUS_SCALE * fix.spread_m


def confidence(fix: Fix) -> float:
    """Belief 0..1 that this is the place: posterior mass near it times the share of anchors that agree."""
    return float(np.clip(fix.mass * (0.4 + 0.6 * fix.inliers / max(fix.used, 1)), 0.0, HIGHEST_CONFIDENCE))


def skin_region(fix: Fix, normal: FloatArray) -> Region:
    """Ellipse in the tangent plane whose long axis is the stated radius."""
    basis = tangent_basis(normal)
    values, vectors = np.linalg.eigh(basis @ fix.covariance @ basis.T)
    ratio = float(np.sqrt(max(values[0], 0.0) / max(values[1], 1e-12)))
    long_axis = radius95_m(fix)
    direction = vectors[:, 1] @ basis
    return Region((long_axis, max(ratio * long_axis, RADIUS_FLOOR_M)), direction / np.linalg.norm(direction))
