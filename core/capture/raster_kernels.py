"""Compiled z-buffer of a depth grid seen from another camera. Imported only when used."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def _draw(
    out: NDArray[np.float64],
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    cx: float,
    cy: float,
    cz: float,
) -> None:
    """Keep the nearest depth of one triangle; inverse depth is linear in the image."""
    height, width = out.shape
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < 1e-12:
        return
    x0, x1 = max(int(np.ceil(min(ax, bx, cx))), 0), min(int(np.floor(max(ax, bx, cx))), width - 1)
    y0, y1 = max(int(np.ceil(min(ay, by, cy))), 0), min(int(np.floor(max(ay, by, cy))), height - 1)
    slack = -1e-9
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            wb = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
            wc = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
            wa = 1.0 - wb - wc
            if wa < slack or wb < slack or wc < slack:
                continue
            z = 1.0 / (wa / az + wb / bz + wc / cz)
            if out[y, x] == 0.0 or z < out[y, x]:
                out[y, x] = z


@njit(cache=True, nogil=True)
def draw_grid(
    depth: NDArray[np.float64],
    pixels: NDArray[np.float64],
    seen_depth: NDArray[np.float64],
    jump_m: float,
    out: NDArray[np.float64],
) -> None:
    """Draw the quads of a depth grid (h, w) into a z-buffer ``out`` of the other camera (0 = nothing).

    ``pixels`` (h, w, 2) and ``seen_depth`` (h, w) say where each grid point lies in the other camera. Quads
    across a depth jump are not drawn; points fill what is left empty, so that nothing measured is lost.
    """
    h, w = depth.shape
    height, width = out.shape
    for v in range(h - 1):
        for u in range(w - 1):
            low, high, ok = np.inf, 0.0, True
            for dv in range(2):
                for du in range(2):
                    z = depth[v + dv, u + du]
                    ok = ok and z > 0.0 and seen_depth[v + dv, u + du] > 1e-3
                    ok = ok and np.isfinite(pixels[v + dv, u + du, 0])
                    low, high = min(low, z), max(high, z)
            if not ok or high - low > jump_m:
                continue
            for k in range(2):
                i, j = v + k, u + k
                _draw(
                    out,
                    pixels[i, j, 0],
                    pixels[i, j, 1],
                    seen_depth[i, j],
                    pixels[v, u + 1, 0],
                    pixels[v, u + 1, 1],
                    seen_depth[v, u + 1],
                    pixels[v + 1, u, 0],
                    pixels[v + 1, u, 1],
                    seen_depth[v + 1, u],
                )
    drawn = out.copy()
    for v in range(h):
        for u in range(w):
            if depth[v, u] > 0.0 and seen_depth[v, u] > 0.0 and np.isfinite(pixels[v, u, 0]):
                fx, fy = np.rint(pixels[v, u, 0]), np.rint(pixels[v, u, 1])
                if 0 <= fx < width and 0 <= fy < height:
                    x, y = int(fx), int(fy)
                    if drawn[y, x] == 0.0 and (out[y, x] == 0.0 or seen_depth[v, u] < out[y, x]):
                        out[y, x] = seen_depth[v, u]
