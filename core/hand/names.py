"""The 15 points of a hand and how they hang together."""

from __future__ import annotations

from itertools import combinations
from typing import Final

FINGERS: Final = ("thumb", "index", "middle", "ring", "little")

POINT_NAMES: Final[tuple[str, ...]] = (
    "thumb_tip",
    "thumb_ip",
    "thumb_mcp",
    *(f"{finger}_{part}" for finger in FINGERS[1:] for part in ("tip", "pip", "mcp")),
)
"""A point lies on the dorsal skin over its joint; a tip is the nail, at 80 % of the last phalanx."""

POINT_INDEX: Final = {name: k for k, name in enumerate(POINT_NAMES)}

FINGER_OF: Final = tuple(FINGERS.index(name.split("_")[0]) for name in POINT_NAMES)
"""Number of the finger of each point."""

PAIRS: Final = tuple(combinations(range(len(POINT_NAMES)), 2))
"""The 105 pairs of points, in the order in which distances between points are kept."""

BONES: Final = tuple((3 * finger + 1, 3 * finger) for finger in range(5)) + tuple(
    (3 * finger + 2, 3 * finger + 1) for finger in range(5)
)
"""Pairs of neighbouring points of one finger: what is drawn as a bone."""

KNUCKLES: Final = tuple(3 * finger + 2 for finger in range(5))
"""The points nearest to the wrist, thumb first."""


def spoken(name: str) -> str:
    """The name of a point for people: ``index_pip`` is "index finger, middle joint"."""
    finger, part = name.split("_")
    finger = finger if finger == "thumb" else f"{finger} finger"
    return f"{finger}, {_PARTS[part]}"


_PARTS: Final = {"tip": "nail", "ip": "end joint", "pip": "middle joint", "mcp": "knuckle"}
