"""The dense registration of a pair of captures, start to end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.relocation.pair import VisitPair
from core.relocation.registration.deformation import EmbeddedDeformation, Fit, Landmarks, Stage
from core.relocation.registration.graph import build_graph
from core.relocation.registration.start import SkeletonStart, skeleton_start

FloatArray = NDArray[np.float64]

FIRST_STAGES = (
    Stage(50.0, 0.10, 0.3, 5.0, 4),
    Stage(20.0, 0.06, 0.5, 1.0, 4),
    Stage(5.0, 0.04, 0.6, 0.2, 4),
)
"""Rest state: the skin as the skeleton carries it (METHOD section 3, stage 1)."""
SECOND_STAGES = (
    Stage(3.0, 0.03, 0.6, 0.05, 6, slip_m=0.005),
    Stage(3.0, 0.03, 0.7, 0.02, 5, slip_m=0.005),
)
"""Rest state: the first skin itself (stage 2)."""
NEAR_SKIN_M = 0.15


@dataclass(frozen=True, eq=False)
class DenseRegistration:
    """A fitted deformation with what it was made of."""

    deformation: EmbeddedDeformation
    start: SkeletonStart
    joints: Landmarks
    fit: Fit


def register_skins(pair: VisitPair, *, seed: int = 0) -> DenseRegistration | None:
    """Register the first skin to the follow-up's; None without a skeleton to start from."""
    start = skeleton_start(pair)
    if start is None:
        return None
    first, followup = pair.first.scan.surface, pair.followup.scan.surface
    deformation = EmbeddedDeformation(build_graph(first, start.bones, seed=seed), start)
    joints = joint_landmarks(pair)
    deformation.solve(followup, FIRST_STAGES, joints)
    deformation.return_to_rest()
    fit = deformation.solve(followup, SECOND_STAGES, joints)
    return DenseRegistration(deformation, start, joints, fit)


def joint_landmarks(pair: VisitPair) -> Landmarks:
    """The centres of the joints that both visits saw.

    The centres and not the skin before them: the skin nearest to a joint faces the camera in both visits, and
    would hold back every limb that turned about its axis.
    """
    names = pair.joint_names
    if not names:
        return Landmarks(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    both = [pair.joints_m(name) for name in names]
    return Landmarks(np.array([b[0] for b in both]), np.array([b[1] for b in both]), np.ones(len(names)))
