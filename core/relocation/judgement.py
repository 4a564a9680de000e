"""From carried skin and matched moles to one estimate per lesion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import Bone, Part
from core.relocation.calibration95 import Kind, factor95
from core.relocation.pair import VisitPair
from core.relocation.posterior import radius95_m, skin_region
from core.relocation.recognition import Recognition
from core.relocation.sight import OUTSIDE, TURNED, Sight, look_at
from core.relocation.spread import (
    NORMAL_95,
    PIXEL_SHARE,
    SEEN_M,
    Spread,
    body_part,
    carried_spread,
    region_of,
    skin_basis,
)
from core.relocation.tangent import tangent_basis
from core.relocation.transfer import Transfer
from core.relocation.trilateration import Fix
from core.relocation.types import Candidate, Estimate

FloatArray = NDArray[np.float64]

AGAIN = 0.85
"""Probability that a mole of the first visit is detected in the follow-up when it is in view."""
SURE, POSSIBLE = 0.5, 0.2
"""Posterior of the best spot from which on it counts as seen again, and of others worth telling."""
REACH = 3.5
MOST_RADIUS_M, BLIND_RADIUS_M = 0.10, 0.15
"""A place known no better is no answer; where too few moles are there to match, a wider region is one."""
UNFOLLOWED_M = 0.03
"""Doubt about skin on an upper limb whose far joint was not found: the surface alone carries it."""
LEAST_SPOTS, BLIND_COSINE = 12, -0.6
"""Without so many spots of the follow-up an arm may itself have been carried wrongly.

Its distance from the seen skin then says nothing: only a place that is turned far away counts as hidden.
Real frames of a clothed man showed it; simulated arms are carried better."""
TOO_WIDE = "The place is known only to {size:.0f} cm: nothing around it was recognised."
MOST_OFF_M, MOST_SIGMA_M = 0.006, 0.006
"""A spot counts as seen again only where the skin around it lies on the follow-up's, and matches are near.

On the calibration patients 98 % of right matches keep both, 4 of 5 wrong ones do not. A lesion that the first
picture does not show as a spot is never "seen again": what should be recognised? Nor is one whose skin was
carried to face away from the camera: of 2036 spots seen again on calibration and tuning pairs two lay so, one
right and one 82 mm off."""
DOUBT, DISBELIEVED = 0.5, 0.3
"""Factors of the confidence where the person is in doubt, and where distances along the skin disagree."""
FAR_OFF = 1.5
"""Distances along the skin disagree beyond so many of their own radii."""
CONFIDENT_M = 0.010
"""`Estimate.confidence` is the probability that the answer is nearer to the truth than this."""
GEODESIC_SCALE, GEODESIC_LEAST_M = 4.0, 0.060
"""How much wider than its own posterior a geodesic fix is taken, and its finest spread per axis.

