"""The moles of the first visit as the matching sees them: the lesions in question first, then all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.lesions import SkinSpots, spot_at
from core.lesions.appearance import appearance_distance
from core.relocation.pair import KnownPlace, PickedLesion
from core.relocation.registration.start import SkeletonStart
from core.surface import BodySurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_CONFIDENCE = 0.1
"""Of a spot that takes part in the matching."""
CLICK_REACH_PX = 6.0
LIMB_APART_M = 0.15
"""Skin of two bones counts as this much farther apart: an arm beside the trunk moves on its own."""
LOOKS_SHARE = 0.6
"""How far the likelihood of looks is believed: it was measured on rendered moles, and real ones change."""
LEAST_LOOKS, MOST_LOOKS = -6.0, 12.0
NEVER = 1e6


@dataclass(frozen=True, eq=False)
class FirstMoles:
    """Rows of the matching, m of them.

    Attributes
    ----------
    places, normals : ndarray (m, 3)
        On the first skin.
    coordinates : ndarray (m, 3 + bones)
        Near coordinates drift alike.
    spot : ndarray (m,)
        Row of the first visit's spots; -1 where a lesion was not detected as one.
    lesions : int
        So many of the first rows are lesions.
    healed : ndarray (m,) bool
        Lesions that are no longer there.
    twin : ndarray (m,)
        Row that answers for this one: of lesions marked on the same spot the first, else the row itself.
    """

    places: FloatArray
    normals: FloatArray
    coordinates: FloatArray
    spot: IntArray
    lesions: int
    healed: NDArray[np.bool_]
    twin: IntArray

    def looks(self, first: SkinSpots, followup: SkinSpots) -> FloatArray:
        """Cost (m, k) of being a spot of the follow-up by looks alone, -2 log likelihood ratio."""
        cost = np.zeros((len(self.places), len(followup)))
        known = np.flatnonzero(self.spot >= 0)
        if len(known) and len(followup):
            away = appearance_distance(first, self.spot[known], followup, np.arange(len(followup)))
            cost[known] = np.clip(LOOKS_SHARE * away, LEAST_LOOKS, MOST_LOOKS)
        cost[self.healed | (self.twin != np.arange(len(self.twin)))] = NEVER
        return cost


def usable(spots: SkinSpots) -> SkinSpots:
    """The spots that take part in the matching."""
    return spots.take(np.flatnonzero(spots.confidence > LEAST_CONFIDENCE))


def gather_moles(
    lesions: Sequence[PickedLesion],
    known: Sequence[KnownPlace],
    spots: SkinSpots,
    surface: BodySurface,
    start: SkeletonStart,
) -> FirstMoles:
    """Lesions, confirmed lesions, and every other spot of the first visit.

    A lesion that is a detected spot counts at the spot's centre, which is surer than a click.
    """
    own = [
        None if p.query.healed or p.query.pixel is None else spot_at(spots, p.query.pixel, CLICK_REACH_PX)
        for p in lesions
    ]
    places = [
        p.point.position_m if k is None else spots.points_m[k] for p, k in zip(lesions, own, strict=True)
    ]
    normals = [p.normal if k is None else spots.normals[k] for p, k in zip(lesions, own, strict=True)]
    places += [k.first.position_m for k in known]
    normals += [surface.normal_at(k.first) for k in known]
    row = [-1 if k is None else k for k in own] + [-1] * len(known)
    taken = {k for k in own if k is not None}
    healed_at = [p.point.position_m for p in lesions if p.query.healed]
    rest = [
        k
        for k in range(len(spots))
        if k not in taken and all(np.linalg.norm(spots.points_m[k] - place) > 0.004 for place in healed_at)
    ]
    every = np.array([*places, *spots.points_m[rest]]).reshape(-1, 3)
    healed = np.zeros(len(every), bool)
    healed[: len(lesions)] = [p.query.healed for p in lesions]
    return FirstMoles(
        every,
        np.array([*normals, *spots.normals[rest]]).reshape(-1, 3),
        limb_coordinates(every, start),
        np.array([*row, *rest], np.int64),
        len(lesions),
        healed,
        np.array([*_first_with(row), *range(len(row), len(every))], np.int64),
    )


def _first_with(spots: list[int]) -> list[int]:
    """For every lesion the first one that was marked on the same spot."""
    first: dict[int, int] = {}
    return [number if spot < 0 else first.setdefault(spot, number) for number, spot in enumerate(spots)]


def limb_coordinates(places: FloatArray, start: SkeletonStart) -> FloatArray:
    """Places (m, 3) with one more coordinate per bone: how much they belong to it."""
    if len(places) == 0:
        return np.zeros((0, 3 + len(start.bones)))
    return np.hstack([places, LIMB_APART_M * start.shares(places).T])
