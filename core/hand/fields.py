"""What every place on a hand's surface is known by: its distances to the anchors, the rim and the end.

Distances to the anchors alone leave the size of a hand open: a hand a little smaller, with all points a
little nearer to the marker, agrees as well. So two more distances are measured, which need no anchor: how
far the rim of the surface is, which tells the middle of a finger from its side, and how far the surface goes
on beyond a place, away from the anchors, which tells how much finger is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.geodesics import geodesic_solver
from core.geodesics.solver import GeodesicSolver
from core.hand.model import OWN_FIELDS
from core.hand.surface import HandSurface
from core.surface.body_surface import BodySurface

FloatArray = NDArray[np.float64]


_MOST_RIM_M = 0.02
_MOST_END_M = 0.2


@dataclass(frozen=True, eq=False)
class HandFields:
    """Distances on one hand's surface.

    Attributes
    ----------
    surface : BodySurface
    solver : GeodesicSolver
        For more sources on the same surface.
    values_m : ndarray (a + 2, n)
        At every vertex: geodesics from the anchors, then the distance to the rim and to the end.
    anchors_m : ndarray (a, 3)
        On the skin.
    """

    surface: BodySurface
    solver: GeodesicSolver
    values_m: FloatArray
    anchors_m: FloatArray

    def at(self, places_m: FloatArray) -> FloatArray:
        """Values (k, a + 2) at places (k, 3) on or near the skin."""
        triangles, weights, _ = self.surface.nearest_arrays(places_m)
        corners = self.surface.triangles[triangles]
        return np.asarray(np.einsum("kc,akc->ka", weights, self.values_m[:, corners]))


def measure_fields(hand: HandSurface, anchors_m: FloatArray, *, threads: int = 2) -> HandFields:
    """Distances of every vertex of a hand.

    Parameters
    ----------
    hand : HandSurface
    anchors_m : ndarray (a, 3)
        On or near the skin, depth-camera frame; NaN for one that is missing (its distances are NaN).
    """
    surface = hand.surface
    solver = geodesic_solver(surface.vertices, surface.triangles)
    there = np.isfinite(anchors_m).all(axis=1)
    on_skin = surface.nearest(anchors_m[there])
    values = np.full((len(anchors_m) + OWN_FIELDS, len(surface.vertices)), np.nan)
    values[np.flatnonzero(there)] = solver.distances(on_skin, threads=threads)
    places = np.full(anchors_m.shape, np.nan)
    places[there] = [point.position_m for point in on_skin]
    values[-2] = rim_distance(surface)
    values[-1] = end_distance(surface, values[np.flatnonzero(there)].mean(axis=0))
    return HandFields(surface, solver, values, places)


def rim_distance(surface: BodySurface) -> FloatArray:
    """Distance (n,) of every vertex to the rim as the camera sees it, at most 2 cm."""
    vertex = surface.vertex_of_pixel
    inner = np.zeros(vertex.shape, np.uint8)
    inner[surface.pixels[:, 1], surface.pixels[:, 0]] = ~surface.boundary
    pixels = cv2.distanceTransform(inner, cv2.DIST_L2, 5)[surface.pixels[:, 1], surface.pixels[:, 0]]
    return np.asarray(np.minimum(pixels * surface.vertices[:, 2] / surface.camera.fx, _MOST_RIM_M))


def end_distance(surface: BodySurface, away_m: FloatArray) -> FloatArray:
    """How far (n,) the surface goes on beyond every vertex, away from the anchors.

    Parameters
    ----------
    surface : BodySurface
    away_m : ndarray (n,)
        Mean distance from the anchors.
    """
    from core.hand.fit_kernels import farthest_beyond

    height = np.where(np.isfinite(away_m), away_m, -1.0)
    start, neighbours = _neighbours(surface.triangles, len(height))
    out = np.zeros(len(height))
    farthest_beyond(height, np.argsort(-height, kind="stable"), start, neighbours, out)
    return np.clip(out - height, 0.0, _MOST_END_M)


def _neighbours(triangles: NDArray[np.int32], count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Neighbours of every vertex in a row, and where each one's begin (some are named twice)."""
    one = triangles[:, (0, 1, 2)].ravel()
    other = triangles[:, (1, 2, 0)].ravel()
    source, target = np.concatenate([one, other]), np.concatenate([other, one])
    start = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(source, minlength=count), out=start[1:])
    return start, target[np.argsort(source, kind="stable")].astype(np.int32)
