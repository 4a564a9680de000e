"""A hand followed from frame to frame: anchors, surface, configuration, points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.capture.rgbd import CameraRig
from core.errors import WorkError
from core.geodesics import geodesic_solver
from core.hand.anchors import AnchorFinder
from core.hand.answer import HandAnswer
from core.hand.fitting import fit_configuration
from core.hand.hand_model import HandModel
from core.hand.surface import cut_hand

FloatArray = NDArray[np.float64]

Refinement = Literal["joint", "sequential"]


@dataclass(frozen=True)
class TrackingOptions:
    """How a hand is followed.

    Attributes
    ----------
    refinement : {"joint", "sequential"}
        All points solved together, or the thesis's eq. 7, point after point.
    threshold_m : float
        A point whose distances disagree with the model by more is not reported.
    lost_frames : int
        For how many frames the marker may be lost.
    configuration : str or None
        Known beforehand; otherwise it is judged.
    """

    refinement: Refinement = "joint"
    threshold_m: float = 0.012
    lost_frames: int = 10
    configuration: str | None = None


class HandTracker:
    """Follows one hand. `track` is called with frames in their order; not thread safe.

    Parameters
    ----------
    model : HandModel
    rig : CameraRig
    finder : AnchorFinder
        Of the kind that the model was learned with (`core.hand.finders.finder_for`).
    options : TrackingOptions, optional
    """

    def __init__(
        self, model: HandModel, rig: CameraRig, finder: AnchorFinder, options: TrackingOptions | None = None
    ) -> None:
        self._model, self._rig, self._finder = model, rig, finder
        self._options = options or TrackingOptions()

    def reset(self) -> None:
        """Forget the frames before: the next one is the first."""

    def track(self, depth_m: FloatArray, rgb: NDArray[np.uint8] | None) -> HandAnswer:
        """Find the points in the next frame.

        Parameters
        ----------
        depth_m : ndarray (h, w)
            Metres, 0 for no measurement.
        rgb : ndarray (h', w', 3) uint8 or None
        """
        anchors = self._finder.find(rgb, depth_m, self._rig)
        if not anchors.seen:
            return HandAnswer(reason=anchors.reason)
        try:
            hand = cut_hand(depth_m, self._rig.depth, anchors.places_m, step_px=2)
        except WorkError as error:
            return HandAnswer(marker_seen=True, reason=str(error), anchors_m=anchors.places_m)
        surface = hand.surface
        solver = geodesic_solver(surface.vertices, surface.triangles)
        distances = solver.distances(surface.nearest(anchors.places_m))
        fits = [
            fit_configuration(model, surface.vertices, distances, solver)
            for model in self._model.configurations.values()
        ]
        best = min(fits, key=lambda fit: fit.cost)
        return HandAnswer(
            configuration=best.configuration,
            points_m=best.points_m,
            pixels=self._rig.project_to_picture(best.points_m),
            confidence=np.where(np.isfinite(best.anchor_error_m), 0.5, 0.0),
            error_m=best.anchor_error_m,
            anchors_m=anchors.places_m,
            marker_seen=True,
            surface=hand,
        )
