"""Many picture pixels become places on the skin at once, as a click does one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.surface.scan import BodyScan

FloatArray = NDArray[np.float64]

# As for a click: see core.surface.picking.
_LIFT_M = 0.012
_RIM_M = 0.004
_FARTHER_M = 0.03
_FLAT = 0.15
_RIM_NEIGHBOURS = 12


@dataclass(frozen=True, eq=False)
class Lifted:
    """Skin under picture pixels, row by row; rows without skin have ``on_skin`` False and NaN places.

    Attributes
    ----------
    on_skin : ndarray (n,) bool
    points_m : ndarray (n, 3)
        Depth-camera frame.
    normals : ndarray (n, 3)
        Unit, toward the camera.
    triangles : ndarray (n,) int32
    barycentric : ndarray (n, 3)
    at_rim : ndarray (n,) bool
        On the tangent plane beside the measured skin.
    """

    on_skin: NDArray[np.bool_]
    points_m: FloatArray
    normals: FloatArray
    triangles: NDArray[np.int32]
    barycentric: FloatArray
    at_rim: NDArray[np.bool_]


def lift_pixels(scan: BodyScan, pixels: FloatArray) -> Lifted:
    """The skin under picture pixels (n, 2): where their rays meet it, or beside its rim the tangent plane."""
    surface = scan.surface
    origin, directions = scan.capture.rig.picture_rays(pixels)
    hits = surface.raycast(origin, directions)
    corners = surface.triangles[np.maximum(hits.triangle, 0)]
    normals = np.einsum("nk,nkx->nx", hits.barycentric, surface.normals[corners])
    points = origin + np.where(hits.hit, hits.t, np.nan)[:, None] * directions
    triangles, weights = hits.triangle.copy(), hits.barycentric.copy()
    lifted, rim_points, rim_normals = _beside_rim(scan, origin, directions, pixels, hits.t)
    if lifted.any():
        points[lifted], normals[lifted] = rim_points[lifted], rim_normals[lifted]
        triangles[lifted], weights[lifted] = surface.tree.nearest(points[lifted])
    on_skin = hits.hit | lifted
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(on_skin[:, None], normals / np.maximum(length, 1e-12), np.nan)
    weights[~on_skin] = np.nan
    return Lifted(on_skin, points, normals, triangles, weights, lifted)


def _beside_rim(
    scan: BodyScan, origin: FloatArray, directions: FloatArray, pixels: FloatArray, through: FloatArray
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Which rays belong to the rim of a nearer part; there their points and normals."""
    surface = scan.surface
    count = len(pixels)
    points, normals = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    rim = np.flatnonzero(surface.boundary)
    rim = rim[np.isfinite(scan.vertex_picture_pixels[rim]).all(axis=1)]
    if len(rim) == 0 or count == 0:
        return np.zeros(count, np.bool_), points, normals
    camera = scan.capture.rig.picture_camera
    nearest_m = float(scan.capture.rig.picture_from_depth.apply(surface.vertices[rim])[:, 2].min())
    reach = 1.5 * _LIFT_M * max(camera.fx, camera.fy) / max(nearest_m, 0.1)
    k = min(_RIM_NEIGHBOURS, len(rim))
    away, rows = cKDTree(scan.vertex_picture_pixels[rim]).query(pixels, k=k, distance_upper_bound=reach)
    away, rows = away.reshape(count, k), rows.reshape(count, k)
    none = ~np.isfinite(away)
    vertex = rim[np.where(none, 0, rows)]
    length = np.linalg.norm(directions, axis=1)
    unit = directions / length[:, None]
    from_origin = surface.vertices[vertex] - origin
    along = np.einsum("nkx,nx->nk", from_origin, unit)
    off = np.linalg.norm(from_origin - along[..., None] * unit[:, None, :], axis=2)
    limit = np.where(np.isfinite(through), _RIM_M, _LIFT_M)
    behind = along >= (through * length - _FARTHER_M)[:, None]
    off = np.where(none | behind | (along <= 0) | (off >= limit[:, None]), np.inf, off)
    best = off.argmin(axis=1)
    every = np.arange(count)
    lifted = np.isfinite(off[every, best])
    chosen = vertex[every, best]
    normals = np.where(lifted[:, None], surface.normals[chosen], np.nan)
    position = origin + along[every, best][:, None] * unit
    flat = np.einsum("nx,nx->n", surface.normals[chosen], unit)
    steep = np.abs(flat) <= _FLAT
    plane = np.einsum("nx,nx->n", surface.normals[chosen], from_origin[every, best])
    on_plane = origin + (plane / np.where(steep, 1.0, flat))[:, None] * unit
    usable = ~steep & (np.linalg.norm(on_plane - surface.vertices[chosen], axis=1) < 2.0 * _LIFT_M)
    points = np.where(lifted[:, None], np.where(usable[:, None], on_plane, position), np.nan)
    return lifted, points, normals
