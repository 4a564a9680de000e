"""What goes into a relocation and what comes out of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError

FloatArray = NDArray[np.float64]

LesionStatus = Literal["found", "predicted", "ambiguous", "not_visible", "refused"]
"""found: seen again by its appearance; predicted: computed, not seen; ambiguous: several places explain the
evidence; not_visible: the place is not in this view; refused: the evidence carries no answer."""

DEFAULT_DELTA_M = 0.03
"""Half width of a voting band (eq. 1).

Chosen on simulated tuning bodies (average, heavy and child shapes and mixtures of them; 6 pairs in the same
stance, 10 in another; 553 lesions, tracked joints): the pooled mean error of both voting methods is flat
between 20 and 40 mm and grows beyond; 30 mm is the middle."""


@dataclass(frozen=True)
class LesionQuery:
    """A lesion of the first visit to be found again.

    Attributes
    ----------
    id : str
    pixel : (u, v) or None
        Pixel of the first visit's picture (colour image, or depth image without one).
    depth_pixel : (u, v) or None
        Pixel of the first visit's depth image; used when there is no `pixel`.
    capture : str or None
        Name of the capture of the visit in which the pixel was clicked.
    healed : bool
        The lesion is no longer there (excised, or a healed biopsy): its site is sought by geometry and by the
        skin around it, never by its own looks.
    """

    id: str
    pixel: tuple[float, float] | None = None
    depth_pixel: tuple[float, float] | None = None
    capture: str | None = None
    healed: bool = False

    def __post_init__(self) -> None:
        if self.pixel is None and self.depth_pixel is None:
            raise InputError(f'Lesion "{self.id}" has neither "pixel" nor "depth_pixel".')


@dataclass(frozen=True, eq=False)
class ConfirmedLesion:
    """A lesion whose place the doctor has confirmed in both captures: an anchor for the others.

    Attributes
    ----------
    first : LesionQuery
        Where it was clicked in the first capture.
    followup_pixel : (u, v)
        Where it was confirmed in the follow-up's picture (colour image, or depth image without one).
    """

    first: LesionQuery
    followup_pixel: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Candidate:
    """Another place that explains the evidence almost as well.

    Attributes
    ----------
    point_m : ndarray (3,)
        On the follow-up's skin, depth-camera frame.
    confidence : float
        0..1, comparable with the answer's.
    pixel, depth_pixel : (u, v) or None
        Where it appears in the follow-up's picture and depth image.
    """

    point_m: FloatArray
    confidence: float
    pixel: tuple[float, float] | None = None
    depth_pixel: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Region:
    """The 95 % ellipse on the skin.

    Attributes
    ----------
    axes_m : (a, b)
        Half axes, a >= b.
    direction : ndarray (3,)
        Unit tangent vector of the long axis, depth-camera frame.
    """

    axes_m: tuple[float, float]
    direction: FloatArray


@dataclass(frozen=True, eq=False)
class RelocatedLesion:
    """The answer for one lesion, in the follow-up's depth-camera frame.

    Attributes
    ----------
    point_m : ndarray (3,) or None
        On the skin. None for not_visible and refused.
    pixel : (u, v) or None
        Picture pixel of the follow-up.
    depth_pixel : (u, v) or None
        Depth pixel of the follow-up.
    radius95_m : float or None
        The true place lies within this distance in 95 % of cases.
    confidence : float
        0..1: belief that the answer is the right place, not another one that looks alike.
    agreement_m : float or None
        Distance between the geodesic estimate and another method's, where both exist.
    capture : str or None
        Name of the follow-up capture the answer lies in, for visits of several captures.
    picture : "color" or "depth"
        Which image `pixel` counts in: the depth image for a recording without colour.
    """

    id: str
    status: LesionStatus
    reason: str
    point_m: FloatArray | None = None
    pixel: tuple[float, float] | None = None
    depth_pixel: tuple[float, float] | None = None
    radius95_m: float | None = None
    confidence: float = 0.0
    appearance_matched: bool = False
    candidates: tuple[Candidate, ...] = ()
    region: Region | None = None
    agreement_m: float | None = None
    capture: str | None = None
    picture: Literal["color", "depth"] = "color"

    @property
    def has_point(self) -> bool:
        """Whether there is an answer to show."""
        return self.point_m is not None


@dataclass(frozen=True, eq=False)
class Spot:
    """A mole-like spot seen in one visit only (filled by methods that look at appearance)."""

    pixel: tuple[float, float]
    point_m: FloatArray
    confidence: float


@dataclass(frozen=True, eq=False)
class RelocationResult:
    """Answers in the order of the queries, with the time of each phase and warnings for the user."""

    method: str
    lesions: tuple[RelocatedLesion, ...]
    seconds: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    new_spots: tuple[Spot, ...] = ()
    vanished_spots: tuple[Spot, ...] = ()

    def __getitem__(self, lesion_id: str) -> RelocatedLesion:
        """The answer for one lesion."""
        for lesion in self.lesions:
            if lesion.id == lesion_id:
                return lesion
        raise KeyError(lesion_id)

    def to_json(self) -> dict[str, object]:
        """The dictionary of result.json (``geoderm-relocation/1``)."""
        from core.relocation.result_json import result_to_json

        return result_to_json(self)


@dataclass(frozen=True)
class RelocationOptions:
    """What a researcher may turn.

    Attributes
    ----------
    delta_m : float
        Half width of a voting band (eq. 1).
    refine_anchors : bool
        Let `trilateration` shift the follow-up's anchors so that inter-anchor geodesics agree with the first
        visit's (METHOD section 3).
    check_visibility : bool
        Answer "not_visible" where the place is not in the follow-up's view. Off: every lesion gets a place.
    """

    delta_m: float = DEFAULT_DELTA_M
    refine_anchors: bool = True
    check_visibility: bool = True

    def __post_init__(self) -> None:
        if not 0 < self.delta_m < 1:
            raise InputError("delta_m, the half width of a voting band, must lie between 0 and 1 metre.")


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method says about one lesion before visibility and refusal are judged.

    Attributes
    ----------
    point_m : ndarray (3,) or None
        None when the method has no answer; `reason` then says why.
    radius95_m : float
    confidence : float
    vertex : int
        Surface vertex of the follow-up nearest to the answer.
    hidden : str
        Why the place cannot be in this view, from the method's own evidence; empty when it can.
    """

    point_m: FloatArray | None
    radius95_m: float = 0.0
    confidence: float = 0.0
    vertex: int = -1
    hidden: str = ""
    candidates: tuple[Candidate, ...] = ()
    region: Region | None = None
    reason: str = ""
    appearance_matched: bool = False
    pixel: tuple[float, float] | None = None
    agreement_m: float | None = None
