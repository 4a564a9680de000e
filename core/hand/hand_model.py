"""All that is learned about hands: configurations, the tree that tells them apart, what the anchors are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.hand.anchors import AnchorKind
from core.hand.marker import DEFAULT_DICTIONARY
from core.hand.model import OWN_FIELDS, POINTS, ConfigurationModel
from core.hand.tree import ConfigurationTree

DEFAULT_MARKER_M = 0.036


@dataclass(frozen=True, eq=False)
class HandModel:
    """What `geoderm hand train` makes and `geoderm hand track` takes; never changed after making.

    Attributes
    ----------
    configurations : dict of str to ConfigurationModel
    tree : ConfigurationTree or None
        None with a single configuration: there is nothing to tell apart.
    anchors : {"marker", "palm"}
    marker_m : float
        Side of the marker's black square.
    dictionary : str
        Of ArUco.
    """

    configurations: Mapping[str, ConfigurationModel]
    tree: ConfigurationTree | None
    anchors: AnchorKind = "marker"
    marker_m: float = DEFAULT_MARKER_M
    dictionary: str = DEFAULT_DICTIONARY

    @cached_property
    def toward_fingers(self) -> NDArray[np.float64]:
        """Weights (a,) of the anchors, zero in sum, that point from their middle to the fingers.

        Anchors nearer to the points weigh more: of squared distances to a place, those from anchors that lie
        toward it are smaller in proportion.
        """
        squares = []
        for one in self.configurations.values():
            of_points = one.mean_m[: POINTS * one.fields].reshape(POINTS, one.fields)[:, :-OWN_FIELDS]
            squares.append(np.nanmean(of_points**2, axis=0))
        mean = np.mean(squares, axis=0)
        return np.asarray(mean.mean() - mean)
