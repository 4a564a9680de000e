"""Compiled search for the nearest vertex through the depth image. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def _beyond(half_pixels: float, per_pixel: float, slope: float, z: float) -> float:
    """Distance of a point at depth z from all rays that lie so many pixels to one side of its own.

    Such rays are beyond a plane through the camera; ``slope`` is the larger one of the point's own.
    """
    step = half_pixels * per_pixel
    outer = slope + step
    return float(step * z / np.sqrt(1.0 + outer * outer))


@njit(cache=True, nogil=True)
def vertices_near(
    points: NDArray[np.float64],
    vertices: NDArray[np.float64],
    vertex_of_pixel: NDArray[np.int32],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    reach_m: float,
    out: NDArray[np.int64],
) -> None:
    """Exactly nearest vertex (k,) of each of ``points`` (k, 3) nearer than ``reach_m``, -1 where none is.

    Pixels are searched in square rings around a point's own. A vertex lies on its pixel's ray, so the search
    ends with the first ring whose rays all pass the point farther off than what was found. Points must lie
    before the camera; the lens must not distort.
    """
    height, width = vertex_of_pixel.shape
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        sx, sy = abs(x / z), abs(y / z)
        u0, v0 = round(x / z * fx + cx), round(y / z * fy + cy)
        best, square = -1, reach_m * reach_m
        ring = 0
        while ring <= max(max(u0, width - 1 - u0), max(v0, height - 1 - v0)):
            near = min(_beyond(ring - 0.5, 1.0 / fx, sx, z), _beyond(ring - 0.5, 1.0 / fy, sy, z))
            if ring > 0 and near * near >= square:
                break
            for v in range(max(v0 - ring, 0), min(v0 + ring, height - 1) + 1):
                full = v == v0 - ring or v == v0 + ring
                step = 1 if full or ring == 0 else 2 * ring
                for u in range(u0 - ring, u0 + ring + 1, step):
                    if u < 0 or u >= width:
                        continue
                    j = vertex_of_pixel[v, u]
                    if j < 0:
                        continue
                    dx, dy, dz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
                    d = dx * dx + dy * dy + dz * dz
                    if d < square:
                        best, square = j, d
            ring += 1
        out[i] = best
