"""The skin as a triangle mesh on the depth grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.capture.camera import PinholeCamera
from core.errors import WorkError
from core.surface.points import SurfacePoint
from core.surface.raycast import GridTree, RayHits
from core.surface.threads import in_chunks

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

DEFAULT_JUMP_M = 0.03
_SMALLEST_PART = 60
_LEAST_DEPTH_M = 0.05
_CHUNK = 2048


@dataclass(frozen=True, eq=False)
class BodySurface:
    """Triangles over neighbouring depth pixels, in the depth camera's frame. Immutable.

    Every edge has at most two triangles and every vertex one fan of them: it is a surface with rim, possibly
    in several parts.

    Attributes
    ----------
    vertices : ndarray (n, 3)
        Metres.
    triangles : ndarray (m, 3) int32
        Wound to face the camera.
    normals : ndarray (n, 3)
        Unit, toward the camera.
    pixels : ndarray (n, 2) int32
        Depth pixel (u, v) of each vertex.
    vertex_of_pixel : ndarray (h, w) int32
        -1 where there is none.
    boundary : ndarray (n,) bool
        Whether the vertex lies on the rim.
    component : ndarray (n,) int32
        Connected part, 0 the largest.
    camera : PinholeCamera
        The depth camera.
    """

    vertices: FloatArray
    triangles: IntArray
    normals: FloatArray
    pixels: IntArray
    vertex_of_pixel: IntArray
    boundary: NDArray[np.bool_]
    component: IntArray
    camera: PinholeCamera

    @classmethod
    def from_depth(
        cls,
        depth_m: ArrayLike,
        camera: PinholeCamera,
        *,
        jump_m: float = DEFAULT_JUMP_M,
        smallest_part: int = _SMALLEST_PART,
    ) -> BodySurface:
        """Triangulate a depth image, normally denoised and masked to the body.

        Parameters
        ----------
        depth_m : ndarray (h, w)
            Metres; 0 means no measurement.
        jump_m : float
            Triangles over a larger depth difference are left out.
        smallest_part : int
            Connected parts with fewer vertices are left out.

        Raises
        ------
        WorkError
            If no triangle is left.
        """
        from core.surface.mesh_kernels import (
            corners_of_vertices,
            mark_bow_ties,
            normals_and_boundary,
            triangulate_grid,
            vertex_components,
        )

        points = np.ascontiguousarray(camera.backproject(depth_m).reshape(-1, 3))
        triangles = triangulate_grid(points, camera.height, camera.width, jump_m)
        triangles, used = _compact(triangles, len(points))
        alive = np.ones(len(triangles), np.bool_)
        while mark_bow_ties(triangles, len(used), alive):
            triangles, alive = triangles[alive], alive[alive]
        component = vertex_components(triangles, len(used))
        keep = np.bincount(component, minlength=1)[component] >= smallest_part
        triangles, kept = _compact(triangles[keep[triangles[:, 0]]], len(used))
        used, component = used[kept], component[kept]
        if len(triangles) == 0:
            raise WorkError(
                "The depth image holds no connected surface.",
                "Check that the person stands 1 to 3 m from the camera and that the lens is clean.",
            )
        vertices = np.ascontiguousarray(points[used])
        start, rows = corners_of_vertices(triangles, len(vertices))
        normals, boundary = np.zeros_like(vertices), np.zeros(len(vertices), np.bool_)
        normals_and_boundary(vertices, triangles, start, rows, normals, boundary)
        vertex_of_pixel = np.full(len(points), -1, np.int32)
        vertex_of_pixel[used] = np.arange(len(used), dtype=np.int32)
        return cls(
            vertices=vertices,
            triangles=triangles,
            normals=normals,
            pixels=np.stack([used % camera.width, used // camera.width], axis=1).astype(np.int32),
            vertex_of_pixel=vertex_of_pixel.reshape(camera.height, camera.width),
            boundary=boundary,
            component=component,
            camera=camera,
        )

    @cached_property
    def tree(self) -> GridTree:
        """The structure behind `raycast` and `nearest`, built on first use."""
        return GridTree(self.vertices, self.triangles, self.pixels)

    @cached_property
    def _vertex_tree(self) -> cKDTree:
        from scipy.spatial import cKDTree

        return cKDTree(self.vertices)

    def raycast(self, origin: ArrayLike, directions: ArrayLike) -> RayHits:
        """First hits of rays from ``origin`` (3,) along ``directions`` (k, 3), in the surface's frame."""
        return self.tree.cast(origin, directions)

    def nearest(self, points: ArrayLike) -> list[SurfacePoint]:
        """The surface point nearest to each of ``points`` (k, 3)."""
        found = zip(*self.nearest_arrays(points), strict=True)
        return [SurfacePoint(int(triangle), weights, place) for triangle, weights, place in found]

    def nearest_arrays(self, points: ArrayLike) -> tuple[IntArray, FloatArray, FloatArray]:
        """Triangles (k,), corner weights (k, 3) and places (k, 3) of the points nearest to (k, 3) others.

        As `nearest`, for many points.
        """
        triangles, weights = self.tree.nearest(points)
        return triangles, weights, np.einsum("ki,kij->kj", weights, self.vertices[self.triangles[triangles]])

    def nearest_vertex(self, points: ArrayLike) -> NDArray[np.int64]:
        """Index (k,) of the vertex nearest to each of ``points`` (k, 3)."""
        p = np.asarray(points, dtype=float).reshape(-1, 3)
        return np.asarray(self._vertex_tree.query(p)[1], dtype=np.int64)

    def vertices_within(self, points: ArrayLike, reach_m: float) -> NDArray[np.int64]:
        """Index (k,) of the vertex nearest to each of ``points`` (k, 3); -1 where none is within reach."""
        p = np.ascontiguousarray(np.asarray(points, dtype=float).reshape(-1, 3))
        before = np.isfinite(p).all() and (p[:, 2] > _LEAST_DEPTH_M).all()
        if any(self.camera.distortion) or not before:
            distance, index = self._vertex_tree.query(p, distance_upper_bound=reach_m)
            return np.where(np.isfinite(distance), index, -1).astype(np.int64)
        from core.surface.grid_kernels import vertices_near

        out, c = np.empty(len(p), np.int64), self.camera
        lens = c.fx, c.fy, c.cx, c.cy

        def work(first: int, last: int) -> None:
            k = slice(first, last)
            vertices_near(p[k], self.vertices, self.vertex_of_pixel, *lens, reach_m, out[k])

        in_chunks(work, len(p), _CHUNK)
        return out

    def point(self, triangle: int, barycentric: ArrayLike) -> SurfacePoint:
        """The surface point of a triangle with the given corner weights (3,)."""
        weights = np.asarray(barycentric, dtype=float)
        return SurfacePoint(triangle, weights, weights @ self.vertices[self.triangles[triangle]])

    def vertex_point(self, vertex: int) -> SurfacePoint:
        """A vertex as a surface point."""
        return self.nearest(self.vertices[vertex])[0]

    def positions(self, points: Sequence[SurfacePoint]) -> FloatArray:
        """Positions (k, 3) of surface points, from their triangles and weights."""
        return np.array([self.interpolate(self.vertices, p) for p in points]).reshape(-1, 3)

    def interpolate(self, values: NDArray[np.float64], point: SurfacePoint) -> NDArray[np.float64]:
        """Value at ``point`` of a field given per vertex, (n,) or (n, k): a scalar array or (k,)."""
        corners = values[self.triangles[point.triangle]]
        return np.asarray(point.barycentric @ corners)

    def normal_at(self, point: SurfacePoint) -> FloatArray:
        """Unit normal (3,) at a surface point, toward the camera."""
        normal = self.interpolate(self.normals, point)
        return np.asarray(normal / np.linalg.norm(normal))


def _compact(triangles: IntArray, count: int) -> tuple[IntArray, NDArray[np.int64]]:
    """Triangles renumbered to the vertices they use, and which those are."""
    used_mask = np.zeros(count, np.bool_)
    used_mask[triangles] = True
    used = np.flatnonzero(used_mask)
    number = np.full(count, -1, np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    return np.ascontiguousarray(number[triangles]), used
