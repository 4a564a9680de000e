"""Figure 8 as pictures: Dijkstra red, fast marching green."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from core.evaluation.thesis.canvas import METHOD_COLOR, new_figure, quiet, save, styled
from core.evaluation.thesis.shortest_paths import PathPair, PathScene
from core.geodesics import delaunay_mesh
from core.surface import BodySurface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

ZOOM_PX = (44, 22)
"""Width and height of the zoomed part of the wall, depth pixels."""

BODY_ZOOM_PX = (26, 40)

_LIGHT = np.array([-0.4, -0.6, -0.7])


def draw_planes(synthetic: PathScene, wall: PathScene, wall_label: str, path: Path) -> Path:
    """Synthetic plane, the wall, and the zoom into the wall."""
    with styled():
        figure = new_figure(10.5, 7.4)
        grid = figure.add_gridspec(2, 2, width_ratios=(1.2, 1.0))
        left, right = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
        _draw_synthetic(left, synthetic)
        _draw_wall(right, wall, wall_label)
        zoom = figure.add_subplot(grid[1, :])
        _draw_zoom(zoom, wall, zoom_center(wall, ZOOM_PX), ZOOM_PX)
        zoom.set_title(
            "Zoom into the yellow frame of (b): Dijkstra steps from pixel to pixel,\n"
            "fast marching crosses the faces of the Delaunay mesh",
            loc="left",
            fontsize=9,
        )
        left.legend(loc="lower left", fontsize=8, frameon=True, framealpha=0.9)
    return save(figure, path)


def draw_body(scene: PathScene, label: str, path: Path) -> Path:
    """Paths over a body, and a zoom into the first of them."""
    surface = scene.surface
    low, high = surface.pixels.min(axis=0) - 6, surface.pixels.max(axis=0) + 6
    with styled():
        figure = new_figure(9.6, 7.0)
        whole, zoom = figure.subplots(1, 2, width_ratios=(1.45, 1.0))
        whole.imshow(shaded(surface), cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
        quiet(whole)
        for number, pair in enumerate(scene.paths):
            _draw_pair(whole, surface, pair, named=number == 0)
        whole.set_xlim(low[0], high[0])
        whole.set_ylim(high[1], low[1])
        figure.legend(loc="outside lower left", ncols=2, fontsize=8)
        names = "\n".join(_lengths(pair) for pair in scene.paths)
        whole.set_title(f"(c) Body, {label}\n{names}", loc="left", fontsize=9)
        at = zoom_center(scene, BODY_ZOOM_PX)
        _frame(whole, at, BODY_ZOOM_PX)
        _draw_zoom(zoom, scene, at, BODY_ZOOM_PX)
        zoom.set_title("Zoom into the yellow frame:\npixels and Delaunay mesh", loc="left", fontsize=9)
    return save(figure, path)


def shaded(surface: BodySurface) -> FloatArray:
    """Picture (h, w) of a surface lit from above left; NaN where there is none."""
    image = np.full(surface.vertex_of_pixel.shape, np.nan)
    light = surface.normals @ (_LIGHT / np.linalg.norm(_LIGHT))
    u, v = surface.pixels.T
    image[v, u] = 0.58 + 0.36 * np.clip(light, 0.0, 1.0)
    return image


def _draw_synthetic(axes: Axes, scene: PathScene) -> None:
    surface, (pair,) = scene.surface, scene.paths
    x, y = 1000.0 * surface.vertices[:, 0], 1000.0 * surface.vertices[:, 1]
    axes.plot(x, y, ".", color="0.78", markersize=1.2)
    for label, line in _lines(pair).items():
        axes.plot(
            1000 * line[:, 0], 1000 * line[:, 1], color=METHOD_COLOR[label], label=_legend(label), lw=1.8
        )
    ends = 1000.0 * pair.dijkstra_m[[0, -1]]
    axes.plot(ends[:, 0], ends[:, 1], "ko", markersize=5)
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    axes.set_title(f"(a) Synthetic plane, points 10 mm apart\n{_lengths(pair)}", loc="left")


def _draw_wall(axes: Axes, scene: PathScene, label: str) -> None:
    surface, (pair,) = scene.surface, scene.paths
    axes.imshow(shaded(surface), cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest")
    _draw_pair(axes, surface, pair, named=True)
    low, high = surface.pixels.min(axis=0), surface.pixels.max(axis=0)
    axes.set_xlim(low[0] - 1, high[0] + 1)
    axes.set_ylim(high[1] + 1, low[1] - 1)
    _frame(axes, zoom_center(scene, ZOOM_PX), ZOOM_PX)
    quiet(axes)
    axes.set_title(f"(b) Kinect plane, {label}\n{_lengths(pair)}", loc="left", fontsize=9)


def _frame(axes: Axes, at: FloatArray, size: tuple[int, int]) -> None:
    from matplotlib.patches import Rectangle

    corner = (at[0] - size[0] / 2, at[1] - size[1] / 2)
    axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor="#e6a700", linewidth=1.8))


def _draw_zoom(axes: Axes, scene: PathScene, at: FloatArray, size: tuple[int, int]) -> None:
    from matplotlib.ticker import MaxNLocator

    _draw_mesh(axes, scene.surface, at, size)
    for pair in scene.paths:
        _draw_pair(axes, scene.surface, pair, width=2.2)
    axes.set_xlim(at[0] - size[0] / 2, at[0] + size[0] / 2)
    axes.set_ylim(at[1] + size[1] / 2, at[1] - size[1] / 2)
    axes.set_aspect("equal")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("depth pixel, column")
    axes.set_ylabel("row")


def zoom_center(scene: PathScene, size: tuple[int, int]) -> FloatArray:
    """Pixel (2,) to zoom at: where the first pair of paths lies widest apart, yet both fit into ``size``."""
    from scipy.spatial import cKDTree

    pair, camera = scene.paths[0], scene.surface.camera
    red, green = camera.project(pair.dijkstra_m), camera.project(pair.fast_marching_m)
    gap, nearest = cKDTree(green).query(red)
    gap[gap > 0.45 * min(size)] = -1.0
    margin = max(1, len(gap) // 8)
    gap[:margin] = gap[-margin:] = -1.0
    row = int(gap.argmax())
    return np.asarray(np.rint(0.5 * (red[row] + green[nearest[row]])))


def _draw_mesh(axes: Axes, surface: BodySurface, at: FloatArray, size: tuple[int, int]) -> None:
    from matplotlib.collections import LineCollection

    inside = np.abs(surface.pixels - at) <= np.array(size) / 2 + 1
    near: NDArray[np.bool_] = np.asarray(inside.all(axis=1))
    triangles = delaunay_mesh(surface)
    triangles = triangles[near[triangles].all(axis=1)]
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    lines = surface.pixels[edges].astype(np.float64)
    axes.add_collection(LineCollection(list(lines), colors="0.72", linewidths=0.5))
    axes.plot(*surface.pixels[near].T, ".", color="0.45", markersize=2)


def _draw_pair(
    axes: Axes, surface: BodySurface, pair: PathPair, *, named: bool = False, width: float = 1.6
) -> None:
    for label, line in _lines(pair).items():
        pixels = surface.camera.project(line)
        axes.plot(*pixels.T, color=METHOD_COLOR[label], lw=width, label=_legend(label) if named else None)
    ends = surface.camera.project(pair.dijkstra_m[[0, -1]])
    axes.plot(*ends.T, "o", color="#ffd000", markeredgecolor="k", markersize=5)


def _lines(pair: PathPair) -> dict[str, FloatArray]:
    return {"DM": pair.dijkstra_m, "FMM": pair.fast_marching_m}


def _legend(label: str) -> str:
    return {"DM": "Dijkstra (DM)", "FMM": "Fast marching (FMM)"}[label]


def _lengths(pair: PathPair) -> str:
    told = ", ".join(f"{label} {1000 * length:.1f} mm" for label, length in pair.lengths_m.items())
    if pair.name in ("synthetic plane", "wall"):
        return f"straight {1000 * pair.straight_m:.1f} mm, {told}"
    return f"{pair.name}: {told}"
