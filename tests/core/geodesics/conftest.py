"""Shapes whose geodesics are known."""

from dataclasses import dataclass

import numpy as np
import pytest

from core.surface.points import SurfacePoint


@dataclass(frozen=True, eq=False)
class Shape:
    name: str
    vertices: np.ndarray
    triangles: np.ndarray
    pixels: np.ndarray

    def point(self, triangle, weights):
        weights = np.asarray(weights, dtype=float)
        return SurfacePoint(int(triangle), weights, weights @ self.vertices[self.triangles[triangle]])

    def vertex_point(self, vertex):
        triangle, corner = np.argwhere(self.triangles == vertex)[0]
        return self.point(triangle, np.eye(3)[corner])

    def true_distances(self, place):
        """From ``place`` (3,) to every vertex, by formula."""
        return self.true_distance(place, self.vertices)

    def true_distance(self, place, points):
        if self.name == "plane":
            return np.linalg.norm(points - place, axis=1)
        if self.name == "cylinder":
            turn = np.arctan2(points[:, 0], points[:, 2]) - np.arctan2(place[0], place[2])
            return np.hypot(0.5 * turn, points[:, 1] - place[1])
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        return np.arctan2(
            np.linalg.norm(np.cross(unit, place / np.linalg.norm(place)), axis=1),
            unit @ (place / np.linalg.norm(place)),
        )


def grid_triangles(columns, rows):
    v, u = np.divmod(np.arange(columns * rows), columns)
    c = np.flatnonzero((u < columns - 1) & (v < rows - 1))
    upper = np.stack([c, c + 1, c + columns], axis=1)
    lower = np.stack([c + 1, c + columns + 1, c + columns], axis=1)
    return np.vstack([upper, lower]).astype(np.int32), np.stack([u, v], axis=1).astype(np.int32)


def make_shape(name, side=100, jitter=0.25, seed=0):
    """Shape of ``side`` x ``side`` vertices about 1 m across, inner vertices moved along it at random."""
    triangles, pixels = grid_triangles(side, side)
    rng = np.random.default_rng(seed)
    moved = pixels + rng.uniform(-jitter, jitter, pixels.shape)
    edge = ((pixels == 0) | (pixels == side - 1)).any(axis=1)
    moved[edge] = pixels[edge]
    u, v = (moved / (side - 1)).T
    if name == "plane":
        vertices = np.stack([u, v, np.full(len(u), 2.0)], axis=1)
    elif name == "cylinder":
        vertices = np.stack([0.5 * np.sin(2.0 * u), v, 0.5 * np.cos(2.0 * u)], axis=1)
    else:
        # A square seen from the centre: great circles are its straight lines, so it is convex.
        vertices = np.stack([2.0 * u - 1.0, 2.0 * v - 1.0, np.ones(len(u))], axis=1)
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return Shape(name, vertices, triangles, pixels)


@pytest.fixture(scope="session", params=["plane", "sphere", "cylinder"])
def shape(request):
    return make_shape(request.param)


@pytest.fixture(scope="session")
def plane():
    return make_shape("plane", side=60)


@pytest.fixture(scope="session")
def shape_of():
    return make_shape


@pytest.fixture(scope="session")
def triangles_of_grid():
    return grid_triangles