Trilateration errs with its anchors, all lesions of a limb alike, which its posterior does not know;
believed by its own word it spoiled the registration (mean 6.7 instead of 5 mm in the same stance,
calibration patients)."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """Spots that may be the lesion, with their probabilities, likeliest first."""

    rows: NDArray[np.int64]
    probability: FloatArray


def judge(
    pair: VisitPair, transfer: Transfer, recognition: Recognition, fixes: tuple[Fix | None, ...] | None
) -> tuple[Estimate, ...]:
    """One estimate per lesion of a transfer.

    Parameters
    ----------
    recognition : Recognition
        Whether person, limbs and the places of the lesions were recognised.
    fixes : tuple of Fix or None, optional
        What geodesic trilateration says about each lesion; without it the registration stands alone.
    """
    count = transfer.moles.lesions
    surface = pair.followup.scan.surface
    sight = look_at(
        transfer.carried[:count],
        transfer.normals[:count],
        surface,
        pair.followup.capture.rig,
        other_stance=transfer.other_stance,
        depth_excess_m2=pair.depth_excess_m2,
    )
    return tuple(
        _judge_one(
            pair,
            transfer,
            int(transfer.moles.twin[row]),
            sight,
            recognition,
            None if fixes is None else fixes[row],
        )
        for row in range(count)
    )


def _judge_one(
    pair: VisitPair, transfer: Transfer, row: int, sight: Sight, recognition: Recognition, fix: Fix | None
) -> Estimate:
    surface = pair.followup.scan.surface
    place = transfer.moles.places[row]
    number = int(transfer.start.owners.at(place[None])[0])
    bone = transfer.start.bones[number]
    part = body_part(bone)
    seen = _possible_spots(transfer, row)
    partner = int(transfer.matching.partner[row])
    unfollowed = number in transfer.start.lost
    lost = (
        _not_found(bone)
        if unfollowed and bone.parent != 0
        else recognition.of_limb(number) or recognition.of_place(row)
    )
    hidden = _hidden(transfer, row, sight, part)
    believed = (
        not (recognition.doubtful or lost or unfollowed)
        and transfer.moles.spot[row] >= 0
        and sight.cosine[row] > 0.0
        and sight.off_m[row] < MOST_OFF_M
        and transfer.matching.sigma_m[row] < MOST_SIGMA_M
    )
    if believed and len(seen.rows) and seen.rows[0] == partner and seen.probability[0] >= SURE:
        return _seen_again(transfer, row, part, partner, seen, fix)
    if lost:
        return Estimate(None, hidden=hidden, reason=lost)
    expected = transfer.matching.expected[row]
    on_skin = surface.nearest(expected)[0]
    normal = surface.normal_at(on_skin)
    spread = carried_spread(
        part,
        transfer.other_stance,
        float(transfer.matching.sigma_m[row]),
        max(float(sight.off_m[row]), UNFOLLOWED_M if unfollowed else 0.0),
        float(sight.cosine[row]),
        skin_basis(normal, part, bone),
    )
    point, covariance, agreement, reason = _fused(on_skin.position_m, spread, fix)
    if fix is not None:
        on_skin = surface.nearest(point)[0]
    kind: Kind = "matched" if len(transfer.spots) else "geometry"
    region, radius = region_of(spread.basis, covariance, factor95(kind, transfer.other_stance, part))
    blind = len(transfer.spots) < LEAST_SPOTS
    if blind and radius > BLIND_RADIUS_M and fix is not None and radius95_m(fix) < BLIND_RADIUS_M:
        return _by_geodesics(pair, fix, hidden)
    if radius > (BLIND_RADIUS_M if blind else MOST_RADIUS_M):
        return Estimate(None, hidden=hidden, reason=TOO_WIDE.format(size=100.0 * radius))
    return Estimate(
        point_m=on_skin.position_m,
        radius95_m=radius,
        confidence=_within(CONFIDENT_M, covariance) * (DOUBT if recognition.doubtful else 1.0),
        vertex=int(surface.nearest_vertex(on_skin.position_m)[0]),
        hidden=hidden,
        candidates=_candidates(transfer, seen, on_skin.position_m, radius),
        region=region,
        reason=reason,
        agreement_m=agreement,
    )


def _by_geodesics(pair: VisitPair, fix: Fix, hidden: str) -> Estimate:
    """The answer of trilateration where the registration carries none."""
    surface = pair.followup.scan.surface
    point = surface.nearest(fix.point_m)[0]
    return Estimate(
        point_m=point.position_m,
        radius95_m=radius95_m(fix),
        confidence=_within(CONFIDENT_M, np.eye(2) * (radius95_m(fix) / NORMAL_95) ** 2),
        vertex=fix.best_vertex,
        hidden=hidden,
        region=skin_region(fix, surface.normals[fix.best_vertex]),
        reason="Computed from distances along the skin; its shape alone does not carry the place.",
    )


def _hidden(transfer: Transfer, row: int, sight: Sight, part: Part) -> str:
    """Why the place cannot be in this view; empty when it can."""
    blind = len(transfer.spots) < LEAST_SPOTS
    if blind and part in ("upper arm", "forearm") and sight.hidden[row] != OUTSIDE:
        return TURNED if sight.cosine[row] < BLIND_COSINE else ""
    return sight.hidden[row]


def _seen_again(
    transfer: Transfer, row: int, part: Part, partner: int, seen: _Seen, fix: Fix | None
) -> Estimate:
    spots = transfer.spots
    point = spots.points_m[partner]
    steep = 1.0 / float(np.clip(-(spots.normals[partner] @ point) / np.linalg.norm(point), 0.3, 1.0))
    size = float(np.hypot(SEEN_M, PIXEL_SHARE * transfer.pixel_m)) * steep
    spread = Spread(tangent_basis(spots.normals[partner]), (size, size))
    region, radius = region_of(
        spread.basis, spread.covariance(), factor95("seen", transfer.other_stance, part)
    )
    agreement, reason, doubt = None, "Seen again in the picture.", 1.0
    others = _candidates(transfer, _Seen(seen.rows[1:], seen.probability[1:]), point, radius)
    if fix is not None:
        agreement = float(np.linalg.norm(fix.point_m - point))
        if agreement > FAR_OFF * radius95_m(fix) + radius:
            reason = f"A spot like it was seen in the picture, but {_disagreement(agreement)}"
            others, doubt = (*others, Candidate(fix.point_m, DISBELIEVED)), DISBELIEVED
    return Estimate(
        point_m=point,
        radius95_m=radius,
        confidence=doubt * float(seen.probability[0]) * _within(CONFIDENT_M, spread.covariance()),
        vertex=-1,
        candidates=others,
        region=region,
        reason=reason,
        appearance_matched=doubt == 1.0,
        pixel=(float(spots.pixels[partner, 0]), float(spots.pixels[partner, 1])),
        agreement_m=agreement,
    )


def _possible_spots(transfer: Transfer, row: int) -> _Seen:
    """Posterior of each spot near the expected place; spots that are surely others are left out."""
    spots, matching = transfer.spots, transfer.matching
    nothing = _Seen(np.zeros(0, np.int64), np.zeros(0))
    if len(spots) == 0:
        return nothing
    sigma = float(matching.sigma_m[row])
    square = ((spots.points_m - matching.expected[row]) ** 2).sum(axis=1) / sigma**2
    near = square < REACH**2
    others = matching.partner[matching.sure & (np.arange(len(matching.partner)) != row)]
    near[others[others >= 0]] = False
    rows = np.flatnonzero(near)
    if len(rows) == 0:
        return nothing
    density = len(spots) / max(float(np.pi * transfer.extent_m**2), 0.05)
    ratio = (
        AGAIN / (2.0 * np.pi * sigma**2 * density) * np.exp(-0.5 * (square[rows] + transfer.looks[row, rows]))
    )
    probability = ratio / (ratio.sum() + 1.0 - AGAIN)
    order = np.argsort(-probability)
    return _Seen(rows[order], probability[order])


def _candidates(
    transfer: Transfer, seen: _Seen, answer: FloatArray, radius_m: float
) -> tuple[Candidate, ...]:
    """Likely spots at other places than the answer's own region."""
    return tuple(
        Candidate(transfer.spots.points_m[r], float(p))
        for r, p in zip(seen.rows[:3], seen.probability[:3], strict=True)
        if p >= POSSIBLE and float(np.linalg.norm(transfer.spots.points_m[r] - answer)) > radius_m
    )


