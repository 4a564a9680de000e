"""Anchors and skin of a hand in one frame: what clicks are put on. No Qt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.workflows.hand_rows import HandShot
from core.errors import WorkError
from core.hand.anchors import AnchorFinder
from core.hand.surface import HandSurface, cut_hand

FloatArray = NDArray[np.float64]

NEAR_PX = 5.0
"""So far beside the skin's edge a click still means the skin: fingertips are at the edge."""

OFF_THE_HAND = "That is not on the hand. Click on its skin, or skip the point if it is hidden."


@dataclass(frozen=True, eq=False)
class FrameSkin:
    """See the module's documentation.

    Attributes
    ----------
    anchors_m : ndarray (a, 3)
        NaN where none was found.
    seen : bool
        Whether the anchors were found.
    surface : HandSurface or None
    pixels : ndarray (n, 2)
        Of the surface's vertices in the picture.
    reason : str
        Why there is no skin, or what is wrong with the anchors; empty if all is well.
    """

    anchors_m: FloatArray
    seen: bool
    surface: HandSurface | None
    pixels: FloatArray
    reason: str = ""

    def pick(self, shot: HandShot, u: float, v: float) -> FloatArray | None:
        """The place (3,) on the skin under a picture pixel; None beside the hand."""
        if self.surface is None:
            return None
        skin = self.surface.surface
        origin, directions = shot.rig.picture_rays(np.array([[u, v]]))
        hits = skin.raycast(origin, directions)
        if hits.hit[0]:
            return np.asarray(origin + float(hits.t[0]) * directions[0])
        squared = ((self.pixels - (u, v)) ** 2).sum(axis=1)
        nearest = int(np.nanargmin(squared))
        return skin.vertices[nearest].copy() if squared[nearest] <= NEAR_PX**2 else None


def look_at(shot: HandShot, finder: AnchorFinder, *, step_px: int = 1) -> FrameSkin:
    """Find anchors and skin in a frame.

    Parameters
    ----------
    shot : HandShot
    finder : AnchorFinder
    step_px : int
        Every so many pixels of depth become a vertex.
    """
    depth_m = shot.depth_m
    found = finder.find(shot.rgb, depth_m, shot.rig)
    nothing = np.zeros((0, 2))
    if not found.seen:
        return FrameSkin(found.places_m, False, None, nothing, found.reason or "No marker is in view.")
    try:
        hand = cut_hand(depth_m, shot.rig.depth, found.places_m, step_px=step_px)
    except WorkError as error:
        return FrameSkin(found.places_m, True, None, nothing, str(error))
    skin = hand.surface
    if not len(skin.vertices):
        return FrameSkin(found.places_m, True, None, nothing, "No skin was measured around the marker.")
    _ = skin.tree  # built here and not at the first click
    return FrameSkin(
        found.places_m, True, hand, shot.rig.project_to_picture(skin.vertices), found.reason or ""
    )
