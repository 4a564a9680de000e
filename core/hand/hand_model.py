"""All that is learned about hands: configurations, the tree that tells them apart, what the anchors are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from core.hand.anchors import AnchorKind
from core.hand.marker import DEFAULT_DICTIONARY
from core.hand.model import ConfigurationModel
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
