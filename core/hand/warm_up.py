"""Compile or load every kernel of the hand before its first frame."""

from __future__ import annotations

import numpy as np

from core.capture.camera import PinholeCamera
from core.hand.finding import find_hand
from core.hand.marker_edges import refine_corners
from core.hand.skin_patch import fit_patch
from core.hand.surface import cut_hand


def warm_up() -> None:
    """Run the way from a picture to a hand's surface once on a small made-up hand.

    A palm with a wrist: seconds on a fresh installation, where the kernels are compiled and cached, and a few
    milliseconds later on. Call it in a background thread.
    """
    camera = PinholeCamera(160, 120, 140.0, 140.0, 79.5, 59.5)
    u, v = np.meshgrid(np.arange(160) - 79.5, np.arange(120) - 59.5)
    hand = ((np.abs(u) < 12) & (np.abs(v + 15) < 14)) | ((np.abs(u) < 8) & (v > -15) & (v < 40))
    depth = np.where(hand, 0.6 + 0.0004 * np.abs(u), 0.0)
    cut_hand(depth, camera, find_hand(depth, camera), step_px=2)
    fit_patch(depth, camera, np.array([(68.0, 34.0), (90.0, 34.0), (90.0, 56.0), (68.0, 56.0)]), 0.6)
    square = np.full((60, 60), 230, np.uint8)
    square[15:45, 15:45] = 20
    refine_corners(square, np.array([(15.0, 15.0), (44.0, 15.0), (44.0, 44.0), (15.0, 44.0)]))
