"""What the hand tracker says about one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from core.hand.names import PAIRS, POINT_NAMES
from core.hand.surface import HandSurface

FloatArray = NDArray[np.float64]

_POINTS, _PAIRS = len(POINT_NAMES), len(PAIRS)


def _absent_points() -> FloatArray:
    return np.full((_POINTS, 3), np.nan)


@dataclass(frozen=True, eq=False)
class HandAnswer:
    """Where the 15 points are, or why they are not told.

    Attributes
    ----------
    configuration : str or None
        None if it is none of the learned ones, or the hand was not found.
    points_m : ndarray (15, 3)
        On the skin, depth-camera frame; NaN for a point that is hidden or too uncertain.
    pixels : ndarray (15, 2)
        The same in the picture (`CameraRig.picture_camera`).
    confidence : ndarray (15,)
        0 (not reported) to 1.
    error_m : ndarray (15,)
        How badly the point's distances agree with the model (RMS); NaN where there is no candidate. Told also
        for points that were left out because of it.
    anchors_m : ndarray (a, 3)
        Where the anchors were taken to be, NaN without any.
    marker_seen : bool
        Whether the marker (or, without one, the palm) was found in this very frame.
    reason : str or None
        A sentence for people: what is missing or less sure than usual.
    pair_m : ndarray (105,)
        Geodesic distances measured between the reported points (`names.PAIRS`).
    expected_pair_m : ndarray (105,)
        The model's, for a hand of the size and bend found.
    likelihood : dict of str to float
        Of every learned configuration; empty if none was judged.
    surface : HandSurface or None
    times_s : dict of str to float
        Time spent by step, for measurements of speed.
    """

    configuration: str | None = None
    points_m: FloatArray = field(default_factory=_absent_points)
    pixels: FloatArray = field(default_factory=lambda: np.full((_POINTS, 2), np.nan))
    confidence: FloatArray = field(default_factory=lambda: np.zeros(_POINTS))
    error_m: FloatArray = field(default_factory=lambda: np.full(_POINTS, np.nan))
    anchors_m: FloatArray = field(default_factory=lambda: np.full((4, 3), np.nan))
    marker_seen: bool = False
    reason: str | None = None
    pair_m: FloatArray = field(default_factory=lambda: np.full(_PAIRS, np.nan))
    expected_pair_m: FloatArray = field(default_factory=lambda: np.full(_PAIRS, np.nan))
    likelihood: dict[str, float] = field(default_factory=dict)
    surface: HandSurface | None = None
    times_s: dict[str, float] = field(default_factory=dict)

    @property
    def found(self) -> NDArray[np.bool_]:
        """Which points (15,) are told."""
        return np.asarray(np.isfinite(self.points_m).all(axis=1))