def _fused(
    point: FloatArray, spread: Spread, fix: Fix | None
) -> tuple[FloatArray, FloatArray, float | None, str]:
    """Registered and geodesic estimates in one: place, covariance (2, 2), their distance, what to say."""
    reason = "Carried over by the shape of the skin and the moles around; not seen itself."
    covariance = spread.covariance()
    if fix is None:
        return point, covariance, None, reason
    between = fix.point_m - point
    agreement = float(np.linalg.norm(between))
    if agreement > radius95_m(fix) + 2.5 * spread.mean_m:
        return (
            point,
            covariance,
            agreement,
            f"Carried over by the shape of the skin, but {_disagreement(agreement)}",
        )
    own = spread.basis @ fix.covariance @ spread.basis.T
    geodesic = GEODESIC_SCALE * own + np.eye(2) * GEODESIC_LEAST_M**2
    one, two = np.linalg.inv(covariance), np.linalg.inv(geodesic)
    both = np.linalg.inv(one + two)
    step = both @ two @ (spread.basis @ between)
    return point + step @ spread.basis, both, agreement, reason


def _not_found(bone: Bone) -> str:
    side = bone.name.split("_")[0]
    return f"The {side} {body_part(bone)} was not found in the follow-up; what lies on it cannot be placed."


def _disagreement(distance_m: float) -> str:
    return f"distances along the skin point to a place {1000 * distance_m:.0f} mm away."


def _within(radius_m: float, covariance: FloatArray) -> float:
    """Probability of lying within a radius under a normal law, by its mean spread."""
    mean = 0.5 * float(np.trace(covariance))
    return float(1.0 - np.exp(-0.5 * radius_m**2 / max(mean, 1e-12)))
