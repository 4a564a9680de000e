"""One answer against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.evaluation.cases import EvaluationCase, TrueLesion
from core.evaluation.parts import BodyMap
from core.relocation import LesionStatus, Region, RelocatedLesion, RelocationResult, Spot
from core.surface import BodySurface, pick_skin

FloatArray = NDArray[np.float64]

OWN_LESION_M = 0.005
"""An answer this close to the truth has chosen the right lesion, whatever lies beside it."""

SPOT_MATCH_M = 0.008
"""A listed spot is a true one if it lies this close: the radius of the largest mole."""


@dataclass(frozen=True)
class LesionScore:
    """What became of one lesion. None where there is no answer, or nobody knows.

    Attributes
    ----------
    lesion : str
    part, limb : str
        Of the true place in the first capture; empty without joints.
    visible, healed : bool
        See `TrueLesion`.
    error_m : float or None
        From the answer to the true place.
    floor_m : float or None
        From the place that the sensor itself gives for the true pixel to the true place: no relocation can be
        measured to be better.
    beside_floor_m : float or None
        From the answer to the place that the sensor gives.
    radius95_m, region_a_m, region_b_m : float or None
        Stated by the method.
    in_region : bool or None
        Whether the true place, projected onto the tangent plane of the answer, lies in the stated ellipse.
    wrong_lesion : bool or None
        The answer is nearer to another true mole than to its own, and farther than 5 mm from its own.
    wrong_limb : bool or None
        See `core.evaluation.parts.BodyMap.is_wrong_limb`.
    """

    lesion: str
    part: str
    limb: str
    visible: bool
    healed: bool
    status: LesionStatus
    error_m: float | None = None
    floor_m: float | None = None
    beside_floor_m: float | None = None
    radius95_m: float | None = None
    region_a_m: float | None = None
    region_b_m: float | None = None
    in_region: bool | None = None
    confidence: float = 0.0
    appearance_matched: bool = False
    agreement_m: float | None = None
    wrong_lesion: bool | None = None
    wrong_limb: bool | None = None

    @property
    def answered(self) -> bool:
        """Whether a place was given."""
        return self.status not in ("not_visible", "refused")

    def to_json(self) -> dict[str, Any]:
        """A dictionary of plain values."""
        return {k: round(v, 6) if isinstance(v, float) else v for k, v in asdict(self).items()}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> LesionScore:
        """What `to_json` made."""
        return cls(**{f.name: values[f.name] for f in fields(cls)})


@dataclass(frozen=True)
class SpotScore:
    """New or vanished spots of one case: how many were listed, how many there are, how many are both."""

    listed: int
    true: int
    right: int


def score_lesions(
    case: EvaluationCase, result: RelocationResult, lesions: Sequence[TrueLesion] | None = None
) -> list[LesionScore]:
    """Compare a result with the truth of its case.

    Parameters
    ----------
    lesions : sequence of TrueLesion, optional
        Those that were asked for; all by default.
    """
    first, followup = BodyMap(case.first_joints_m), BodyMap(case.followup_joints_m)
    return [
        _score(case, truth, result[truth.id], first, followup)
        for truth in (case.lesions if lesions is None else lesions)
    ]


def sensor_floor(case: EvaluationCase) -> list[LesionScore]:
    """The true pixel's own place as if it were an answer, for every lesion the follow-up shows."""
    first = BodyMap(case.first_joints_m)
    out = []
    for truth in case.lesions:
        if not truth.visible:
            continue
        sensed = _sensed(case, truth)
        floor = None if sensed is None else _between(sensed, truth.followup_m)
        part, limb = _names(first, truth)
        status: LesionStatus = "refused" if sensed is None else "found"
        out.append(
            LesionScore(truth.id, part, limb, True, truth.healed, status, error_m=floor, floor_m=floor)
        )
    return out


def score_spots(listed: Sequence[Spot], true_m: FloatArray) -> SpotScore:
    """Spots against the true ones of their capture.

    A true spot counts once, for the nearest listed one within `SPOT_MATCH_M`.
    """
    if not listed or not len(true_m):
        return SpotScore(len(listed), len(true_m), 0)
    away = np.linalg.norm(np.array([s.point_m for s in listed])[:, None] - true_m[None], axis=2)
    rows: set[int] = set()
    columns: set[int] = set()
    for row, column in sorted(np.argwhere(away <= SPOT_MATCH_M).tolist(), key=lambda rc: away[rc[0], rc[1]]):
        if row not in rows and column not in columns:
            rows.add(row)
            columns.add(column)
    return SpotScore(len(listed), len(true_m), len(rows))


def _score(
    case: EvaluationCase, truth: TrueLesion, answer: RelocatedLesion, first: BodyMap, followup: BodyMap
) -> LesionScore:
    part, limb = _names(first, truth)
    known = LesionScore(
        lesion=truth.id,
        part=part,
        limb=limb,
        visible=truth.visible,
        healed=truth.healed,
        status=answer.status,
        confidence=float(answer.confidence),
        appearance_matched=answer.appearance_matched,
        agreement_m=None if answer.agreement_m is None else float(answer.agreement_m),
    )
    if answer.point_m is None or not np.isfinite(truth.followup_m).all():
        return known
    point = np.asarray(answer.point_m, float)
    sensed = _sensed(case, truth) if truth.visible else None
    region = answer.region
    return replace(
        known,
        error_m=_between(point, truth.followup_m),
        floor_m=None if sensed is None else _between(sensed, truth.followup_m),
        beside_floor_m=None if sensed is None else _between(sensed, point),
        radius95_m=None if answer.radius95_m is None else float(answer.radius95_m),
        region_a_m=None if region is None else float(region.axes_m[0]),
        region_b_m=None if region is None else float(region.axes_m[1]),
        in_region=None
        if region is None
        else is_in_region(truth.followup_m, point, region, case.followup.scan.surface),
        wrong_lesion=_wrong_lesion(case, truth, point),
        wrong_limb=followup.is_wrong_limb(point, truth.followup_m),
    )


def is_in_region(place_m: FloatArray, center_m: FloatArray, region: Region, surface: BodySurface) -> bool:
    """Whether a place, projected onto the tangent plane of the region's centre, lies in its ellipse."""
    normal = surface.normal_at(surface.nearest(center_m)[0])
    off = place_m - center_m
    off = off - normal * (normal @ off)
    long = region.direction - normal * (normal @ region.direction)
    long = long / max(float(np.linalg.norm(long)), 1e-12)
    across = np.cross(normal, long)
    a, b = (max(axis, 1e-9) for axis in region.axes_m)
    return bool((float(off @ long) / a) ** 2 + (float(off @ across) / b) ** 2 <= 1.0)


def _wrong_lesion(case: EvaluationCase, truth: TrueLesion, answer_m: FloatArray) -> bool | None:
    others = np.array([name != truth.id for name in case.mole_ids], bool)
    if not others.any():
        return None
    own = _between(answer_m, truth.followup_m)
    nearest = float(np.linalg.norm(case.moles_m[others] - answer_m, axis=1).min())
    return own > OWN_LESION_M and nearest < own


def _sensed(case: EvaluationCase, truth: TrueLesion) -> FloatArray | None:
    """The place that the sensor gives for the lesion's true pixel."""
    point = pick_skin(case.followup.scan, truth.followup_pixel).point
    return None if point is None else np.asarray(point.position_m, float)


def _names(first: BodyMap, truth: TrueLesion) -> tuple[str, str]:
    place = first.place(truth.first_m)
    return ("", "") if place is None else (place.part, place.limb)


def _between(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a - b))
