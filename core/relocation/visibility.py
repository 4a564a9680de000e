"""Whether the skeleton says that a place of the first visit is turned away from the follow-up's camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.relocation.bones import Bone, carry, nearest_bone
from core.relocation.pair import PickedLesion

FloatArray = NDArray[np.float64]

TRUNK_COSINE = -0.25
LIMB_COSINE = -0.6
"""Cosine between skin normal and the way to the camera below which skin is turned away. Limbs twist about
their own axis, which the skeleton does not show: they need stronger evidence."""


def turned_away(lesion: PickedLesion, bones: tuple[Bone, ...]) -> str:
    """Why the lesion cannot be seen by its bone's orientation; empty when it can."""
    if not bones:
        return ""
    place = np.asarray(lesion.point.position_m)
    bone = nearest_bone(place, bones)
    moved = carry(place, bone)
    normal = bone.rotation @ lesion.normal
    cosine = float(-(normal @ moved) / np.linalg.norm(moved))
    if cosine < (TRUNK_COSINE if bone.name == "trunk" else LIMB_COSINE):
        return "The skin there is turned away from the camera."
    return ""
