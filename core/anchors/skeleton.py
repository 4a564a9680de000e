"""A skeleton: named joints inside the body, and what finds them in a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from core.anchors.names import JOINT_NAMES

FloatArray = NDArray[np.float64]

JointSource = Literal["color", "relief", "recording", "hand", "nite2"]

VISIBLE: Final = 0.5
"""Visibility from which a joint counts as seen (METHOD section 3)."""


@dataclass(frozen=True, eq=False)
class PoseLandmarks:
    """The 33 landmarks of one person in one picture.

    Attributes
    ----------
    pixels : ndarray (33, 2)
        Places in the picture, order of `names.LANDMARK_NAMES`. May lie outside the picture.
    visibility : ndarray (33,)
        0 (hidden or invented) to 1 (seen).
    spread_px : ndarray (33,) or None
        How far several looks at the same person differ, standard deviation along one axis; None for one look.
    """

    pixels: FloatArray
    visibility: FloatArray
    spread_px: FloatArray | None = None


class SkeletonTracker(Protocol):
    """Finds the landmarks of the most prominent person in a colour picture. Safe to call from any thread."""

    @property
    def name(self) -> str:
        """For people and for records."""

    def detect(self, rgb: NDArray[np.uint8]) -> PoseLandmarks | None:
        """Landmarks in an RGB picture (h, w, 3), or None if nobody is seen."""

    def close(self) -> None:
        """Release the tracker. Closing a closed tracker does nothing."""


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint centre or landmark.

    Attributes
    ----------
    name : str
    point_m : ndarray (3,)
        Depth-camera frame; inside the body for joints, on the skin for extra landmarks.
    pixel : ndarray (2,)
        Picture pixel of `point_m`.
    visibility : float
        0 to 1; below `VISIBLE` the joint is a guess.
    source : {"color", "relief", "recording", "hand", "nite2"}
        Where the joint was found.
    covariance_m2 : ndarray (3, 3) or None
        Of `point_m` against the true joint centre, depth-camera frame; None where nothing is known, as for
        joints that came with a recording.
    """

    name: str
    point_m: FloatArray
    pixel: FloatArray
    visibility: float
    source: JointSource
    covariance_m2: FloatArray | None = None

    @property
    def sigma_m(self) -> float | None:
        """Standard deviation along one axis, averaged over the directions."""
        return None if self.covariance_m2 is None else float(np.sqrt(np.trace(self.covariance_m2) / 3.0))

    def moved(self, point_m: FloatArray, pixel: FloatArray, visibility: float | None = None) -> Joint:
        """The same joint at another place."""
        v = self.visibility if visibility is None else visibility
        return replace(self, point_m=point_m, pixel=pixel, visibility=v)


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The joints found in one capture.

    Attributes
    ----------
    joints : mapping of str to Joint
        Keys are among `names.JOINT_NAMES`, in that order.
    landmarks : mapping of str to Joint
        Extra repeatable points on the skin, keys among `names.EXTRA_NAMES`.
    source : {"color", "relief", "recording", "hand", "nite2"}
    warnings : tuple of str
        For the doctor.
    """

    joints: Mapping[str, Joint]
    landmarks: Mapping[str, Joint] = field(default_factory=dict)
    source: JointSource = "color"
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        unknown = sorted(set(self.joints) - set(JOINT_NAMES))
        if unknown:
            raise ValueError(f"not joints of a skeleton: {', '.join(unknown)}")
        ordered = {name: self.joints[name] for name in JOINT_NAMES if name in self.joints}
        object.__setattr__(self, "joints", MappingProxyType(ordered))
        object.__setattr__(self, "landmarks", MappingProxyType(dict(self.landmarks)))

    def visible(self, min: float = VISIBLE) -> tuple[str, ...]:
        """Names of the joints with at least this visibility."""
        return tuple(name for name, joint in self.joints.items() if joint.visibility >= min)

    def sees(self, *names: str) -> bool:
        """Whether all these joints are visible."""
        return all(name in self.joints and self.joints[name].visibility >= VISIBLE for name in names)

    def point(self, name: str) -> FloatArray:
        """Place (3,) of a joint in the depth-camera frame."""
        return self.joints[name].point_m

    def with_joint(self, joint: Joint) -> Skeleton:
        """The same skeleton with one joint replaced, for example placed by hand."""
        return replace(self, joints={**self.joints, joint.name: joint})

    def with_warnings(self, *warnings: str) -> Skeleton:
        """The same skeleton with more to say."""
        return replace(self, warnings=(*self.warnings, *warnings))
