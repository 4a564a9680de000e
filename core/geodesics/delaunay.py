"""The thesis's mesh for fast marching (figure 7): a Delaunay triangulation of the depth pixels."""

from __future__ import annotations

import numpy as np

from core.errors import WorkError
from core.geodesics.meshes import DepthGridSurface, IntArray


def delaunay_mesh(surface: DepthGridSurface, *, jump_m: float = 0.05, reach_px: float = 2.0) -> IntArray:
    """Triangles (m, 3) int32 of the Delaunay triangulation of a surface's depth pixels.

    Triangles across a depth jump, or across a gap in the image, are removed: they join what does not touch.

    Parameters
    ----------
    surface : DepthGridSurface
        Its vertices keep their numbers, so distances on either mesh can be compared.
    jump_m : float
        Largest depth difference inside a triangle, metres.
    reach_px : float
        Longest edge in the image, pixels.
    """
    from scipy.spatial import Delaunay, QhullError

    pixels = np.asarray(surface.pixels, dtype=np.float64)
    try:
        triangles = Delaunay(pixels).simplices.astype(np.int32)
    except (QhullError, ValueError) as error:
        raise WorkError(
            f"The {len(pixels)} depth pixels of the body cannot be triangulated.",
            "Capture again with the whole body in view.",
        ) from error
    depth = np.asarray(surface.vertices)[:, 2][triangles]
    corners = pixels[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    keep = (np.ptp(depth, axis=1) <= jump_m) & (longest <= reach_px)
    kept: IntArray = np.ascontiguousarray(triangles[keep])
    return kept
