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
    "head": 0.020,
    "neck": 0.009,
    "torso": 0.009,
    "shoulder": 0.015,
    "elbow": 0.014,
    "hand": 0.013,
    "hip": 0.017,
    "knee": 0.009,
    "foot": 0.010,
}
"""a_i of METHOD section 3: what an anchor's own place adds to the spread of a geodesic distance.

Measured with this application's own joints on 86 captures of 43 simulated pairs (10 calibration bodies and 3
tuning bodies, no test body; Kinect v1, 30 frames): how far, per axis of the skin, an anchor of the follow-up
lies from the skin that it lay on before. The scale is the most likely one of a Student-t law with the three
degrees of freedom that trilateration assumes. Left and right are pooled, and so are all stances: a table for
each stance class explains held-out bodies no better (log-likelihood 2.57, too). The errors of shoulder
and elbow double in another stance (9 to 23 mm, 9 to 21 mm); `core.relocation.articulation` accounts for that.

The table of METHOD (joints drawn with 15 mm of noise: hands 70 mm, head and torso 50) explains geodesics to
moles of held-out bodies worse: 2.41 per distance. On 12 tuning pairs the measured one takes the mean error of
trilateration from 19.7 to 18.4 mm, answers within 10 mm from 26 to 31 %, coverage of its stated radius from
92 to 96 %. The registration, which answers first, hardly notices.
"""

EXTRA_SIGMA_M: Final = 0.010
"""For landmarks on the skin, from the same captures: 6 mm (nose) to 13 mm (ears, wrists), pooled."""

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
