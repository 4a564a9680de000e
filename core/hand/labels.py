"""What a person says about a frame: the configuration, and where the points are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from core.hand.names import POINT_NAMES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameLabels:
    """Labels of one frame.

    Attributes
    ----------
    configuration : str or None
        Free name; None if nobody said.
    points_m : dict of str to ndarray (3,)
        Points by name (`names.POINT_NAMES`), on the skin, depth-camera frame.
    visible : dict of str to bool
        Of those points; False for one whose place is known although the camera does not see it.
    """

    configuration: str | None = None
    points_m: Mapping[str, FloatArray] = field(default_factory=dict)
    visible: Mapping[str, bool] = field(default_factory=dict)

    def array(self, *, only_visible: bool = True) -> FloatArray:
        """Points (15, 3), NaN for those that are not labelled (or not visible)."""
        places = np.full((len(POINT_NAMES), 3), np.nan)
        for k, name in enumerate(POINT_NAMES):
            if name in self.points_m and (self.visible.get(name, True) or not only_visible):
                places[k] = self.points_m[name]
        return places
