"""How far an answer may be off: spreads learned on calibration patients, and regions of 95 %.

The raw spread of an answer is made of what is known of it: whether its spot was seen again, how far matched
spots are away, how far the place was carried off the seen skin, how it faces the camera. Conformal
calibration per stance class and body part then finds the factor with which 95 % of the calibration lesions
lie inside (BENCHMARKS: the stated radius holds for 93 to 97 %). The bodies and stances of the calibration
appear in no accuracy table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import PART_OF_BONE, Bone, Part
from core.relocation.tangent import tangent_basis
from core.relocation.types import Region

FloatArray = NDArray[np.float64]

SEEN_M = 0.0035
"""Spread per axis of a spot that was seen again: depth in both visits and its own centre."""
PIXEL_SHARE = 0.5
"""Share of a picture pixel by which a spot's centre errs: it counts with coarse pictures."""
CARRIED_M: dict[Part, tuple[float, float]] = {
    "head": (0.006, 0.008),
    "trunk": (0.004, 0.006),
    "upper arm": (0.005, 0.012),
    "forearm": (0.005, 0.016),
    "thigh": (0.003, 0.005),
    "lower leg": (0.003, 0.005),
}
"""Spread per axis that the registration leaves on a body part, in the same stance and in another."""
OFF_SHARE = 1.0
"""How much of the distance from the seen skin adds to the spread."""
ROUND_LIMB = 1.5
"""A limb rolls about its axis more easily than it slides along it: ratio of the two spreads."""
NORMAL_95 = 2.448
"""Radius that holds 95 % of a round normal law in two dimensions, in standard deviations."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Spread of an answer along the skin.

    Attributes
    ----------
    basis : ndarray (2, 3)
        Tangent directions: the first one around the limb, the second along it.
    sigma_m : (float, float)
        Standard deviations in these directions.
    """

    basis: FloatArray
    sigma_m: tuple[float, float]

    @property
    def mean_m(self) -> float:
        """One number for both directions."""
        return float(np.sqrt(0.5 * (self.sigma_m[0] ** 2 + self.sigma_m[1] ** 2)))

    def covariance(self) -> FloatArray:
        """In the basis (2, 2)."""
        return np.diag(np.square(self.sigma_m))


def body_part(bone: Bone) -> Part:
    """The part of the body that a bone carries."""
    return PART_OF_BONE[bone.name.replace("left_", "").replace("right_", "")]


def skin_basis(normal: FloatArray, part: Part, bone: Bone) -> FloatArray:
    """Tangent directions (2, 3) around and along a limb; any on trunk and head."""
    axis = bone.rotation @ (bone.end - bone.start)
    along = axis - normal * (axis @ normal)
    size = float(np.linalg.norm(along))
    if part in ("trunk", "head") or size < 0.2 * float(np.linalg.norm(axis)):
        return tangent_basis(normal)
    along = along / size
    return np.stack([np.cross(along, normal), along])


def carried_spread(
    part: Part, other_stance: bool, process_m: float, off_m: float, cosine: float, basis: FloatArray
) -> Spread:
    """Spread of a place that was carried and not seen.

    Parameters
    ----------
    process_m : float
        Standard deviation of the drift process there (`core.relocation.constellation`).
    off_m : float
        How far it was carried off the seen skin.
    cosine : float
        Of its normal with the way to the camera: steep skin is measured worse.
    """
    base = CARRIED_M[part][int(other_stance)]
    steep = 1.0 / float(np.clip(cosine, 0.3, 1.0))
    size = float(np.sqrt((base * steep) ** 2 + process_m**2 + (OFF_SHARE * off_m) ** 2))
    stretch = np.sqrt(ROUND_LIMB) if part not in ("trunk", "head") else 1.0
    return Spread(basis, (size * stretch, size / stretch))


def region_of(basis: FloatArray, covariance: FloatArray, factor: float) -> tuple[Region, float]:
    """The 95 % ellipse of a normal law (2, 2) in a tangent basis, times a factor, and its radius."""
    values, vectors = np.linalg.eigh(covariance)
    small, large = (factor * NORMAL_95 * float(np.sqrt(max(v, 1e-10))) for v in values)
    direction = vectors[:, 1] @ basis
    return Region((large, small), direction / np.linalg.norm(direction)), large
