"""The kinds of anchors there are, by name."""

from __future__ import annotations

from core.errors import InputError
from core.hand.anchors import AnchorFinder
from core.hand.hand_model import HandModel
from core.hand.landmarks import HandDetector
from core.hand.marker_anchors import MarkerAnchors
from core.hand.palm_anchors import PalmAnchors


def finder_for(model: HandModel, detector: HandDetector | None = None) -> AnchorFinder:
    """What finds the anchors that a model was learned with.

    Parameters
    ----------
    model : HandModel
    detector : HandDetector, optional
        Needed by models without a marker.

    Raises
    ------
    InputError
        If there is no such kind of anchor, or the detector it needs was not given.
    """
    if model.anchors == "marker":
        return MarkerAnchors(model.marker_m, model.dictionary)
    if model.anchors == "palm":
        if detector is None:
            raise InputError(
                "The model was learned with the palm's landmarks: it needs a hand detector.",
                "Give one, or learn a model with a marker.",
            )
        return PalmAnchors(detector)
    raise InputError(f"There are no anchors of the kind '{model.anchors}'.")
