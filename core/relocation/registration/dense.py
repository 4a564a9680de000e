"""The dense registration of a pair of captures, start to end."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from core.relocation.pair import VisitPair
from core.relocation.registration.deformation import EmbeddedDeformation, Fit, Landmarks, Stage
from core.relocation.registration.graph import SkinNet, build_graph, skin_net
from core.relocation.registration.start import SkeletonStart, skeleton_start
from core.relocation.trilateration import vertex_areas

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

MATCH_STAGES = (Stage(10.0, 0.05, 0.5, 0.05, 4), *SECOND_STAGES)
"""Once more from the present state, drawn by matched places."""


class DenseRegistration:
    """The registration of a pair of captures; may be solved again as places become known.

    Parameters
    ----------
    pair : VisitPair
    net : SkinNet
        Of the first skin.
    start : SkeletonStart
    seed : int
        Of the choice of nodes.
    """

    def __init__(self, pair: VisitPair, net: SkinNet, start: SkeletonStart, *, seed: int = 0) -> None:
        self.start = start
        self._target = pair.followup.scan.surface
        self._joints = joint_landmarks(pair)
        graph = build_graph(net, start.owners, seed=seed)
        self.deformation = EmbeddedDeformation(graph, start)
        self.deformation.solve(self._target, FIRST_STAGES, self._joints)
        self.deformation.return_to_rest()
        self.fit: Fit = self.deformation.solve(self._target, SECOND_STAGES, self._joints)

    @cached_property
    def seen_radius_m(self) -> float:
        """Radius of a disc as large as the follow-up's seen skin."""
        return float(np.sqrt(vertex_areas(self._target.vertices, self._target.triangles).sum() / np.pi))

    def draw(self, landmarks: Landmarks) -> None:
        """Solve again with places of the first skin whose place on the follow-up is known."""
        self.fit = self.deformation.solve(self._target, MATCH_STAGES, self._joints, landmarks)


def register_skins(pair: VisitPair, *, seed: int = 0) -> DenseRegistration | None:
    """Register the first skin to the follow-up's; None without a trunk to start from."""
    net = skin_net(pair.first.scan.surface)
    start = skeleton_start(pair, net.places, net.edges)
    return None if start is None else DenseRegistration(pair, net, start, seed=seed)


def one_linear_algebra_thread() -> AbstractContextManager[object]:
    """Around a whole registration: its systems are small, and threads would only wait for each other.

    Measured on two busy cores: 7.6 ms a solution with one thread, 340 ms with two.
    """
    limited: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limited


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


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
