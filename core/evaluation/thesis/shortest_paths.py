"""Figure 8: the same path by Dijkstra on the pixel graph and by fast marching on the Delaunay mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from core.anchors import AnalysedCapture
from core.capture.camera import PinholeCamera
from core.capture.rgbd import RgbdCapture
from core.errors import InputError, WorkError
from core.evaluation.thesis.frames import JUMP_M
from core.evaluation.thesis.measure import KINDS
from core.geodesics import GeodesicSolver
from core.relocation.field_store import FIELDS, nearest_corner
from core.surface import BodySurface, SurfacePoint
from core.surface.fusion import fuse_depth

FloatArray = NDArray[np.float64]

SYNTHETIC_CAMERA: Final = PinholeCamera(61, 41, 60.0, 60.0, 30.0, 20.0)
SYNTHETIC_Z_M: Final = 0.6
"""A grid of 61 x 41 pixels, 10 mm apart: 0.6 m x 0.4 m."""

WINDOW: Final = (220, 160)
"""Width and height in pixels of the middle of the depth image in which the wall is taken."""

WALL_RMS_M: Final = 0.03
"""What a wall may leave of a plane fit; raw Kinect depth leaves 8 mm at 2 m."""

BODY_PAIRS: Final = (
    ("right_hand", "left_foot"),
    ("left_hand", "right_knee"),
    ("right_elbow", "left_hip"),
    ("head", "left_knee"),
    ("left_shoulder", "right_hip"),
    ("neck", "torso"),
)
"""Ends of a body's paths, the first two that are connected are drawn."""


@dataclass(frozen=True, eq=False)
class PathPair:
    """One shortest path by both methods.

    Attributes
    ----------
    name : str
    dijkstra_m, fast_marching_m : ndarray (k, 3)
        Polylines, depth-camera frame.
    straight_m : float
        Length of the straight segment, which on a plane is the true path.
    """

    name: str
    dijkstra_m: FloatArray
    fast_marching_m: FloatArray
    straight_m: float

    @property
    def lengths_m(self) -> dict[str, float]:
        """Length of both polylines."""
        return {"DM": _length(self.dijkstra_m), "FMM": _length(self.fast_marching_m)}


@dataclass(frozen=True, eq=False)
class PathScene:
    """A surface and the paths on it."""

    surface: BodySurface
    paths: tuple[PathPair, ...]


def _length(path: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def path_pair(surface: BodySurface, start: int, end: int, name: str, straight_m: float) -> PathPair:
    """Shortest path between two vertices by both methods.

    Raises
    ------
    WorkError
        If they are not connected.
    """
    paths = {}
    for label, kind in KINDS.items():
        solver = FIELDS.solver(surface, kind)
        distances = solver.distances([start])[0]
        paths[label] = solver.path(distances, _at_vertex(solver, end), start)
    return PathPair(name, paths["DM"], paths["FMM"], straight_m)


def _at_vertex(solver: GeodesicSolver, vertex: int) -> SurfacePoint:
    rows, corners = np.nonzero(solver.triangles == vertex)
    if len(rows) == 0:
        raise WorkError("No path joins the two points: one lies on no triangle.")
    weights = np.zeros(3)
    weights[corners[0]] = 1.0
    return SurfacePoint(int(rows[0]), weights, solver.vertices[vertex])


def synthetic_plane() -> PathScene:
    """Figure 8 (a): a flat grid. Graph paths turn by 45 degrees only, fronts cross faces."""
    depth = np.full((SYNTHETIC_CAMERA.height, SYNTHETIC_CAMERA.width), SYNTHETIC_Z_M)
    surface = BodySurface.from_depth(depth, SYNTHETIC_CAMERA)
    start, end = surface.vertex_of_pixel[32, 6], surface.vertex_of_pixel[12, 54]
    straight = float(np.linalg.norm(surface.vertices[start] - surface.vertices[end]))
    return PathScene(surface, (path_pair(surface, int(start), int(end), "synthetic plane", straight),))


def wall_plane(capture: RgbdCapture) -> PathScene:
    """Figure 8 (b): the middle of one raw depth frame of a wall.

    The straight length is measured in the plane fitted to it.

    Raises
    ------
    InputError
        If the middle of the image does not show a plane.
    """
    camera = capture.rig.depth
    depth = fuse_depth(capture.depth_frames[:1], capture.depth_unit_m).depth_m
    width, height = (min(a, b) for a, b in zip(WINDOW, (camera.width, camera.height), strict=True))
    left, top = (camera.width - width) // 2, (camera.height - height) // 2
    middle = np.zeros_like(depth)
    middle[top : top + height, left : left + width] = depth[top : top + height, left : left + width]
    surface = BodySurface.from_depth(middle, camera, jump_m=JUMP_M)
    center, normal, rms = _fitted_plane(surface.vertices)
    if rms > WALL_RMS_M:
        raise InputError(
            f"The middle of the wall capture is not flat: it leaves a plane by {1000 * rms:.0f} mm.",
            "Record a bare wall, 1 to 3 m away, filling the middle of the depth image.",
        )
    vertices = np.flatnonzero(surface.component == 0)
    pixels = surface.pixels[vertices]
    ends = []
    for share_u, share_v in ((0.1, 0.72), (0.9, 0.28)):
        wanted = np.array([left + share_u * width, top + share_v * height])
        ends.append(int(vertices[((pixels - wanted) ** 2).sum(axis=1).argmin()]))
    flat = surface.vertices[ends] - np.outer((surface.vertices[ends] - center) @ normal, normal)
    straight = float(np.linalg.norm(flat[1] - flat[0]))
    return PathScene(surface, (path_pair(surface, ends[0], ends[1], "wall", straight),))


def _fitted_plane(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Centre, unit normal and RMS distance of a plane through points (n, 3); gross outliers left out."""
    used = points
    for _ in range(3):
        center = used.mean(axis=0)
        _, _, axes = np.linalg.svd(used - center, full_matrices=False)
        off = (points - center) @ axes[2]
        rms = float(np.sqrt(np.median(off**2)) / 0.6745)
        used = points[np.abs(off) < max(3.0 * rms, 1e-6)]
    return center, axes[2], rms


def body_paths(analysed: AnalysedCapture, count: int = 2) -> PathScene:
    """Figure 8 (c): paths between joints over a body's raw surface.

    Raises
    ------
    WorkError
        If no two joints are connected.
    """
    surface = analysed.scan.surface
    reliable = {a.name for a in analysed.anchors.anchors if a.reliable}
    paths: list[PathPair] = []
    for start, end in BODY_PAIRS:
        if len(paths) == count:
            break
        if start not in reliable or end not in reliable:
            continue
        a, b = (nearest_corner(surface, analysed.anchors[name].point) for name in (start, end))
        straight = float(np.linalg.norm(surface.vertices[a] - surface.vertices[b]))
        try:
            name = f"{start} to {end}".replace("_", " ")
            paths.append(path_pair(surface, a, b, name, straight))
        except WorkError:
            continue  # an arm that is cut off from the trunk: the next pair may be connected
    if not paths:
        raise WorkError("No two joints of the body are connected by skin; figure 8 cannot be drawn on it.")
    return PathScene(surface, tuple(paths))
