"""Spots that only one of the two visits shows: candidates for new and for vanished lesions, never alarms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.relocation.pair import VisitPair
from core.relocation.sight import look_at
from core.relocation.transfer import Transfer
from core.relocation.types import Spot

FloatArray = NDArray[np.float64]

LEAST_CONFIDENCE = 0.5
"""Of a spot's being a mole, to be listed."""
SHARED_M = 0.012
"""Skin of the follow-up this near to carried skin was seen in the first visit, too."""
SQUARE_ON = 0.35
"""Cosine to the camera from which a mole would be detected for certain."""
ELSEWHERE = 3.0
"""A spot farther than this many standard deviations from where it should be is not it."""


def new_spots(pair: VisitPair, transfer: Transfer) -> tuple[Spot, ...]:
    """Spots of the follow-up, on skin that the first visit shows, which are no spot of the first visit."""
    spots, matching = transfer.spots, transfer.matching
    if len(spots) == 0:
        return ()
    taken = {int(p) for p in matching.partner if p >= 0}
    shared = _seen_before(pair, transfer, spots.points_m)
    square_on = -np.einsum("ki,ki->k", spots.normals, spots.points_m) / np.linalg.norm(spots.points_m, axis=1)
    lone = [
        k
        for k in np.flatnonzero((spots.confidence >= LEAST_CONFIDENCE) & shared & (square_on > SQUARE_ON))
        if int(k) not in taken
    ]
    left = np.flatnonzero(matching.partner < 0)
    out = []
    for k in lone:
        known = _explained(spots.points_m[k], transfer, left)
        out.append(_spot(spots.pixels[k], spots.points_m[k], float(spots.confidence[k]) * (1.0 - known)))
    return tuple(sorted((s for s in out if s.confidence > 0.1), key=lambda s: -s.confidence))


def vanished_spots(pair: VisitPair, transfer: Transfer) -> tuple[Spot, ...]:
    """Spots of the first visit, on skin that the follow-up shows, which are no spot of the follow-up.

    Their places are the first visit's. The lesions in question are not listed: they have answers of their
    own.
    """
    spots, moles, matching = transfer.first_spots, transfer.moles, transfer.matching
    if len(spots) == 0:
        return ()
    rows = [
        r
        for r in range(moles.lesions, len(moles.places))
        if moles.spot[r] >= 0
        and matching.partner[r] < 0
        and spots.confidence[moles.spot[r]] >= LEAST_CONFIDENCE
    ]
    sight = look_at(
        transfer.carried[rows],
        transfer.normals[rows],
        pair.followup.scan.surface,
        pair.followup.capture.rig,
        other_stance=transfer.other_stance,
        depth_excess_m2=pair.depth_excess_m2,
    )
    out = []
    for number, row in enumerate(rows):
        if sight.hidden[number] or sight.cosine[number] < SQUARE_ON:
            continue
        free = np.setdiff1d(np.arange(len(transfer.spots)), matching.partner)
        away = np.linalg.norm(transfer.spots.points_m[free] - matching.expected[row], axis=1)
        near = float(np.exp(-0.5 * (away.min(initial=np.inf) / matching.sigma_m[row]) ** 2))
        own = int(moles.spot[row])
        out.append(_spot(spots.pixels[own], spots.points_m[own], float(spots.confidence[own]) * (1.0 - near)))
    return tuple(sorted((s for s in out if s.confidence > 0.1), key=lambda s: -s.confidence))


def _seen_before(pair: VisitPair, transfer: Transfer, places: FloatArray) -> NDArray[np.bool_]:
    """Whether places (k, 3) of the follow-up lie on skin that the first visit showed."""
    surface = pair.first.scan.surface
    inner = np.flatnonzero(~surface.boundary)[::7]
    carried, normals = transfer.registration.deformation.warp(surface.vertices[inner], surface.normals[inner])
    facing = np.einsum("ki,ki->k", normals, carried) < 0
    if not facing.any():
        return np.zeros(len(places), bool)
    away, _ = cKDTree(carried[facing]).query(places)
    return np.asarray(away < SHARED_M)


def _explained(place: FloatArray, transfer: Transfer, rows: NDArray[np.intp]) -> float:
    """How well an unmatched spot of the first visit explains a place, 0..1."""
    if len(rows) == 0:
        return 0.0
    matching = transfer.matching
    away = np.linalg.norm(matching.expected[rows] - place, axis=1) / matching.sigma_m[rows]
    return float(np.exp(-0.5 * min(float(away.min()), ELSEWHERE * 2) ** 2))


def _spot(pixel: FloatArray, point_m: FloatArray, confidence: float) -> Spot:
    return Spot((float(pixel[0]), float(pixel[1])), point_m, round(confidence, 4))
