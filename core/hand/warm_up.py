"""Compile or load every kernel of the hand before its first frame."""

from __future__ import annotations

import numpy as np

from core.capture.camera import PinholeCamera
from core.hand.fields import HandFields, measure_fields
from core.hand.finding import find_hand
from core.hand.fitting import fit_configuration
from core.hand.marker_edges import refine_corners
from core.hand.model import POINTS, LabelledFrame, learn_configuration
from core.hand.names import PAIRS
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
    surface = cut_hand(depth, camera, find_hand(depth, camera), step_px=2)
    _fit(measure_fields(surface, camera.backproject(depth)[(50, 50, 64, 64), (72, 88, 88, 72)]))
    fit_patch(depth, camera, np.array([(68.0, 34.0), (90.0, 34.0), (90.0, 56.0), (68.0, 56.0)]), 0.6)
    square = np.full((60, 60), 230, np.uint8)
    square[15:45, 15:45] = 20
    refine_corners(square, np.array([(15.0, 15.0), (44.0, 15.0), (44.0, 44.0), (15.0, 44.0)]))


def _fit(fields: HandFields) -> None:
    """Look for some of the vertices by their own distances."""
    vertices = np.linspace(0, len(fields.surface.vertices) - 1, POINTS).astype(np.int64)
    between = fields.solver.distances([int(v) for v in vertices])[:, vertices]
    pair_m = np.array([between[i, j] for i, j in PAIRS])
    frame = LabelledFrame("made up", fields.values_m[:, vertices].T, pair_m)
    model = learn_configuration("made up", [frame] * 3)
    fit_configuration(model, fields.surface.vertices, fields.values_m, fields.solver)
