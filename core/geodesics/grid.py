"""The thesis's graph (figure 6): every depth pixel joined to its eight neighbours, at Euclidean cost."""

from __future__ import annotations

import numba
import numpy as np

from core.errors import InputError
from core.geodesics.dijkstra import GraphSolver
from core.geodesics.meshes import DepthGridSurface, checked_mesh


@numba.njit(nogil=True, cache=True)
def _eight_neighbours(vertices, pixels, vertex_of_pixel, jump):  # type: ignore[no-untyped-def]
    n = vertices.shape[0]
    height, width = vertex_of_pixel.shape
    start = np.zeros(n + 1, np.uint32)
    neighbours = np.empty(8 * n, np.uint32)
    lengths = np.empty(8 * n, np.float32)
    total = 0
    for a in range(n):
        for dv in range(-1, 2):
            for du in range(-1, 2):
                u, v = pixels[a, 0] + du, pixels[a, 1] + dv
                if (du == 0 and dv == 0) or u < 0 or v < 0 or u >= width or v >= height:
                    continue
                b = vertex_of_pixel[v, u]
                if b < 0 or abs(vertices[a, 2] - vertices[b, 2]) > jump:
                    continue
                x = vertices[a, 0] - vertices[b, 0]
                y = vertices[a, 1] - vertices[b, 1]
                z = vertices[a, 2] - vertices[b, 2]
                neighbours[total] = b
                lengths[total] = np.sqrt(x * x + y * y + z * z)
                total += 1
        start[a + 1] = total
    return start, neighbours[:total].copy(), lengths[:total].copy()


def build_grid_solver(surface: DepthGridSurface, jump_m: float) -> GraphSolver:
    """Build the solver of `core.geodesics.grid_solver`."""
    vertices, triangles = checked_mesh(surface.vertices, surface.triangles)
    pixels = np.array(surface.pixels, dtype=np.int32, order="C")
    if pixels.shape != (len(vertices), 2):
        raise InputError(f"The surface has {len(vertices)} vertices but pixels of shape {pixels.shape}.")
    pixels -= pixels.min(axis=0) if len(pixels) else 0
    width, height = (pixels.max(axis=0) + 1).tolist() if len(pixels) else (1, 1)
    vertex_of_pixel = np.full((height, width), -1, dtype=np.int32)
    vertex_of_pixel[pixels[:, 1], pixels[:, 0]] = np.arange(len(pixels), dtype=np.int32)
    graph = _eight_neighbours(vertices, pixels, vertex_of_pixel, float(jump_m))
    return GraphSolver(vertices, triangles, graph)
