"""Segmentation and surface on depth pictures of a real hand: no truth, so only what was found is counted."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from core.capture.camera import PinholeCamera
from core.errors import InputError, WorkError
from core.hand.finding import find_hand
from core.hand.surface import cut_hand

UNIT_M: Final = 0.000125
"""Of the RealSense SR305's depth pictures."""

FOCAL_PX: Final = 476.0


@dataclass(frozen=True)
class RealHand:
    """One picture.

    Attributes
    ----------
    name : str
    distance_m : float
        Of the middle of the cut surface.
    vertices, triangles : int
        Of the surface.
    area_cm2 : float
    largest_part : float
        Share of the vertices in the largest connected part.
    ms : float
        By the clock, finding and cutting.
    fault : str or None
        Why there is no surface.
    """

    name: str
    distance_m: float = float("nan")
    vertices: int = 0
    triangles: int = 0
    area_cm2: float = 0.0
    largest_part: float = 0.0
    ms: float = float("nan")
    fault: str | None = None


def real_surfaces(folder: Path) -> list[dict[str, Any]]:
    """Find and cut the hand in every picture of a folder (PNG, 16 bit, steps of 0.125 mm).

    Raises
    ------
    InputError
        If there is no such picture.
    """
    paths = sorted(folder.glob("*.png"))
    if not paths:
        raise InputError(f"{folder}: there is no depth picture.")
    return [asdict(real_hand(path)) for path in paths]


def real_hand(path: Path) -> RealHand:
    """Find and cut the hand in one picture."""
    picture = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.dtype != np.uint16 or picture.ndim != 2:
        raise InputError(f"{path}: is no depth picture of 16 bits.")
    depth_m = picture * UNIT_M
    height, width = depth_m.shape
    camera = PinholeCamera(width, height, FOCAL_PX, FOCAL_PX, (width - 1) / 2, (height - 1) / 2)
    begun = time.perf_counter()
    try:
        surface = cut_hand(depth_m, camera, find_hand(depth_m, camera)).surface
    except WorkError as error:
        return RealHand(path.stem, fault=str(error))
    took_s = time.perf_counter() - begun
    corners = surface.vertices[surface.triangles]
    area = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return RealHand(
        path.stem,
        float(np.median(surface.vertices[:, 2])),
        len(surface.vertices),
        len(surface.triangles),
        float(1e4 * area.sum()),
        _largest_part(surface.triangles, len(surface.vertices)),
        1e3 * took_s,
    )


def _largest_part(triangles: np.ndarray[Any, np.dtype[np.int32]], count: int) -> float:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    one, other = triangles[:, (0, 1, 2)].ravel(), triangles[:, (1, 2, 0)].ravel()
    edges = coo_array((np.ones(len(one), bool), (one, other)), shape=(count, count))
    _, labels = connected_components(edges, directed=False)
    return float(np.bincount(labels).max() / count)
