"""How far a lifted joint may be from the true joint centre: a covariance per joint.

Two directions err for different reasons. Across the picture it is the landmark: how well that kind of joint
is found at all, and how far several looks at this one differ. Along the line of sight it is the depth: noise
and slope of the patch, another limb's layer in the same patch, and how deep under the skin this joint is.

The shares of the kinds were learned on 22 rendered captures of seven people and checked on 22 captures of
seven others (fronts and backs, ten stances); they include what tracker and simulator define differently.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class KindSigma:
    """Root mean square errors of a kind of joint, metres: along one axis across the picture, and in depth."""

    across_m: float
    depth_m: float


KIND_SIGMA: Final[dict[str, KindSigma]] = {
    "head": KindSigma(0.022, 0.020),
    "neck": KindSigma(0.022, 0.036),
    "torso": KindSigma(0.064, 0.057),
    "shoulder": KindSigma(0.017, 0.033),
    "elbow": KindSigma(0.010, 0.017),
    "hand": KindSigma(0.020, 0.034),
    "hip": KindSigma(0.015, 0.025),
    "knee": KindSigma(0.024, 0.016),
    "foot": KindSigma(0.018, 0.021),
}
"""A `torso` that lies between shoulders and hips is another place than the simulator's. Hands are meant
without the few that are wholly wrong: those show in the spread of the looks."""

SKIN_SIGMA: Final = KindSigma(0.018, 0.015)
"""Landmarks on the skin; the simulator has no truth for them: as the better joints."""

RELIEF_FACTOR: Final = 1.4
"""A relief shows less than a photo (METHOD section 4 and the measurement above)."""

SPREAD_FACTOR: Final = 1.5
"""Two looks differ less than both differ from the truth."""

CALIBRATED: Final = 0.9
"""The parts overlap a little: with this factor 95 % ellipsoids hold 95-97 % of the joints."""

HAND_SIGMA: Final = KindSigma(0.008, 0.015)
"""A joint placed by hand: the doctor's aim across the picture, the body's thickness in depth."""

OTHER_LAYER: Final = 0.15
"""Weight of the other limb's layer under a landmark, per share of the patch that it covers."""


def kind_of(name: str) -> str:
    """The kind of a joint: its name without the side."""
    return name.removeprefix("left_").removeprefix("right_")


def landmark_sigma_m(name: str, *, relief: bool) -> KindSigma:
    """What is known of a joint before looking at this capture."""
    kind = KIND_SIGMA.get(kind_of(name), SKIN_SIGMA)
    factor = RELIEF_FACTOR if relief else 1.0
    return KindSigma(kind.across_m * factor, kind.depth_m * factor)


def along_ray(ray: FloatArray, across_m: float, depth_m: float) -> FloatArray:
    """Covariance (3, 3) of a point found with these spreads across and along a ray.

    Parameters
    ----------
    ray : ndarray (3,)
        From the camera to the point, any length.
    across_m, depth_m : float
        Standard deviations.
    """
    unit = ray / np.linalg.norm(ray)
    line = np.outer(unit, unit)
    return np.asarray(across_m**2 * (np.eye(3) - line) + depth_m**2 * line)


def lifted_covariance(
    name: str,
    ray: FloatArray,
    *,
    visibility: float,
    spread_m: float,
    patch_m: float,
    ambiguity_m: float,
    relief: bool,
) -> FloatArray:
    """Covariance (3, 3) of a joint lifted from a landmark.

    Parameters
    ----------
    name : str
    ray : ndarray (3,)
        From the camera to the joint.
    visibility : float
        0 to 1; a joint half seen is twice as uncertain.
    spread_m : float
        Standard deviation between the looks, across the picture.
    patch_m : float
        Standard deviation of the depth under the landmark: noise and slope.
    ambiguity_m : float
        Root of the expected square of taking the other layer.
    relief : bool
        Found in the relief of the depth.
    """
    kind = landmark_sigma_m(name, relief=relief)
    doubt = CALIBRATED / min(max(visibility, 0.2), 1.0)
    across = doubt * np.hypot(kind.across_m, SPREAD_FACTOR * spread_m)
    depth = doubt * np.sqrt(kind.depth_m**2 + patch_m**2 + ambiguity_m**2)
    return along_ray(ray, float(across), float(depth))


def hand_covariance(name: str, ray: FloatArray) -> FloatArray:
    """Covariance (3, 3) of a joint placed by hand in the picture."""
    depth = min(HAND_SIGMA.depth_m, landmark_sigma_m(name, relief=False).depth_m)
    return along_ray(ray, HAND_SIGMA.across_m, depth)
