"""What the skeleton alone gives, without geodesics: yardsticks at the foot of the ladder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.relocation import MethodContext, MethodOutcome
from core.relocation.bones import bones, carry, nearest_bone, rigid_fit
from core.relocation.pair import PickedLesion, VisitPair
from core.relocation.types import Estimate

FloatArray = NDArray[np.float64]

RADIUS95_M = 0.2


class RigidAlignment:
    """The whole body moved as one stiff piece by its joints (Kabsch), then the nearest skin."""

    name = "rigid-alignment"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        rotation, translation = joint_alignment(pair)
        places = np.array([rotation @ p.point.position_m + translation for p in lesions])
        return on_skin(pair, places)


class NearestBone:
    """Every lesion moved with the bone nearest to it, then the nearest skin."""

    name = "nearest-bone"

    def estimate(
        self, pair: VisitPair, lesions: Sequence[PickedLesion], context: MethodContext
    ) -> MethodOutcome:
        """One estimate per lesion."""
        skeleton = bones(pair)
        if not skeleton:
            return MethodOutcome(tuple(Estimate(None, reason="The trunk was not found.") for _ in lesions))
        positions = [np.asarray(p.point.position_m) for p in lesions]
        places = np.array([carry(p, nearest_bone(p, skeleton)) for p in positions])
        return on_skin(pair, places)


def joint_alignment(pair: VisitPair) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and translation (3,) that take the first visit's joints onto the follow-up's best."""
    shared = set(pair.followup.skeleton.visible())
    both = [pair.joints_m(name) for name in pair.first.skeleton.visible() if name in shared]
    return rigid_fit(np.array([b[0] for b in both]), np.array([b[1] for b in both]))


def on_skin(pair: VisitPair, places: FloatArray) -> MethodOutcome:
    """Estimates at the follow-up's skin nearest to places (k, 3), with no radius worth the name."""
    surface = pair.followup.scan.surface
    return MethodOutcome(
        tuple(
            Estimate(point.position_m, radius95_m=RADIUS95_M, confidence=0.5)
            for point in surface.nearest(places)
        )
    )
