"""Whether the moles of the follow-up are those of the first visit: the same person, the same limb.

Registered onto another person of like build, a body fits; its moles do not. On simulated patients the share
of visible moles that are matched beyond doubt was 0.83 to 1.00 for the same person, turned by up to 70
degrees or half a metre nearer, and 0.07 to 0.24 for another person of like size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.pair import VisitPair
from core.relocation.registration.start import SkeletonStart
from core.relocation.sight import look_at
from core.relocation.transfer import Transfer

LEAST_MOLES, LEAST_LIMB_MOLES = 12, 5
"""So many visible moles are needed to judge a person, and a limb."""
SURE_PERSON, DOUBTFUL_PERSON = 0.6, 0.4
DOUBTFUL_LIMB = 0.4
CLEAR_MOLE, SQUARE_ON = 0.5, 0.35

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
    """

    obstacle: str = ""
    warnings: tuple[str, ...] = ()
    doubtful: bool = False
    limbs: Mapping[int, str] | None = None

    def of_limb(self, bone: int) -> str:
        """Why a lesion on this bone carries no answer; empty when it does."""
        return (self.limbs or {}).get(bone, "")


def recognise(pair: VisitPair, transfer: Transfer) -> Recognition:
    """Judge person and limbs by the share of clear, visible moles that are matched beyond doubt."""
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
    limbs = _lost_limbs(transfer.start, transfer.start.owners.at(moles.places[rows]), sure)
    if share < SURE_PERSON:
        return Recognition("", (DOUBTFUL.format(share=share, count=len(rows)),), True, limbs)
    return Recognition(limbs=limbs)


def _lost_limbs(start: SkeletonStart, owner: NDArray[np.intp], sure: NDArray[np.bool_]) -> dict[int, str]:
    out = {}
    for number, bone in enumerate(start.bones):
        own = owner == number
        count = int(own.sum())
        if count >= LEAST_LIMB_MOLES and float(sure[own].mean()) < DOUBTFUL_LIMB:
            out[number] = LIMB.format(limb=bone.spoken, share=float(sure[own].mean()), count=count)
    return out
