"""Anchors of trilateration: joints moved to the nearest point of the skin (thesis, chapter 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors.lifting import interior_m
from core.anchors.names import JOINT_NAMES
from core.anchors.skeleton import VISIBLE, Joint, Skeleton
from core.surface import BodySurface, SurfacePoint

FloatArray = NDArray[np.float64]

SIGMA_M: Final[dict[str, float]] = {
    "head": 0.050,
    "neck": 0.030,
    "torso": 0.050,
    "shoulder": 0.030,
    "elbow": 0.040,
    "hand": 0.070,
    "hip": 0.025,
    "knee": 0.025,
    "foot": 0.010,
}
"""a_i of METHOD section 3: what an anchor's own place adds to the spread of a geodesic distance.

Learned on simulated visit pairs with 15 mm of joint noise (left and right pooled, the larger kept).
"""

EXTRA_SIGMA_M: Final = 0.035
"""For landmarks on the skin, which were not part of that study."""

REACH_M: Final = 0.12
"""A joint farther than this from the skin (beyond its own depth inside) makes no reliable anchor."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """One anchor on the skin.

    Attributes
    ----------
    name : str
    point : SurfacePoint
    position_m : ndarray (3,)
        Depth-camera frame.
    sigma_m : float
        Spread it brings into geodesic distances; grows as visibility falls.
    reliable : bool
        Seen, and near the skin.
    """

    name: str
    point: SurfacePoint
    position_m: FloatArray
    sigma_m: float
    reliable: bool


@dataclass(frozen=True, eq=False)
class AnchorSet:
    """The anchors of one capture.

    Attributes
    ----------
    anchors : tuple of Anchor
        From the joints, in the order of `names.JOINT_NAMES`.
    extra : tuple of Anchor
        From the landmarks beyond the 15 joints.
    """

    anchors: tuple[Anchor, ...]
    extra: tuple[Anchor, ...] = ()

    def reliable(self) -> AnchorSet:
        """Only the anchors one may trust."""
        return AnchorSet(
            tuple(a for a in self.anchors if a.reliable), tuple(a for a in self.extra if a.reliable)
        )

    def as_mapping(self) -> Mapping[str, SurfacePoint]:
        """Name to point on the skin, joints only: what `core.geodesics.geodesic_fields` takes."""
        return {a.name: a.point for a in self.anchors}

    def sigmas_m(self) -> FloatArray:
        """Spread of every anchor (a,)."""
        return np.array([a.sigma_m for a in self.anchors])

    def __len__(self) -> int:
        return len(self.anchors)

    def __getitem__(self, name: str) -> Anchor:
        for anchor in (*self.anchors, *self.extra):
            if anchor.name == name:
                return anchor
        raise KeyError(name)


def anchor_sigma_m(name: str, visibility: float) -> float:
    """Spread of an anchor, from its kind and how well its joint is seen (doubled at visibility 0.5)."""
    kind = name.removeprefix("left_").removeprefix("right_")
    base = SIGMA_M.get(kind, EXTRA_SIGMA_M) if name in JOINT_NAMES else EXTRA_SIGMA_M
    return base / max(visibility, 0.1) if visibility < 1.0 else base


def project_to_skin(skeleton: Skeleton, surface: BodySurface) -> AnchorSet:
    """Move every joint and extra landmark to the nearest point of the surface.

    Joints that are not visible are kept, marked unreliable.
    """

    def anchors(joints: Mapping[str, Joint]) -> tuple[Anchor, ...]:
        if not joints:
            return ()
        places = np.array([joint.point_m for joint in joints.values()])
        return tuple(
            _anchor(joint, point)
            for joint, point in zip(joints.values(), surface.nearest(places), strict=True)
        )

    return AnchorSet(anchors(skeleton.joints), anchors(skeleton.landmarks))


def _anchor(joint: Joint, point: SurfacePoint) -> Anchor:
    gap = float(np.linalg.norm(point.position_m - joint.point_m))
    reliable = joint.visibility >= VISIBLE and gap < REACH_M + interior_m(joint.name)
    sigma = anchor_sigma_m(joint.name, joint.visibility)
    if joint.source == "hand" and joint.sigma_m is not None:
        sigma = min(sigma, joint.sigma_m)
    return Anchor(joint.name, point, point.position_m, sigma, reliable)
