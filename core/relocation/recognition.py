"""Whether the moles of the follow-up are those of the first visit: the same person, the same limb.

Registered onto another person of like build, a body fits; its moles do not. On simulated patients the share
of visible moles that are matched beyond doubt was 0.83 to 1.00 for the same person, turned by up to 70
degrees or half a metre nearer, and 0.07 to 0.24 for another person of like size.

A limb may be carried wrongly while the rest of the person fits: an arm that rolled about its axis. Where
moles are dense, chance finds partners for some of its skin, and these bear each other out. What gives them
away are the moles beside them that found none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import Bone
from core.relocation.moles import FirstMoles
from core.relocation.pair import VisitPair
from core.relocation.registration.start import SkeletonStart
from core.relocation.sight import look_at
from core.relocation.transfer import Transfer

LEAST_MOLES, LEAST_LIMB_MOLES = 12, 5
"""So many visible moles are needed to judge a person, and a limb or a place on it."""
SURE_PERSON, DOUBTFUL_PERSON = 0.6, 0.4
DOUBTFUL_LIMB = 0.4
CLEAR_MOLE, SQUARE_ON = 0.5, 0.35
AROUND_M, DOUBTFUL_PLACE = 0.25, 0.55
"""Kernel in which the moles of the same limb bear witness for a place, and the least share recognised.

Asked for all their moles, 22 calibration pairs in another stance had 1016 right answers "seen again" and 19
more than 20 mm off, nearly all on arms; this takes back 14 of the 19 and 14 of the 1016. Of 436 right ones in
the same stance it takes back none; on 12 tuning pairs 3 of 4 wrong ones and 2 of 532 right ones."""

ANOTHER = (
    "The moles of the follow-up are not those of the first visit ({share:.0%} of {count} recognised): "
    "another person, or another side of the body."
)
DOUBTFUL = (
    "Only {share:.0%} of {count} moles of the first visit were recognised: check that both visits show the "
    "same person."
)
UNCHECKED = "Too few moles to check that both visits show the same person."
LIMB = (
    "The moles of the {limb} were not recognised there ({share:.0%} of {count}); it was not found for sure."
)

AROUND = "Too few of the moles around it were recognised there ({share:.0%}); it was not found for sure."


@dataclass(frozen=True)
class Recognition:
    """What the moles say about person and limbs.

    Attributes
    ----------
    obstacle : str
        Why no lesion can be answered; empty when they can.
    warnings : tuple of str
    doubtful : bool
        Whether no spot may count as seen again.
    limbs : mapping of int to str
        Bones whose moles are not recognised, and what to say of lesions there.
    places : mapping of int to str
        Rows of lesions around which moles are not recognised, and what to say of them.
    """

    obstacle: str = ""
    warnings: tuple[str, ...] = ()
    doubtful: bool = False
    limbs: Mapping[int, str] | None = None
    places: Mapping[int, str] | None = None

    def of_limb(self, bone: int) -> str:
        """Why a lesion on this bone carries no answer; empty when it does."""
        return (self.limbs or {}).get(bone, "")

    def of_place(self, row: int) -> str:
        """Why the lesion of this row carries no answer; empty when it does."""
        return (self.places or {}).get(row, "")


def recognise(pair: VisitPair, transfer: Transfer) -> Recognition:
    """Judge person, limbs and places by the share of clear, visible moles that are matched beyond doubt."""
    moles, spots = transfer.moles, transfer.first_spots
    if len(transfer.spots) == 0:
        return Recognition()
    clear = np.flatnonzero(moles.spot >= 0)
    clear = clear[spots.confidence[moles.spot[clear]] >= CLEAR_MOLE]
    sight = look_at(
        transfer.carried[clear],
        transfer.normals[clear],
        pair.followup.scan.surface,
        pair.followup.capture.rig,
        other_stance=transfer.other_stance,
        depth_excess_m2=pair.depth_excess_m2,
    )
    visible = np.array([not h for h in sight.hidden], bool) & (sight.cosine > SQUARE_ON)
    rows = clear[visible]
    sure = transfer.matching.sure[rows]
    if len(rows) < LEAST_MOLES or len(transfer.spots) < LEAST_MOLES:
        return Recognition(warnings=(UNCHECKED,))
    share = float(sure.mean())
    if share < DOUBTFUL_PERSON:
        return Recognition(ANOTHER.format(share=share, count=len(rows)))
    owner = transfer.start.owners.at(moles.places)
    limbs = _lost_limbs(transfer.start, owner[rows], sure)
    places = lost_places(moles, limbs_of_bones(transfer.start.bones)[owner], rows, sure)
    if share < SURE_PERSON:
        return Recognition("", (DOUBTFUL.format(share=share, count=len(rows)),), True, limbs, places)
    return Recognition(limbs=limbs, places=places)


def _lost_limbs(start: SkeletonStart, owner: NDArray[np.intp], sure: NDArray[np.bool_]) -> dict[int, str]:
    out = {}
    for number, bone in enumerate(start.bones):
        own = owner == number
        count = int(own.sum())
        if count >= LEAST_LIMB_MOLES and float(sure[own].mean()) < DOUBTFUL_LIMB:
            out[number] = LIMB.format(limb=bone.spoken, share=float(sure[own].mean()), count=count)
    return out


def limbs_of_bones(skeleton: Sequence[Bone]) -> NDArray[np.intp]:
    """The bone (b,) by which the limb of each bone hangs on the trunk; the trunk is its own."""
    out: list[int] = []
    for number, bone in enumerate(skeleton):
        out.append(out[bone.parent] if bone.parent else number)
    return np.array(out, np.intp)


def lost_places(
    moles: FirstMoles, limb: NDArray[np.intp], rows: NDArray[np.intp], sure: NDArray[np.bool_]
) -> dict[int, str]:
    """Lesions around which too few moles of their limb are recognised, by row.

    Parameters
    ----------
    limb : ndarray (m,)
        Limb of every mole.
    rows : ndarray (v,)
        Moles that are clear in the first visit and must be in view now.
    sure : ndarray (v,) bool
        Which of them are matched beyond doubt.
    """
    asked = np.arange(moles.lesions)
    square = ((moles.coordinates[asked, None] - moles.coordinates[rows][None]) ** 2).sum(axis=2)
    weight = np.exp(-square / (2.0 * AROUND_M**2))
    # A lesion is no witness for itself, nor is one that was marked on the same spot.
    own = moles.twin[asked, None] == moles.twin[rows][None]
    weight[own | (limb[asked, None] != limb[rows][None])] = 0.0
    every, known = weight.sum(axis=1), (weight * sure).sum(axis=1)
    share = known / np.maximum(every, 1e-9)
    lost = (every >= LEAST_LIMB_MOLES) & (share < DOUBTFUL_PLACE)
    return {int(row): AROUND.format(share=share[row]) for row in np.flatnonzero(lost)}
